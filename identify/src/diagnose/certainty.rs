//! Steps 2 and 7: the combinations that the data determine, and intervals.

use super::beside::Beside;
use super::policy::POLICY;
use super::procedure::across::solved;
use super::result::{Estimate, Numerics};
use super::scores::reduce;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::dist::t_quantile;
use crate::stats::reduced::Reduced;
use crate::unknown::{Unknown, Values};
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// Two-sided 90 % of a normal.
const Z90: f64 = 1.644_853_626_951_472_6;
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
        let dust = POLICY.no_column * own.iter().copied().fold(0.0, f64::max);
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
        POLICY.undetermined * POLICY.undetermined * self.eigen.eigenvalues.iter().copied().fold(0.0, f64::max)
    }

    /// Standard error of each coordinate; infinite where nothing determines it.
    ///
    /// By the principal directions, not by the inverse: that of a nearly singular matrix has a diagonal of either sign, and an
    /// error of zero would be the opposite of the truth.
    pub(super) fn std_errors(&self) -> Vec<f64> {
        let (vectors, values) = (&self.eigen.eigenvectors, &self.eigen.eigenvalues);
        let (weak, least) = (self.weak(), self.least());
        let one = |j: usize| {
            if weak.iter().any(|&k| vectors[(j, k)].abs() > POLICY.component) {
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
            let parts = fitted.unknowns.iter().zip(v.iter()).filter(|(_, x)| x.abs() > POLICY.component);
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
/// the jackknife over records (CR3 of Bell & McCaffrey 2002). An effect that all records lack alike is not in it, and a record that alone tells a
/// number is left out of the number's sum.
fn by_record(reduced: &Reduced) -> Vec<f64> {
    let (k, records) = (reduced.columns(), reduced.records());
    let mut parts = vec![(DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k)); records];
    for block in reduced.blocks() {
        parts[block.record].0 += &block.gram;
        parts[block.record].1 += &block.score;
    }
    let gram = reduced.gram();
    let of_curvature = Curvature::of(gram.clone()).std_errors();
    let squares = moves(&gram, &parts, &of_curvature);
    let share = (records as f64 - 1.0) / records.max(1) as f64;
    let one = |(sum, determined): (f64, f64)| {
        if records > 1 && determined.is_finite() { (share * sum).sqrt() } else { f64::INFINITY }
    };
    squares.into_iter().zip(of_curvature).map(one).collect()
}

/// Squares of the moves of each coordinate without each record in turn, from the records' parts of the curvature and of the score. `whole`: standard
/// errors of all records.
fn moves(gram: &DMatrix<f64>, parts: &[(DMatrix<f64>, DVector<f64>)], whole: &[f64]) -> Vec<f64> {
    let mut squares = vec![0.0; whole.len()];
    for (own, score) in parts {
        let rest = gram - own;
        let (moved, errors) = (solved(&rest, score), Curvature::of(rest).std_errors());
        let told_by_others = |j: usize| errors[j] < POLICY.lone_record * whole[j];
        squares.iter_mut().enumerate().filter(|(j, _)| told_by_others(*j)).for_each(|(j, sum)| *sum += moved[j] * moved[j]);
    }
    squares
}

/// Half widths of 90 % intervals in the coordinates of a fit: the wider of the one by the noise model and the one by the records, and wider
/// by what each of the simulation's own errors makes of the estimate, unless the data exclude that a finer simulation is nearer to them.
/// `beside`: the fit, under the noise that its errors are taken from, beside the changes that `numerics` report.
pub(super) fn half_widths(beside: &Beside, numerics: &[Numerics]) -> Vec<f64> {
    let mut half = normal(&Curvature::of(beside.reduced.gram()).std_errors());
    let records = beside.reduced.records();
    if records >= POLICY.jackknife_records {
        let t = t_quantile(0.5 * (1.0 + POLICY.gain_level), records as f64 - 1.0);
        half.iter_mut().zip(by_record(&beside.reduced)).for_each(|(half, error)| *half = half.max(t * error));
    }
    for (k, _) in numerics.iter().enumerate().filter(|(_, n)| n.gain > -POLICY.per_number) {
        half.iter_mut().zip(beside.sizes(k).iter()).for_each(|(half, bias)| *half += bias.abs());
    }
    half
}

/// Half widths of 90 % intervals by a normal law.
pub(super) fn normal(std_errors: &[f64]) -> Vec<f64> {
    std_errors.iter().map(|error| Z90 * error).collect()
}

/// Estimates, with intervals where their half widths are known.
pub(super) fn estimates(plan: &Plan, fitted: &Fitted, half_widths: Option<&[f64]>) -> Vec<Estimate> {
    let one = |(j, u): (usize, &Unknown)| Estimate {
        path: u.path.clone(),
        estimate: u.value(&fitted.values),
        unit: u.unit.clone(),
        interval: half_widths.map(|half| interval(u, &fitted.values, half[j])),
        scene_value: u.value(&plan.scene_values),
    };
    fitted.unknowns.iter().enumerate().map(one).collect()
}

/// An interval of the value; its bounds where nothing determines it.
fn interval(u: &Unknown, values: &Values, half: f64) -> [f64; 2] {
    if !half.is_finite() {
        return [u.bounds.0, u.bounds.1];
    }
    let value = u.value(values);
    rising([-half, half].map(|delta| u.far(value, delta)))
}

/// Ends of an interval of the value, whichever way its coordinate runs.
fn rising([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three records tell the first number alike; the second is told by the last one alone, whose move of it would be whatever rounding makes of it.
    #[test]
    fn a_record_that_alone_tells_a_number_does_not_move_it() {
        let part = |curvature: [f64; 2], score: [f64; 2]| {
            (DMatrix::from_diagonal(&DVector::from_row_slice(&curvature)), DVector::from_row_slice(&score))
        };
        let parts = [part([1.0, 0.0], [0.1, 0.0]), part([1.0, 1e-9], [0.2, -1e-3]), part([1.0, 1.0], [-0.3, 1e-3])];
        let gram: DMatrix<f64> = parts.iter().map(|(own, _)| own).sum();
        let squares = moves(&gram, &parts, &Curvature::of(gram.clone()).std_errors());
        assert!((squares[0] - (0.01 + 0.04 + 0.09) / 4.0).abs() < 1e-12, "{squares:?}");
        assert!((squares[1] - 1e-6).abs() < 1e-12, "{squares:?}");
    }

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
