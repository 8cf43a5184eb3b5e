//! Gains K_{k,j}: the input at stage k that answers the disturbance of time j ≤ k, per state that it left.

use faer::Mat;
use rayon::prelude::*;

use super::error::TubeError;
use super::problem::TubeProblem;
use super::riccati::Riccati;
use super::weights::Weights;

/// Gains, of which those from some stage on are the same for all columns.
#[derive(Clone, Debug)]
pub struct Gains {
    /// K_{k,j} at `[j][k − j]` for k below `first_shared`.
    columns: Vec<Vec<Mat<f64>>>,
    /// K_k at `[k − first_shared]`.
    shared: Vec<Mat<f64>>,
    first_shared: usize,
}

impl Gains {
    /// Gains K_0 … K_{N−1} that do not depend on the column: u = v + K (x − z).
    pub fn shared(gains: Vec<Mat<f64>>) -> Self {
        Self { columns: vec![Vec::new(); gains.len() + 1], shared: gains, first_shared: 0 }
    }

    /// K_{k,j}, nu × nx.
    pub fn get(&self, k: usize, j: usize) -> &Mat<f64> {
        if k >= self.first_shared { &self.shared[k - self.first_shared] } else { &self.columns[j][k - j] }
    }

    /// First stage from which on columns share their gains: 0 if all do.
    pub fn first_shared(&self) -> usize {
        self.first_shared
    }

    /// Number of stages N.
    pub fn horizon(&self) -> usize {
        self.first_shared + self.shared.len()
    }

    /// Minimizes the cost and Σ_i η_{k,j,i} |g_i Φ|² column by column.
    ///
    /// A column's recursion depends on it by the weights η_{k,j} alone, and these are zero above the last stage K with an active row:
    /// stages K + 1 … N are gone through once. Columns below are independent and run in parallel.
    ///
    /// # Errors
    /// [`TubeError::Indefinite`].
    pub(crate) fn exact(problem: &TubeProblem<'_>, weights: &Weights<'_>) -> Result<Self, TubeError> {
        let horizon = problem.horizon();
        let first_shared = weights.last_active().map_or(0, |k| (k + 1).min(horizon));
        let mut tail = Riccati::new(problem, None);
        let mut shared = Vec::with_capacity(horizon - first_shared);
        for k in (first_shared..horizon).rev() {
            shared.push(tail.step(k, None)?);
        }
        shared.reverse();
        let active_at_end = weights.last_active() == Some(horizon);
        let columns: Result<Vec<_>, TubeError> = (0..=horizon)
            .into_par_iter()
            .map(|j| {
                let mut recursion = if active_at_end && j < horizon {
                    Riccati::new(problem, weights.of_column(horizon, j).as_deref())
                } else {
                    tail.clone()
                };
                let mut gains = Vec::with_capacity(first_shared.saturating_sub(j));
                for k in (j..first_shared).rev() {
                    gains.push(recursion.step(k, weights.of_column(k, j).as_deref())?);
                }
                gains.reverse();
                Ok(gains)
            })
            .collect();
        Ok(Self { columns: columns?, shared, first_shared })
    }

    /// Gains of one recursion with given weights.
    ///
    /// # Errors
    /// [`TubeError::Indefinite`].
    pub(crate) fn of_weights(problem: &TubeProblem<'_>, eta: impl Fn(usize) -> Option<Vec<f64>>) -> Result<Self, TubeError> {
        let horizon = problem.horizon();
        let mut recursion = Riccati::new(problem, eta(horizon).as_deref());
        let mut gains = Vec::with_capacity(horizon);
        for k in (0..horizon).rev() {
            gains.push(recursion.step(k, eta(k).as_deref())?);
        }
        gains.reverse();
        Ok(Self::shared(gains))
    }
}
