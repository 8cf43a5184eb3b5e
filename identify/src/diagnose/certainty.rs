//! Steps 2 and 7: the combinations that the data determine, and intervals.

use super::constants::DIAGNOSE;
use super::result::Estimate;
use super::scores::reduce;
use crate::error::IdentifyError;
use crate::fit::{Fitted, fit};
use crate::shooting::Plan;
use crate::unknown::{Unknown, Values};
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// Two-sided 90 % of a normal.
const Z90: f64 = 1.644_853_626_951_472_6;
/// χ²₁ at 90 %.
const DEVIANCE90: f64 = 2.705_543_454_095_404;

/// Curvature of the deviance in the fit's coordinates, initial states eliminated, by its principal directions.
///
/// Each coordinate is measured by its own influence: its typical size may be off by orders of magnitude (a cubic spring is one N/m³ or a
/// million), and that says nothing of whether the data determine it.
pub(super) struct Curvature {
    eigen: SymmetricEigen<f64, Dyn>,
    /// Square root of each coordinate's own curvature; 1 where there is none.
    lengths: DVector<f64>,
}

impl Curvature {
    pub(super) fn new(plan: &Plan, fitted: &Fitted) -> Result<Self, IdentifyError> {
        Ok(Self::of(reduce(plan, fitted, &fitted.unknowns)?.gram()))
    }

    fn of(gram: DMatrix<f64>) -> Self {
        let own: Vec<f64> = gram.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
        let dust = DIAGNOSE.no_column * own.iter().copied().fold(0.0, f64::max);
        let influence = |j: usize| own[j] > dust;
        let lengths = DVector::from_fn(own.len(), |j, _| if influence(j) { own[j] } else { 1.0 });
        let unit = |i, j| if influence(i) && influence(j) { gram[(i, j)] / (lengths[i] * lengths[j]) } else { 0.0 };
        let scaled = DMatrix::from_fn(own.len(), own.len(), unit);
        let empty = SymmetricEigen { eigenvectors: DMatrix::zeros(0, 0), eigenvalues: DVector::zeros(0) };
        Self { eigen: if scaled.is_empty() { empty } else { SymmetricEigen::new(scaled) }, lengths }
    }

    /// Numbers of the directions without influence.
    fn weak(&self) -> Vec<usize> {
        let values = &self.eigen.eigenvalues;
        let least = self.least();
        (0..values.len()).filter(|&k| values[k] <= least).collect()
    }

    /// The curvature up to which a direction is not determined.
    fn least(&self) -> f64 {
        DIAGNOSE.undetermined * DIAGNOSE.undetermined * self.eigen.eigenvalues.iter().copied().fold(0.0, f64::max)
    }

    /// Standard error of each coordinate; infinite where nothing determines it.
    ///
    /// By the principal directions, not by the inverse: that of a nearly singular matrix has a diagonal of either sign, and an
    /// error of zero would be the opposite of the truth.
    pub(super) fn std_errors(&self) -> Vec<f64> {
        let (vectors, values) = (&self.eigen.eigenvectors, &self.eigen.eigenvalues);
        let (weak, least) = (self.weak(), self.least());
        let one = |j: usize| {
            if weak.iter().any(|&k| vectors[(j, k)].abs() > DIAGNOSE.component) {
                return f64::INFINITY;
            }
            let parts = (0..values.len()).map(|k| vectors[(j, k)].powi(2) / values[k].max(least).max(f64::MIN_POSITIVE));
            parts.sum::<f64>().sqrt() / self.lengths[j]
        };
        (0..vectors.nrows()).map(one).collect()
    }

