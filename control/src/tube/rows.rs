//! Rows of a stage as the tube sees them: those of the problem, then one of each input.

use std::ops::Range;

use faer::Mat;

use super::error::Constraint;
use crate::ocp::{Ocp, OcpSolution, Rows};

/// One number for each row of stages 0 … N and each input of stages 0 … N−1: tightenings, multipliers.
#[derive(Clone, Debug, PartialEq)]
pub struct RowValues {
    stages: Vec<Vec<f64>>,
    rows: Vec<usize>,
}

impl RowValues {
    /// Zeros, of a problem's sizes.
    pub fn zeros(ocp: &Ocp) -> Self {
        let nu = ocp.stages.first().map_or(0, |stage| stage.b.ncols());
        let rows: Vec<usize> = (0..=ocp.stages.len()).map(|k| rows_of(ocp, k).len()).collect();
        let inputs = |k: usize| if k < ocp.stages.len() { nu } else { 0 };
        Self { stages: rows.iter().enumerate().map(|(k, m)| vec![0.0; m + inputs(k)]).collect(), rows }
    }

    /// Multipliers of a problem's solution: those of rows, and of inputs the magnitude of their bounds'.
    pub fn multipliers(ocp: &Ocp, solution: &OcpSolution) -> Self {
        let mut values = Self::zeros(ocp);
        for (k, stage) in values.stages.iter_mut().enumerate() {
            let rows = solution.multipliers[k].iter().map(|mu| mu.max(0.0));
            let inputs = solution.bounds.get(k).into_iter().flatten().map(|mu| mu.abs());
            for (value, mu) in stage.iter_mut().zip(rows.chain(inputs)) {
                *value = mu;
            }
        }
        values
    }

    /// Zeros of the same sizes.
    pub(crate) fn zeros_like(&self) -> Self {
        Self { stages: self.stages.iter().map(|stage| vec![0.0; stage.len()]).collect(), rows: self.rows.clone() }
    }

    /// Values of the rows of stage k.
    pub fn rows(&self, k: usize) -> &[f64] {
        &self.stages[k][..self.rows[k]]
    }

    /// Values of the inputs of stage k; none of stage N.
    pub fn inputs(&self, k: usize) -> &[f64] {
        &self.stages[k][self.rows[k]..]
    }

    /// Value of a row or an input of stage k.
    pub fn get(&self, k: usize, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Row(i) => self.rows(k)[i],
            Constraint::Input(i) => self.inputs(k)[i],
        }
    }

    /// Sets the value of a row or an input of stage k.
    pub(crate) fn set(&mut self, k: usize, constraint: Constraint, value: f64) {
        let at = match constraint {
            Constraint::Row(i) => i,
            Constraint::Input(i) => self.rows[k] + i,
        };
        self.stages[k][at] = value;
    }

    /// Which row or input stands at a place of a stage's values.
    pub(crate) fn constraint(&self, k: usize, place: usize) -> Constraint {
        if place < self.rows[k] { Constraint::Row(place) } else { Constraint::Input(place - self.rows[k]) }
    }

    pub(crate) fn stage(&self, k: usize) -> &[f64] {
        &self.stages[k]
    }

    pub(crate) fn stage_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.stages[k]
    }

    /// Whether all are zero.
    pub(crate) fn is_zero(&self) -> bool {
        self.stages.iter().flatten().all(|value| *value == 0.0)
    }

    /// Number of stages, the last included.
    pub(crate) fn len(&self) -> usize {
        self.stages.len()
    }

    /// Goes a part of the way to others of the same sizes.
    pub(crate) fn approach(&mut self, others: &Self, step: f64) {
        for (a, b) in self.stages.iter_mut().flatten().zip(others.stages.iter().flatten()) {
            *a += step * (b - *a);
        }
    }

    /// Σ |difference to others| · weight.
    pub(crate) fn weighted_distance(&self, others: &Self, weights: &Self) -> f64 {
        let pairs = self.stages.iter().flatten().zip(others.stages.iter().flatten()).zip(weights.stages.iter().flatten());
        pairs.map(|((a, b), w)| w * (a - b).abs()).sum()
    }

    /// Largest difference to others of the same sizes.
    pub(crate) fn distance(&self, others: &Self) -> f64 {
        let pairs = self.stages.iter().flatten().zip(others.stages.iter().flatten());
        pairs.fold(0.0, |largest, (a, b)| f64::max(largest, (a - b).abs()))
    }
}

/// Rows of stage k of a problem, k = N the last.
pub(crate) fn rows_of(ocp: &Ocp, k: usize) -> &Rows {
    ocp.stages.get(k).map_or(&ocp.rows_final, |stage| &stage.rows)
}

/// Entries of a row that are not zero.
type Sparse = Vec<(usize, f64)>;

/// Rows g_x x + g_u u of one stage, by their entries that are not zero: most bound one state or one input.
#[derive(Clone, Debug)]
pub(crate) struct StageRows {
    pub x: Vec<Sparse>,
    pub u: Vec<Sparse>,
    /// Rows of which none is another one, nor another one negated: bounds from both sides have the same norms.
    distinct: Vec<usize>,
    /// Place among the distinct rows of each row.
    place: Vec<usize>,
}

