//! Is the size of an accepted cause the same everywhere? A law that only imitates another needs another size in every part.
//!
//! With u the whitened sensitivity to one of the cause's parameters, everything else that is fitted projected off, a stretch b of
//! a record has the score S_b = u_bᵀr_b and the information I_b = |u_b|². If the law is right, S_b/I_b scatters about zero with
//! variance 1/I_b. Two tests, Bonferroni over them and over the parameters:
//! - *by part*: Σ S_b²/I_b − (Σ S_b)²/Σ I_b against χ² of one less than the number of parts;
//! - *by amplitude*: does the size trend with the effect's own amplitude a_b = √(I_b/rows)? z = Σ (a_b − ā) S_b / √Σ (a_b − ā)² I_b.
//!   Dry friction in place of viscous damping, hardening in place of stiffness show here.

use super::policy::POLICY;
use crate::fit::Fitted;
use crate::stats::dist::{chi2_sf, normal_cdf};
use crate::stats::reduced::{Block, Reduced};
use crate::unknown::Unknown;
use nalgebra::{DMatrix, DVector};

/// Smallest p over the parameters of a cause; 1 where there are too few parts to compare. `reduced`: of the fit, cut into [`POLICY`]`.constancy_blocks`.
pub(super) fn p_value(reduced: &Reduced, fitted: &Fitted, own: &[Unknown]) -> f64 {
    let columns: Vec<usize> =
        (0..fitted.unknowns.len()).filter(|&j| own.iter().any(|o| o.target.same(&fitted.unknowns[j].target))).collect();
    let smallest = columns.iter().map(|&c| of_column(reduced, c)).fold(1.0, f64::min);
    (smallest * columns.len() as f64).min(1.0)
}

fn of_column(reduced: &Reduced, column: usize) -> f64 {
    let direction = free_direction(&reduced.gram(), column);
    let parts: Vec<Part> = reduced.blocks().iter().map(|b| Part::new(b, &direction)).collect();
    (2.0 * by_part(&parts).min(by_amplitude(&parts))).min(1.0)
}

/// Coefficients of the columns in u: 1 for its own, those of the projection for the others.
fn free_direction(gram: &DMatrix<f64>, column: usize) -> DVector<f64> {
    let n = gram.nrows();
    let others: Vec<usize> = (0..n).filter(|&j| j != column).collect();
    let mut direction = DVector::zeros(n);
    direction[column] = 1.0;
    if others.is_empty() {
        return direction;
    }
    let inner = DMatrix::from_fn(others.len(), others.len(), |i, j| gram[(others[i], others[j])]);
    let against = DVector::from_fn(others.len(), |i, _| gram[(others[i], column)]);
    if let Ok(weights) = inner.svd(true, true).solve(&against, POLICY.singular) {
        others.iter().zip(weights.iter()).for_each(|(&j, w)| direction[j] = -w);
    }
    direction
}

/// A stretch of a record.
struct Part {
    score: f64,
    information: f64,
    amplitude: f64,
}

impl Part {
    fn new(block: &Block, direction: &DVector<f64>) -> Self {
        let information = direction.dot(&(&block.gram * direction)).max(0.0);
        Self { score: direction.dot(&block.score), information, amplitude: (information / block.rows.max(1) as f64).sqrt() }
    }
}

fn by_part(parts: &[Part]) -> f64 {
    let mean = parts.iter().map(|p| p.information).sum::<f64>() / parts.len().max(1) as f64;
    let telling: Vec<&Part> = parts.iter().filter(|p| p.information > POLICY.feeble_part * mean).collect();
    if telling.len() < 2 {
        return 1.0;
    }
    let (score, information) = telling.iter().fold((0.0, 0.0), |s, p| (s.0 + p.score, s.1 + p.information));
    let spread: f64 = telling.iter().map(|p| p.score * p.score / p.information).sum();
    chi2_sf((spread - score * score / information).max(0.0), telling.len() as f64 - 1.0)
}

fn by_amplitude(parts: &[Part]) -> f64 {
    let information: f64 = parts.iter().map(|p| p.information).sum();
    let mean = parts.iter().map(|p| p.amplitude * p.information).sum::<f64>() / information;
    let variance: f64 = parts.iter().map(|p| (p.amplitude - mean).powi(2) * p.information).sum();
    let trend: f64 = parts.iter().map(|p| (p.amplitude - mean) * p.score).sum();
    let z = trend / variance.sqrt();
    if z.is_finite() { 2.0 * normal_cdf(-z.abs()) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(size: impl Fn(f64) -> f64) -> Vec<Part> {
        let noise = [0.4, -1.1, 0.3, 0.9, -0.6, 0.2, -0.3, 0.5];
        let one = |(k, noise): (usize, &f64)| {
            let amplitude = 0.5 + 0.25 * k as f64;
            let information = 100.0 * amplitude * amplitude;
            Part { score: information * size(amplitude) + noise * information.sqrt(), information, amplitude }
        };
        noise.iter().enumerate().map(one).collect()
    }

    #[test]
    fn a_constant_size_is_constant() {
        // at an optimum the scores sum to zero, so a constant size is zero
        let parts = parts(|_| 0.0);
        assert!(by_part(&parts) > 0.1 && by_amplitude(&parts) > 0.1);
    }

    #[test]
    fn a_size_that_falls_with_amplitude_is_seen() {
        let parts = parts(|a| 0.6 * (1.0 / a - 0.8));
        assert!(by_amplitude(&parts) < 1e-3, "{}", by_amplitude(&parts));
        assert!(by_part(&parts) < 0.01, "{}", by_part(&parts));
    }

    #[test]
    fn other_parameters_are_projected_off() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 3.0]);
        let direction = free_direction(&gram, 1);
        assert!(((&gram * direction)[0]).abs() < 1e-12);
    }
}