    /// Combinations of parameters without influence, in words.
    pub(super) fn unidentifiable(&self, fitted: &Fitted) -> Vec<String> {
        let word = |k: usize| {
            // back from coordinates of equal influence to those of the fit
            let v = self.eigen.eigenvectors.column(k).component_div(&self.lengths).normalize();
            let parts = fitted.unknowns.iter().zip(v.iter()).filter(|(_, x)| x.abs() > DIAGNOSE.component);
            parts.map(|(u, x)| format!("{x:+.2}·{}", u.path)).collect::<Vec<_>>().join(" ")
        };
        self.weak().into_iter().map(word).collect()
    }
}

/// Standard errors of the coordinates from the moves of the estimates without each record in turn: for a missing effect that differs from
/// record to record by an amount that no noise model describes. Linearized, at an optimum with score Σ s_r = 0 and curvature G = Σ G_r:
/// ```text
/// δ_r = (G − G_r)⁻¹ s_r,        variance (R − 1)/R Σ δ_r²
/// ```
/// the jackknife over records (CR3 of Bell & McCaffrey 2002). An effect that all records lack alike is not in it.
pub(super) fn by_record(plan: &Plan, fitted: &Fitted) -> Result<Vec<f64>, IdentifyError> {
    let reduced = reduce(plan, fitted, &fitted.unknowns)?;
    let (k, records) = (reduced.columns(), reduced.records());
    let gram = reduced.gram();
    let lengths = DVector::from_fn(k, |j, _| gram[(j, j)].max(f64::MIN_POSITIVE).sqrt());
    let mut parts = vec![(DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k)); records];
    for block in reduced.blocks() {
        parts[block.record].0 += &block.gram;
        parts[block.record].1 += &block.score;
    }
    let mut squares = vec![0.0; k];
    for (own, score) in &parts {
        let rest = DMatrix::from_fn(k, k, |i, j| (gram[(i, j)] - own[(i, j)]) / (lengths[i] * lengths[j]));
        let moved = rest.svd(true, true).solve(&score.component_div(&lengths), DIAGNOSE.undetermined * DIAGNOSE.undetermined);
        let moved = moved.unwrap_or_else(|_| DVector::from_element(k, f64::INFINITY));
        squares.iter_mut().zip(moved.iter().zip(lengths.iter())).for_each(|(sum, (d, length))| *sum += (d / length).powi(2));
    }
    let of_curvature = Curvature::of(gram).std_errors();
    let share = (records as f64 - 1.0) / records.max(1) as f64;
    let one = |(sum, determined): (f64, f64)| {
        if records > 1 && determined.is_finite() { (share * sum).sqrt() } else { f64::INFINITY }
    };
    Ok(squares.into_iter().zip(of_curvature).map(one).collect())
}

/// Estimates with intervals from standard errors of their coordinates.
pub(super) fn estimates(plan: &Plan, fitted: &Fitted, errors: &[f64]) -> Vec<Estimate> {
    let one = |(u, se): (&Unknown, &f64)| Estimate {
        path: u.path.clone(),
        estimate: u.value(&fitted.values),
        unit: u.unit.clone(),
        interval: Some(by_curvature(u, &fitted.values, *se)),
        scene_value: u.value(&plan.scene_values),
    };
    fitted.unknowns.iter().zip(errors).map(one).collect()
}

/// 90 % interval from a standard error of the coordinate; its bounds where nothing determines it.
pub(super) fn by_curvature(u: &Unknown, values: &Values, std_error: f64) -> [f64; 2] {
    if !std_error.is_finite() {
        return [u.bounds.0, u.bounds.1];
    }
    let value = u.value(values);
    rising([-Z90, Z90].map(|z| u.far(value, z * std_error)))
}

