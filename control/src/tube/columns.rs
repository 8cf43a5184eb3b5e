//! Responses Φ E column by column, and the tubes made of them.

use faer::Mat;
use rayon::prelude::*;

use super::error::TubeError;
use super::gains::Gains;
use super::problem::TubeProblem;
use super::rows::RowValues;
use super::weights::{Weights, sum_norms};
use super::{Reach, Tube, TubeSynthesis};
use crate::linear::{add_product, product};

/// Responses to the disturbance of one time j.
#[derive(Clone, Debug)]
pub struct Column {
    /// Φ_x\[k,j\] E_j for k = j … N, nx × nw_j.
    pub x: Vec<Mat<f64>>,
    /// Φ_u\[k,j\] E_j for k = j … N−1, nu × nw_j.
    pub u: Vec<Mat<f64>>,
}

impl Column {
    /// From the state that time j leaves, nx × any: E_j itself, or the identity for the normalised Φ.
    pub fn propagate(problem: &TubeProblem<'_>, gains: &Gains, j: usize, start: Mat<f64>) -> Self {
        let mut column = Self { x: vec![start], u: Vec::new() };
        for (k, stage) in problem.ocp.stages.iter().enumerate().skip(j) {
            let x = &column.x[k - j];
            let u = product(gains.get(k, j).as_ref(), x.as_ref());
            let mut next = product(stage.a.as_ref(), x.as_ref());
            add_product(next.as_mut(), stage.b.as_ref(), u.as_ref(), 1.0);
            column.x.push(next);
            column.u.push(u);
        }
        column
    }

    /// Row norms of stages j … N.
    fn norms(&self, problem: &TubeProblem<'_>, j: usize) -> Vec<Vec<f64>> {
        let of_stage = |(k, x): (usize, &Mat<f64>)| problem.rows[k].norms(x, self.u.get(k - j), &problem.balls[j]);
        (j..).zip(&self.x).map(of_stage).collect()
    }

    fn cost(&self, problem: &TubeProblem<'_>) -> f64 {
        let cost = problem.cost;
        let Some((last, others)) = self.x.split_last() else { return 0.0 };
        let states: f64 = others.iter().map(|x| quadratic(&cost.q, x)).sum();
        let inputs: f64 = self.u.iter().map(|u| quadratic(&cost.r, u)).sum();
        states + inputs + quadratic(&cost.q_final, last)
    }
}

/// tr(Xᵀ W X), in as many operations as W has entries that are not zero, times X's columns.
fn quadratic(w: &Mat<f64>, x: &Mat<f64>) -> f64 {
    let mut sum = 0.0;
    for c in 0..w.ncols() {
        for (r, &w) in w.col_as_slice(c).iter().enumerate().filter(|(_, w)| **w != 0.0) {
            let rows: f64 = (0..x.ncols()).map(|p| x[(r, p)] * x[(c, p)]).sum();
            sum += w * rows;
        }
    }
    sum
}

impl Tube {
    /// The tube of given gains: responses to E's columns, in parallel over times.
    pub fn of_gains(problem: &TubeProblem<'_>, gains: Gains) -> Self {
        let all: Vec<(Column, Vec<Vec<f64>>, f64)> = (0..=problem.horizon())
            .into_par_iter()
            .map(|j| {
                let column = Column::propagate(problem, &gains, j, problem.columns[j].clone());
                let (norms, cost) = (column.norms(problem, j), column.cost(problem));
                (column, norms, cost)
            })
            .collect();
        let cost = all.iter().map(|(_, _, cost)| cost).sum();
        let mut columns = Vec::with_capacity(all.len());
        let mut norms = Vec::with_capacity(all.len());
        for (column, of_column, _) in all {
            columns.push(column);
            norms.push(of_column);
        }
        let tightenings = sum_norms(problem, &norms);
        Self { gains, reach: Reach::Columns(columns), sizes: tightenings.clone(), tightenings, cost: Some(cost), norms }
    }
}

/// Gains of their own for each column: the optimum of the responses for given weights η_{k,j}, and with the alternation that of the joint
/// problem.
///
/// With several balls at one time their responses share the column's gains, and a row's norm in its weight is the sum over the balls: the
/// tightenings are exact for the policy, the policy is then not the optimum.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExactTube;

impl TubeSynthesis for ExactTube {
    fn synthesize(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>) -> Result<Tube, TubeError> {
        let gains = Gains::exact(problem, &Weights::new(multipliers, previous))?;
        Ok(Tube::of_gains(problem, gains).after(previous))
    }
}

/// One gain per stage for all columns, of weights averaged over them: one Riccati recursion instead of N (N + 1)/2 steps. Tightenings are
/// exact for the policy.
#[derive(Clone, Copy, Debug, Default)]
pub struct SharedGainTube;

impl TubeSynthesis for SharedGainTube {
    fn synthesize(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>) -> Result<Tube, TubeError> {
        let weights = Weights::new(multipliers, previous);
        Ok(Tube::of_gains(problem, Gains::of_weights(problem, |k| weights.mean(k))?).after(previous))
    }
}
