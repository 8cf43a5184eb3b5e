//! A fit beside changes of its readings, as another simulation makes them: all inner products from one pass of sensitivities.
//!
//! With G the whitened sensitivities of everything fitted (starting states projected off), r what is left and Δ a change of the readings,
//! whitened and projected alike, the estimates move by
//! ```text
//! b = (GᵀG)⁻¹ GᵀΔ
//! ```
//! if Δ is taken off the data, and the squares of what is then left are those of r − Δ less what a refit takes of them.

use super::procedure::solved;
use super::scores::reduce_beside;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::reduced::Reduced;
use nalgebra::{DMatrix, DVector};

/// See the module.
pub(super) struct Beside {
    /// Of the fit alone.
    pub reduced: Reduced,
    changes: Vec<Change>,
}

/// Inner products of a change.
struct Change {
    /// GᵀΔ.
    along: DVector<f64>,
    /// ΔᵀΔ.
    square: f64,
    /// Δᵀr.
    with_residual: f64,
}

impl Beside {
    /// `changes`: of every record, rows (time, channel).
    pub fn new(plan: &Plan, fitted: &Fitted, changes: &[&[Vec<f64>]]) -> Result<Self, IdentifyError> {
        let (k, whole) = (fitted.unknowns.len(), reduce_beside(plan, fitted, &fitted.unknowns, changes)?);
        let (gram, score) = (whole.gram(), whole.score());
        let one =
            |j: usize| Change { along: gram.column(j).rows(0, k).into_owned(), square: gram[(j, j)], with_residual: score[j] };
        Ok(Self { reduced: whole.first(k), changes: (k..k + changes.len()).map(one).collect() })
    }

    /// b, in the coordinates of everything fitted.
    pub fn sizes(&self, change: usize) -> DVector<f64> {
        solved(&self.reduced.gram(), &self.changes[change].along)
    }

    /// Squares that a simulation with this change takes from the fit, whatever is free refitted (linearized).
    pub fn gain(&self, change: usize) -> f64 {
        let (gram, score, d) = (self.reduced.gram(), self.reduced.score(), &self.changes[change]);
        let fitted = |s: &DVector<f64>| s.dot(&solved(&gram, s));
        2.0 * d.with_residual - d.square + fitted(&(&score - &d.along)) - fitted(&score)
    }

    /// Squares of the change that none of what is fitted imitates, where a curvature `known` holds it besides.
    pub fn beyond(&self, change: usize, known: &DMatrix<f64>) -> f64 {
        let d = &self.changes[change];
        (d.square - d.along.dot(&solved(&(known + self.reduced.gram()), &d.along))).max(0.0)
    }
}
