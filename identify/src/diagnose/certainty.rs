//! Steps 2 and 7: what the data determine, and how well.

use super::result::Estimate;
use super::test::reduce;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, fit};
use crate::shoot::Plan;
use nalgebra::{DMatrix, SymmetricEigen};

/// Two-sided 90 % of a normal.
const Z90: f64 = 1.644_853_626_951_472_6;
/// χ²₁ at 90 %.
const DEVIANCE90: f64 = 2.705_543_454_095_404;
/// Singular values below this part of the largest are not determined.
const RANK: f64 = 1e-6;
/// Secant steps towards an end of a profile interval.
const PROFILE_STEPS: usize = 5;

/// Curvature of the deviance in the fit's coordinates, initial states eliminated.
pub(super) struct Curvature {
    gram: DMatrix<f64>,
}

impl Curvature {
    pub(super) fn new(plan: &Plan, fitted: &Fitted) -> Result<Self, IdentifyError> {
        Ok(Self { gram: reduce(plan, fitted, &fitted.unknowns)?.gram() })
    }

    /// Standard error of each coordinate; infinite where nothing determines it.
    pub(super) fn std_errors(&self) -> Vec<f64> {
        let n = self.gram.nrows();
        match self.gram.clone().try_inverse() {
            Some(inverse) => (0..n).map(|j| inverse[(j, j)].max(0.0).sqrt()).collect(),
            None => vec![f64::INFINITY; n],
        }
    }

    /// Combinations of parameters without influence, in words.
    pub(super) fn unidentifiable(&self, fitted: &Fitted) -> Vec<String> {
        if self.gram.nrows() == 0 {
            return Vec::new();
        }
        let eigen = SymmetricEigen::new(self.gram.clone());
        let largest = eigen.eigenvalues.max();
        let weak = (0..self.gram.nrows()).filter(|&j| eigen.eigenvalues[j] < RANK * RANK * largest);
        let word = |j: usize| {
            let v = eigen.eigenvectors.column(j);
            let parts =
                fitted.unknowns.iter().zip(v.iter()).filter(|(_, x)| x.abs() > 0.1).map(|(u, x)| format!("{x:+.2}·{}", u.path));
            parts.collect::<Vec<_>>().join(" ")
        };
        weak.map(word).collect()
    }
}

/// Estimates with intervals from the curvature.
pub(super) fn estimates(plan: &Plan, fitted: &Fitted, curvature: &Curvature) -> Vec<Estimate> {
    let errors = curvature.std_errors();
    let one = |(u, se): (&crate::unknown::Unknown, &f64)| {
        let value = u.value(&fitted.values);
        let end = |z: f64| {
            if se.is_finite() {
                u.moved(value, z * se)
            } else if z < 0.0 {
                u.bounds.0
            } else {
                u.bounds.1
            }
        };
        Estimate {
            path: u.path.clone(),
            estimate: value,
            unit: u.unit.clone(),
            interval: [end(-Z90), end(Z90)],
            scene_value: u.value(&plan.scene_values),
        }
    };
    fitted.unknowns.iter().zip(&errors).map(one).collect()
}

/// 90 % profile-likelihood interval of unknown `j`: where the deviance, minimised over all else, has risen by χ²₁(0.90).
pub(super) fn profile(
    plan: &Plan,
    fitted: &Fitted,
    j: usize,
    std_error: f64,
    options: &FitOptions,
) -> Result<[f64; 2], IdentifyError> {
    let u = &fitted.unknowns[j];
    let best = u.value(&fitted.values);
    if !std_error.is_finite() {
        return Ok([u.bounds.0, u.bounds.1]);
    }
    let whitened = |f: &Fitted| -> Result<f64, IdentifyError> {
        let slices: Vec<&[f64]> = f.residuals.iter().map(Vec::as_slice).collect();
        let own: f64 = f.records.iter().flat_map(|r| &r.start.z).map(|z| z * z).sum();
        Ok(fitted.noise.minus_two_log_likelihood(&slices)? + own)
    };
    let base = whitened(fitted)?;
    let others: Vec<_> = fitted.unknowns.iter().enumerate().filter(|(k, _)| *k != j).map(|(_, u)| u.clone()).collect();
    let fixed = FitOptions { rounds: 0, max_iterations: 6, tolerance: 1e-5, ..*options };
    let rise = |value: f64| -> Result<f64, IdentifyError> {
        let mut start = fitted.values.clone();
        u.set(&mut start, value);
        let at = fit(plan, &fitted.records, &start, &others, Some(&fitted.noise), &fixed)?;
        Ok((whitened(&at)? - base).max(0.0))
    };
    let mut ends = [best; 2];
    for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
        // the deviance is close to a parabola: its square root is close to linear
        let mut reach = Z90 * std_error;
        for _ in 0..PROFILE_STEPS {
            let value = u.moved(best, sign * reach);
            *end = value;
            if value <= u.bounds.0 || value >= u.bounds.1 {
                break;
            }
            let risen = rise(value)?;
            let factor = (DEVIANCE90 / risen.max(1e-3)).sqrt().clamp(0.4, 2.5);
            if (factor - 1.0).abs() < 0.05 {
                break;
            }
            reach *= factor;
        }
    }
    Ok(ends)
}
