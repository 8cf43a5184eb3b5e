//! A fit beside changes of its readings, as another simulation makes them: all inner products from one pass of sensitivities.
//!
//! With G the whitened sensitivities of everything fitted (starting states projected off), r what is left and Δ a change of the readings,
//! whitened and projected alike, the estimates move by
//! ```text
//! b = (GᵀG)⁻¹ GᵀΔ
//! ```
//! if Δ is taken off the data, and the squares of what is then left are those of r − Δ less what a refit takes of them.

use super::policy::POLICY;
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
        let (k, whole) =
            (fitted.unknowns.len(), reduce_beside(plan, fitted, &fitted.unknowns, changes, POLICY.constancy_blocks)?);
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
        let [with_residual, square] = self.off_the_fit(change);
        2.0 * with_residual - square
    }

    /// The same with that part of the change, none to all of it, that takes most.
    pub fn most(&self, change: usize) -> f64 {
        let [with_residual, square] = self.off_the_fit(change);
        let part = (with_residual / square.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        part * (2.0 * with_residual - part * square)
    }

    /// What nothing fitted takes up of a change, over what is left \[-\].
    pub fn over_left(&self, change: usize) -> f64 {
        (self.off_the_fit(change)[1].max(0.0) / self.reduced.rss().max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Δᵀr and ΔᵀΔ with everything fitted projected off.
    fn off_the_fit(&self, change: usize) -> [f64; 2] {
        let d = &self.changes[change];
        let fitted = solved(&self.reduced.gram(), &d.along);
        [d.with_residual - fitted.dot(&self.reduced.score()), d.square - fitted.dot(&d.along)]
    }

    /// Squares of the change that none of what is fitted imitates, where a curvature `known` holds it besides.
    pub fn beyond(&self, change: usize, known: &DMatrix<f64>) -> f64 {
        let d = &self.changes[change];
        (d.square - d.along.dot(&solved(&(known + self.reduced.gram()), &d.along))).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::policy::POLICY;
    use super::super::scores::reduce;
    use super::*;
    use crate::fit::fit;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;
    use crate::unknown::Unknown;

    /// A change that the parameter makes is taken for its size, takes nothing beyond it, and as a change of the simulation takes nothing; what
    /// is left itself takes all that a refit does not.
    #[test]
    fn a_change_is_what_it_imitates() {
        let swing = |seed| {
            gaussians(40, seed).iter().zip(0..40).map(|(e, k)| 0.4 * (5.7 * 0.01 * f64::from(k)).cos() + 1e-3 * e).collect()
        };
        let plan = experiment(&pendulum("measured"), &[swing(1), swing(2), swing(3)]).0;
        let damping = vec![Unknown::of_theta(&plan.model, "pivot.damping", 0.01).unwrap()];
        let white = ArModel::white(vec![1e-3]).unwrap();
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &damping, Some(&white), &POLICY.fine).unwrap();
        let wants = ShotWants { unknowns: &damping, tangents: true, ..ShotWants::default() };
        let made: Vec<Vec<f64>> = fitted
            .records
            .iter()
            .map(|rec| shoot(&plan, rec, &fitted.values, wants).unwrap().global.iter().map(|d| 3.0 * d).collect())
            .collect();
        let beside = Beside::new(&plan, &fitted, &[&made, &fitted.residuals]).unwrap();
        assert!((beside.sizes(0)[0] - 3.0).abs() < 1e-6, "{:?}", beside.sizes(0));
        assert!(beside.gain(0).abs() < 1e-6 && beside.beyond(0, &DMatrix::zeros(1, 1)) < 1e-6, "{}", beside.gain(0));
        let alone = reduce(&plan, &fitted, &damping).unwrap();
        let score = alone.score();
        let left = alone.rss() - score.dot(&solved(&alone.gram(), &score));
        let all = (left / alone.rss()).sqrt();
        assert!(beside.over_left(0) < 1e-6 && (beside.over_left(1) / all - 1.0).abs() < 0.02, "{} {all}", beside.over_left(1));
        assert!((beside.reduced.rss() / alone.rss() - 1.0).abs() < 1e-9 && beside.reduced.columns() == 1);
        assert!((beside.gain(1) / left - 1.0).abs() < 0.02, "{} {left}", beside.gain(1));
        // a fit that has not quite ended takes something of its own residual; of twice that all of it takes nothing, and half of it everything; of its opposite no part takes anything
        let [twice, against] =
            [2.0, -1.0].map(|by| fitted.residuals.iter().map(|r| r.iter().map(|r| by * r).collect()).collect::<Vec<Vec<f64>>>());
        let beside = Beside::new(&plan, &fitted, &[&twice, &against]).unwrap();
        assert!(
            beside.gain(0).abs() < 1e-3 * left && (beside.most(0) / left - 1.0).abs() < 0.02,
            "{} {}",
            beside.gain(0),
            beside.most(0)
        );
        assert!(beside.gain(1) < -2.9 * left && beside.most(1) == 0.0);
    }
}
