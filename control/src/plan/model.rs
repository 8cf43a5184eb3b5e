//! The quadratic model of a plan's cost about a rollout, in the inputs alone.
//!
//! With S_k = ∂x_k/∂u, which is carried along the rollout's factorizations and has only the columns of the inputs before k,
//! ```text
//! J(u + δ) ≈ J + gᵀδ + ½ δᵀHδ,   g = Σ J_kᵀ r_k,  H = Σ J_kᵀ J_k,   J_k = ∂r_k/∂x S_k + ∂r_k/∂u
//! c(u + δ) ≈ c + C δ
//! ```
//! Costs ℓ given by value add their slopes to g; their part of H is B of [`Curvature`](super::curvature::Curvature).

use super::holding::Approach;
use crate::problem::{Problem, Rows, Terms};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, Par};
use pliant_adjoint::{Seeds, TangentStepper};
use pliant_engine::rollout::Rollout;

/// Columns are padded to whole vectors, which the kernels need no remainders for.
const VECTOR: usize = 8;

/// The model.
#[derive(Clone, Debug)]
pub struct QuadraticModel {
    /// Number of unknowns N nu.
    pub n: usize,
    /// N.
    pub steps: usize,
    /// H, n × n: its lower triangle.
    pub hessian: Mat<f64>,
    /// g (n).
    pub gradient: Vec<f64>,
    /// Part of g of the costs given by value (n); empty if there are none.
    pub slopes: Vec<f64>,
    /// C, rows of all stages in a row; row-major, n columns.
    pub rows: Vec<f64>,
    /// c.
    pub values: Vec<f64>,
    /// Price of each row.
    pub prices: Vec<f64>,
    /// (stage, row of the stage) of each row.
    pub places: Vec<(usize, usize)>,
    /// J.
    pub cost: f64,
    /// Σ price max(0, c).
    pub penalty: f64,
    dense: Mat<f64>,
    terms: Terms,
}

impl Default for QuadraticModel {
    fn default() -> Self {
        Self {
            n: 0,
            steps: 0,
            hessian: Mat::new(),
            gradient: Vec::new(),
            slopes: Vec::new(),
            rows: Vec::new(),
            values: Vec::new(),
            prices: Vec::new(),
            places: Vec::new(),
            cost: 0.0,
            penalty: 0.0,
            dense: Mat::new(),
            terms: Terms::default(),
        }
    }
}

impl QuadraticModel {
    /// Evaluates the model about a recorded rollout; `approaches` add their residuals.
    ///
    /// # Errors
    /// The problem's reason, in words, if it cannot be evaluated.
    pub fn evaluate(&mut self, problem: &dyn Problem, rollout: &Rollout, approaches: &[Approach]) -> Result<(), String> {
        let (model, steps) = (&rollout.model, rollout.controls.len());
        let (nu, ndx) = (model.nu(), model.ndx());
        self.reset(steps * nu);
        self.steps = steps;
        let first = nu.next_multiple_of(VECTOR);
        let mut tangent = TangentStepper::new(model, &rollout.theta, Seeds::none(first, nu, model.n_params()));
        let mut held: Vec<bool> = approaches.iter().map(|_| false).collect();
        for k in 0..=steps {
            let mut terms = std::mem::take(&mut self.terms);
            terms.clear();
            problem.evaluate(k, steps, &rollout.states[k], rollout.controls.get(k).map(Vec::as_slice), &mut terms)?;
            for approach in approaches.iter().filter(|approach| approach.step == k) {
                approach.add(&rollout.states[k], &mut terms.residuals);
            }
            self.add(k, nu, ndx, &terms, &tangent);
            self.terms = terms;
            if k == steps {
                self.gradient.iter_mut().zip(&self.slopes).for_each(|(g, slope)| *g += slope);
                break;
            }
            tangent.grow(((k + 1) * nu).next_multiple_of(VECTOR));
            (0..nu).for_each(|c| tangent.seeds.add_u(c, k * nu + c, 1.0));
            tangent.step(&rollout.records[k]);
            for (approach, held) in approaches.iter().zip(&mut held) {
                if !*held && approach.holds(&rollout.states[k + 1]) {
                    *held = true;
                    approach.cut(k + 1, nu, &mut tangent);
                }
            }
        }
        Ok(())
    }

