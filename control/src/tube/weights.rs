//! Weights of rows in the cost of responses, from the multipliers of the tightened problem.

use super::Tube;
use super::constants::TUBE;
use super::problem::TubeProblem;
use super::rows::RowValues;

/// Multipliers and the row norms that weights are made of.
pub(crate) struct Weights<'a> {
    multipliers: &'a RowValues,
    /// Norms of the previous tube, and the sizes that their floors are parts of.
    norms: Option<(&'a Norms, &'a RowValues)>,
}

/// Row norms a_{k,j} at `[j][k − j][row]`.
pub(crate) type Norms = Vec<Vec<Vec<f64>>>;

impl<'a> Weights<'a> {
    /// Without a previous tube there are no norms yet, and all weights are zero.
    pub fn new(multipliers: &'a RowValues, previous: Option<&'a Tube>) -> Self {
        let previous = previous.filter(|tube| !tube.norms.is_empty());
        Self { multipliers, norms: previous.map(|tube| (&tube.norms, &tube.sizes)) }
    }

    /// Last stage with a weighted row.
    pub fn last_active(&self) -> Option<usize> {
        self.norms?;
        (0..self.multipliers.len()).rev().find(|&k| self.is_active(k))
    }

    fn is_active(&self, k: usize) -> bool {
        self.multipliers.stage(k).iter().any(|mu| *mu > 0.0)
    }

    /// η_{k,j} = μ_k / (2 a_{k,j}), the derivative of μ_k √(a²) by a², with a floor under a. None where all are zero.
    pub fn of_column(&self, k: usize, j: usize) -> Option<Vec<f64>> {
        let (norms, sizes) = self.norms?;
        let norms = &norms[j][k - j];
        let multipliers = self.multipliers.stage(k);
        if !self.is_active(k) || norms.iter().all(|a| *a == 0.0) {
            return None;
        }
        let eta = |((&mu, &a), &size): ((&f64, &f64), &f64)| {
            let floored = a.max(TUBE.norm_floor * size);
            if mu > 0.0 && floored > 0.0 { mu / (2.0 * floored) } else { 0.0 }
        };
        Some(multipliers.iter().zip(norms).zip(sizes.stage(k)).map(eta).collect())
    }

    /// The mean over j of η_{k,j} with weights a²: the cost Σ_j η_{k,j} a_{k,j}² of the present tube is unchanged.
    pub fn mean(&self, k: usize) -> Option<Vec<f64>> {
        let (norms, sizes) = self.norms?;
        if !self.is_active(k) {
            return None;
        }
        let multipliers = self.multipliers.stage(k);
        let of_row = |i: usize| {
            let of_columns = norms.iter().enumerate().take(k + 1).map(|(j, column)| column[k - j][i]);
            let (sum, squares) = of_columns.fold((0.0, 0.0), |(sum, squares), a| (sum + a, squares + a * a));
            let floored = squares.max((TUBE.norm_floor * sizes.stage(k)[i]).powi(2));
            if floored > 0.0 { multipliers[i].max(0.0) * sum.max(floored.sqrt()) / (2.0 * floored) } else { 0.0 }
        };
        Some((0..multipliers.len()).map(of_row).collect())
    }
}

/// Σ_j a_{k,j}, summed in the order of j.
pub(crate) fn sum_norms(problem: &TubeProblem<'_>, norms: &Norms) -> RowValues {
    let mut sums = RowValues::zeros(problem.ocp);
    for (j, column) in norms.iter().enumerate() {
        for (k, norms) in column.iter().enumerate() {
            for (sum, norm) in sums.stage_mut(j + k).iter_mut().zip(norms) {
                *sum += norm;
            }
        }
    }
    sums
}