/// 90 % profile-likelihood interval of unknown `j`: where the deviance, minimised over all else, has risen by χ²₁(0.90).
pub(super) fn profile(plan: &Plan, fitted: &Fitted, j: usize, std_error: f64) -> Result<[f64; 2], IdentifyError> {
    let u = &fitted.unknowns[j];
    if !std_error.is_finite() {
        return Ok([u.bounds.0, u.bounds.1]);
    }
    let whitened = |f: &Fitted| -> Result<f64, IdentifyError> {
        let slices: Vec<&[f64]> = f.residuals.iter().map(Vec::as_slice).collect();
        let own: f64 = f.records.iter().flat_map(|r| &r.start.z).map(|z| z * z).sum();
        Ok(fitted.noise.minus_two_log_likelihood(&slices)? + own)
    };
    // the fit ended under the noise model before the last one: the deviance is at its least a little further on
    let fixed = DIAGNOSE.profile_fit;
    let least = fit(plan, &fitted.records, &fitted.values, &fitted.unknowns, Some(&fitted.noise), &fixed)?;
    let (base, best) = (whitened(&least)?, u.value(&least.values));
    let others: Vec<_> = fitted.unknowns.iter().enumerate().filter(|(k, _)| *k != j).map(|(_, u)| u.clone()).collect();
    let rise = |value: f64| -> Result<f64, IdentifyError> {
        let mut start = least.values.clone();
        u.set(&mut start, value);
        // a value with which the records cannot even be simulated lies outside
        let Ok(at) = fit(plan, &least.records, &start, &others, Some(&fitted.noise), &fixed) else { return Ok(f64::INFINITY) };
        Ok((whitened(&at)? - base).max(0.0))
    };
    let mut ends = [best; 2];
    for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
        // the deviance is close to a parabola: its square root is close to linear
        let mut reach = Z90 * std_error;
        for _ in 0..DIAGNOSE.profile_steps {
            let value = u.moved(best, sign * reach);
            *end = value;
            if value <= u.bounds.0 || value >= u.bounds.1 {
                break;
            }
            let risen = rise(value)?;
            let factor = (DEVIANCE90 / risen.max(DIAGNOSE.profile_least_rise))
                .sqrt()
                .clamp(DIAGNOSE.profile_stretch.0, DIAGNOSE.profile_stretch.1);
            if (factor - 1.0).abs() < DIAGNOSE.profile_settled {
                break;
            }
            reach *= factor;
        }
    }
    Ok(rising(ends))
}

/// Ends of an interval of the value, whichever way its coordinate runs.
fn rising([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_singular_matrix_does_not_determine_has_no_finite_error() {
        // the second and third columns have the same effect to rounding: their inverse's diagonal may come out negative
        let effect = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.3, 2.0, 2.0 + 1e-9]];
        let j = DMatrix::from_fn(3, 3, |r, c| 1e3 * effect[r][c]);
        let errors = Curvature::of(j.transpose() * &j).std_errors();
        assert!((1e3 * errors[0] - 1.0).abs() < 0.1, "{errors:?}");
        assert!(errors[1].is_infinite() && errors[2].is_infinite(), "{errors:?}");
    }

    #[test]
    fn a_typical_size_that_is_off_by_orders_of_magnitude_hides_nothing() {
        // the second coordinate's unit is 1e-7 of what it should be: its error is large in that unit, not unknown
        let (s, c) = (1e-7, 0.6);
        let gram = DMatrix::from_row_slice(2, 2, &[1.0, c * s, c * s, s * s]);
        let errors = Curvature::of(gram).std_errors();
        let own = (1.0f64 / (1.0 - c * c)).sqrt();
        assert!((errors[0] / own - 1.0).abs() < 1e-9 && (s * errors[1] / own - 1.0).abs() < 1e-9, "{errors:?}");
    }

    #[test]
    fn the_errors_are_those_of_the_inverse_where_it_exists() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 9.0]);
        let errors = Curvature::of(gram).std_errors();
        assert!((errors[0] - (9.0f64 / 35.0).sqrt()).abs() < 1e-12 && (errors[1] - (4.0f64 / 35.0).sqrt()).abs() < 1e-12);
        assert!(Curvature::of(DMatrix::zeros(1, 1)).std_errors()[0].is_infinite());
        assert!(Curvature::of(DMatrix::zeros(0, 0)).std_errors().is_empty());
    }
}