    fn reset(&mut self, n: usize) {
        self.n = n;
        self.hessian = Mat::zeros(n, n);
        self.gradient.clear();
        self.gradient.resize(n, 0.0);
        self.slopes.clear();
        (self.cost, self.penalty) = (0.0, 0.0);
        self.rows.clear();
        self.values.clear();
        self.prices.clear();
        self.places.clear();
    }

    fn add(&mut self, k: usize, nu: usize, ndx: usize, terms: &Terms, tangent: &TangentStepper) {
        self.cost += terms.cost();
        self.penalty += terms.penalty();
        let columns = ((k + 1) * nu).min(self.n);
        let residuals = &terms.residuals;
        if !residuals.values.is_empty() && columns > 0 {
            let m = residuals.values.len();
            if self.dense.nrows() < columns || self.dense.ncols() < m {
                self.dense = Mat::zeros(self.n, m.max(self.dense.ncols()));
            }
            // transposed, so that each row of the model is a contiguous column
            for row in 0..m {
                self.dense.col_as_slice_mut(row)[..columns].fill(0.0);
            }
            let place = Place { k, nu, ndx, columns };
            for &(row, column, value) in &residuals.entries {
                place.add(column, value, tangent, &mut self.dense.col_as_slice_mut(row)[..columns]);
            }
            for (row, r) in residuals.values.iter().enumerate() {
                self.gradient.iter_mut().zip(&self.dense.col_as_slice(row)[..columns]).for_each(|(g, j)| *g += j * r);
            }
            let j = self.dense.as_ref().submatrix(0, 0, columns, m);
            triangular::matmul(
                self.hessian.as_mut().submatrix_mut(0, 0, columns, columns),
                BlockStructure::TriangularLower,
                Accum::Add,
                j,
                BlockStructure::Rectangular,
                j.transpose(),
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
        }
        if !terms.values.values.is_empty() {
            self.slopes.resize(self.n, 0.0);
            let place = Place { k, nu, ndx, columns };
            for &(_, column, value) in &terms.values.entries {
                place.add(column, value, tangent, &mut self.slopes[..columns]);
            }
        }
        self.add_constraints(k, nu, ndx, columns, &terms.constraints, tangent);
        self.prices.extend(&terms.prices);
    }

    fn add_constraints(&mut self, k: usize, nu: usize, ndx: usize, columns: usize, rows: &Rows, tangent: &TangentStepper) {
        let before = self.rows.len();
        self.rows.resize(before + rows.values.len() * self.n, 0.0);
        let place = Place { k, nu, ndx, columns };
        for &(row, column, value) in &rows.entries {
            let from = before + row * self.n;
            place.add(column, value, tangent, &mut self.rows[from..from + columns]);
        }
        self.places.extend((0..rows.values.len()).map(|row| (k, row)));
        self.values.extend(&rows.values);
    }
}

/// Where the columns of a stage stand.
struct Place {
    k: usize,
    nu: usize,
    ndx: usize,
    columns: usize,
}

impl Place {
    /// Adds `value` times a row of S_k, or of the inputs of the stage.
    fn add(&self, column: usize, value: f64, tangent: &TangentStepper, out: &mut [f64]) {
        if column >= self.ndx {
            let at = self.k * self.nu + column - self.ndx;
            if at < self.columns {
                out[at] += value;
            }
            return;
        }
        let (x, m) = (&tangent.x, tangent.seeds.columns);
        let nv = x.q.len() / m;
        let (block, row) = if column < nv {
            (&x.q, column)
        } else if column < 2 * nv {
            (&x.v, column - nv)
        } else {
            (&x.z, column - 2 * nv)
        };
        let known = (self.k * self.nu).min(out.len());
        out.iter_mut().zip(&block[row * m..row * m + known]).for_each(|(to, from)| *to += value * from);
    }
}