impl StageRows {
    pub fn new(ocp: &Ocp, k: usize) -> Self {
        let rows = rows_of(ocp, k);
        let sparse = |g: &Mat<f64>, i: usize| (0..g.ncols()).map(|c| (c, g[(i, c)])).filter(|(_, g)| *g != 0.0).collect();
        let mut x: Vec<Sparse> = (0..rows.len()).map(|i| sparse(&rows.gx, i)).collect();
        let mut u: Vec<Sparse> =
            (0..rows.len()).map(|i| if k < ocp.stages.len() { sparse(&rows.gu, i) } else { Vec::new() }).collect();
        if let Some(stage) = ocp.stages.get(k) {
            x.extend((0..stage.b.ncols()).map(|_| Vec::new()));
            u.extend((0..stage.b.ncols()).map(|i| vec![(i, 1.0)]));
        }
        let (mut distinct, mut place) = (Vec::<usize>::new(), Vec::new());
        for i in 0..x.len() {
            let same = |&other: &usize| {
                let is = |sign: f64| is_multiple(&x[i], &x[other], sign) && is_multiple(&u[i], &u[other], sign);
                is(1.0) || is(-1.0)
            };
            place.push(distinct.iter().position(same).unwrap_or_else(|| {
                distinct.push(i);
                distinct.len() - 1
            }));
        }
        Self { x, u, distinct, place }
    }

    /// Values of distinct rows as values of all rows.
    pub fn of_all(&self, of_distinct: &[f64]) -> Vec<f64> {
        self.place.iter().map(|&place| of_distinct[place]).collect()
    }

    /// [G_x, G_u] of the distinct rows as full matrices.
    pub fn distinct(&self, nx: usize, nu: usize) -> (Mat<f64>, Mat<f64>) {
        let fill = |rows: &[Sparse], columns: usize| {
            let mut g = Mat::zeros(self.distinct.len(), columns);
            for (i, &row) in self.distinct.iter().enumerate() {
                for &(c, value) in &rows[row] {
                    g[(i, c)] = value;
                }
            }
            g
        };
        (fill(&self.x, nx), fill(&self.u, nu))
    }

    /// Sum over the balls of |g_x X + g_u U|₂, row by row; X and U have the balls' columns side by side.
    pub fn norms(&self, x: &Mat<f64>, u: Option<&Mat<f64>>, balls: &[Range<usize>]) -> Vec<f64> {
        let mut sums = vec![0.0; self.distinct.len()];
        let mut squares = vec![0.0; self.distinct.len()];
        for ball in balls {
            squares.fill(0.0);
            for c in ball.clone() {
                let x = x.col_as_slice(c);
                let u = u.map_or(&[][..], |u| u.col_as_slice(c));
                for (square, &row) in squares.iter_mut().zip(&self.distinct) {
                    let in_x: f64 = self.x[row].iter().map(|&(i, g)| g * x[i]).sum();
                    let in_u: f64 = self.u[row].iter().map(|&(i, g)| g * u[i]).sum();
                    *square += (in_x + in_u).powi(2);
                }
            }
            for (sum, square) in sums.iter_mut().zip(&squares) {
                *sum += square.sqrt();
            }
        }
        self.of_all(&sums)
    }

    /// r Σ rᵀ of r = g_x + g_u K, row by row. The row is formed first: where K answers a row entirely, its terms cancel in r, and would
    /// leave rounding of their own size under the root otherwise.
    pub fn variances(&self, sigma: &Mat<f64>, gain: Option<&Mat<f64>>) -> Vec<f64> {
        let of_row = |(x, u): (&Sparse, &Sparse)| {
            let row: Sparse = match gain.filter(|_| !u.is_empty()) {
                None => x.clone(),
                Some(gain) => {
                    let mut row: Vec<f64> = (0..sigma.ncols()).map(|c| u.iter().map(|&(r, g)| g * gain[(r, c)]).sum()).collect();
                    x.iter().for_each(|&(c, g)| row[c] += g);
                    row.into_iter().enumerate().collect()
                }
            };
            let times = |c: usize| row.iter().map(|&(r, g)| g * sigma[(r, c)]).sum::<f64>();
            row.iter().map(|&(c, g)| g * times(c)).sum()
        };
        self.x.iter().zip(&self.u).map(of_row).collect()
    }

    /// g_x x + g_u u, row by row.
    pub fn apply(&self, x: &[f64], u: &[f64]) -> Vec<f64> {
        let dot = |row: &Sparse, v: &[f64]| row.iter().map(|&(i, g)| g * v[i]).sum::<f64>();
        self.x.iter().zip(&self.u).map(|(row_x, row_u)| dot(row_x, x) + dot(row_u, u)).collect()
    }

    /// Adds Gᵀ diag(η) G to the lower triangles of its blocks xx and uu and to its block ux.
    pub fn add_weighted(&self, eta: &[f64], xx: &mut Mat<f64>, ux: &mut Mat<f64>, uu: &mut Mat<f64>) {
        let weighted = eta.iter().zip(self.x.iter().zip(&self.u)).filter(|(eta, _)| **eta != 0.0);
        for (&eta, (row_x, row_u)) in weighted {
            add_square(eta, row_x, xx);
            add_square(eta, row_u, uu);
            for &(c, g_x) in row_x {
                for &(r, g_u) in row_u {
                    ux[(r, c)] += eta * g_u * g_x;
                }
            }
        }
    }
}

fn is_multiple(a: &Sparse, b: &Sparse, factor: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|((i, a), (j, b))| i == j && *a == factor * b)
}

fn add_square(eta: f64, row: &Sparse, out: &mut Mat<f64>) {
    for (p, &(c, g_c)) in row.iter().enumerate() {
        for &(r, g_r) in &row[p..] {
            out[(r, c)] += eta * g_r * g_c;
        }
    }
}
