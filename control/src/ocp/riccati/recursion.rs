//! The Riccati recursion: Newton systems of stages coupled by their dynamics.
//!
//! ```text
//! min  Σ_k ½ dx_kᵀ Q̂_k dx_k + du_kᵀ Ŝ_k dx_k + ½ du_kᵀ R̂_k du_k + gx_kᵀ dx_k + gu_kᵀ du_k  +  ½ dx_Nᵀ Q̂_N dx_N + gx_Nᵀ dx_N
//! s.t. dx_{k+1} = A_k dx_k + B_k du_k + gap_k,   dx_0 = 0
//! ```
//! with Q̂ = Q + G_xᵀ D G_x, Ŝ = S + G_uᵀ D G_x, R̂ = R + G_uᵀ D G_u of the rows' weights D. Backwards from P_N = Q̂_N, with
//! Λ Λᵀ = R̂ + Bᵀ P B and K = Λ⁻¹ (Ŝ + Bᵀ P A): P ← Q̂ + Aᵀ P A − Kᵀ K. Multipliers of the dynamics are π_k = P_k dx_k + p_k.
//! Costs N (4 nx³ + 6 nx² nu + …) operations; a solve N · (6 nx² + …).

use super::rows::StageRows;
use crate::ocp::products::{add_to, multiply};
use crate::ocp::{Ocp, OcpError};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, MatRef, Par};

/// The factors of all stages, and memory.
#[derive(Clone, Debug)]
pub(super) struct Recursion {
    /// P_0 … P_N.
    p: Vec<Mat<f64>>,
    /// Λ, lower triangle.
    lambda: Vec<Mat<f64>>,
    /// K, nu × nx.
    gain: Vec<Mat<f64>>,
    /// P A and P B.
    pa: Mat<f64>,
    pb: Mat<f64>,
}

/// A right-hand side, or a step: of x_0 … x_N, u_0 … u_{N−1}, and of the dynamics (stage k: of x_{k+1}).
#[derive(Clone, Debug, Default)]
pub(super) struct Trajectory {
    pub x: Vec<Vec<f64>>,
    pub u: Vec<Vec<f64>>,
    pub dynamics: Vec<Vec<f64>>,
}

impl Trajectory {
    pub fn zeros(stages: usize, nx: usize, nu: usize) -> Self {
        Self { x: vec![vec![0.0; nx]; stages + 1], u: vec![vec![0.0; nu]; stages], dynamics: vec![vec![0.0; nx]; stages] }
    }

    /// Becomes the other one, without new memory.
    pub fn copy_from(&mut self, other: &Self) {
        let pairs = [(&mut self.x, &other.x), (&mut self.u, &other.u), (&mut self.dynamics, &other.dynamics)];
        for (to, from) in pairs.into_iter().flat_map(|(to, from)| to.iter_mut().zip(from)) {
            to.copy_from_slice(from);
        }
    }
}

impl Recursion {
    pub fn new() -> Self {
        Self { p: Vec::new(), lambda: Vec::new(), gain: Vec::new(), pa: Mat::new(), pb: Mat::new() }
    }

    fn resize(&mut self, stages: usize, nx: usize, nu: usize) {
        if self.p.len() != stages + 1 || self.pb.shape() != (nx, nu) {
            self.p = vec![Mat::zeros(nx, nx); stages + 1];
            self.lambda = vec![Mat::zeros(nu, nu); stages];
            self.gain = vec![Mat::zeros(nu, nx); stages];
            (self.pa, self.pb) = (Mat::zeros(nx, nx), Mat::zeros(nx, nu));
        }
    }

    /// # Errors
    /// R̂ + Bᵀ P B is not positive definite at a stage.
    pub fn factor(&mut self, ocp: &Ocp, rows: &[StageRows]) -> Result<(), OcpError> {
        let (n, nx, nu) = (ocp.stages.len(), ocp.nx(), ocp.nu());
        self.resize(n, nx, nu);
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(nu, Par::Seq, Default::default()));
        self.p[n].copy_from(&ocp.q_final);
        rows[n].add_states(&ocp.rows_final, &mut self.p[n]);
        for (k, stage) in ocp.stages.iter().enumerate().rev() {
            let (before, after) = self.p.split_at_mut(k + 1);
            let (p, later) = (&mut before[k], &after[0]);
            let (lambda, gain) = (&mut self.lambda[k], &mut self.gain[k]);
            p.copy_from(&stage.q);
            lambda.copy_from(&stage.r);
            gain.copy_from(&stage.s);
            rows[k].add_states(&stage.rows, p);
            rows[k].add_inputs(&stage.rows, gain, lambda);
            multiply(self.pa.as_mut(), Accum::Replace, later.as_ref(), stage.a.as_ref());
            multiply(self.pb.as_mut(), Accum::Replace, later.as_ref(), stage.b.as_ref());
            add_lower(p, 1.0, stage.a.transpose(), self.pa.as_ref());
            multiply(lambda.as_mut(), Accum::Add, stage.b.transpose(), self.pb.as_ref());
            multiply(gain.as_mut(), Accum::Add, stage.b.transpose(), self.pa.as_ref());
            fix(&rows[k].fixed, gain, lambda);
            cholesky_in_place(lambda.as_mut(), Default::default(), Par::Seq, MemStack::new(&mut memory), Default::default())
                .map_err(|LltError::NonPositivePivot { index }| OcpError::NotConvex { stage: k, input: index })?;
            solve_lower_triangular_in_place(lambda.as_ref(), gain.as_mut(), Par::Seq);
            add_lower(p, -1.0, gain.transpose(), gain.as_ref());
            mirror(p);
        }
        Ok(())
    }

    /// The step of gradients gx, gu and gaps.
    pub fn solve(&self, ocp: &Ocp, rows: &[StageRows], gradient: &Trajectory, step: &mut Trajectory) {
        let n = ocp.stages.len();
        let mut later = vec![0.0; ocp.nx()];
        step.dynamics[n - 1].copy_from_slice(&gradient.x[n]);
        for (k, stage) in ocp.stages.iter().enumerate().rev() {
            // p_{k+1} is kept as it is: the multipliers of the dynamics begin with it
            later.copy_from_slice(&step.dynamics[k]);
            add_to(&mut later, 1.0, self.p[k + 1].as_ref(), &gradient.dynamics[k]);
            let u = &mut step.u[k];
            u.copy_from_slice(&gradient.u[k]);
            add_to(u, 1.0, stage.b.transpose(), &later);
            rows[k].fixed.iter().for_each(|&j| u[j] = 0.0);
            forward(self.lambda[k].as_ref(), u);
            if k > 0 {
                let p = &mut step.dynamics[k - 1];
                p.copy_from_slice(&gradient.x[k]);
                add_to(p, 1.0, stage.a.transpose(), &later);
                add_to(p, -1.0, self.gain[k].transpose(), u);
            }
        }
        step.x[0].fill(0.0);
        for (k, stage) in ocp.stages.iter().enumerate() {
            let (past, future) = step.x.split_at_mut(k + 1);
            let (x, next, u) = (&past[k], &mut future[0], &mut step.u[k]);
            add_to(u, 1.0, self.gain[k].as_ref(), x);
            backward(self.lambda[k].as_ref(), u);
            u.iter_mut().for_each(|u| *u = -*u);
            next.copy_from_slice(&gradient.dynamics[k]);
            add_to(next, 1.0, stage.a.as_ref(), x);
            add_to(next, 1.0, stage.b.as_ref(), u);
            add_to(&mut step.dynamics[k], 1.0, self.p[k + 1].as_ref(), next);
        }
    }
}

/// Fixed inputs do not change: their equations are du = 0.
fn fix(fixed: &[usize], gain: &mut Mat<f64>, lambda: &mut Mat<f64>) {
    for &j in fixed {
        gain.as_mut().row_mut(j).fill(0.0);
        lambda.as_mut().row_mut(j).fill(0.0);
        lambda.as_mut().col_mut(j).fill(0.0);
        lambda[(j, j)] = 1.0;
    }
}

/// The lower triangle of `p += sign · A B`.
fn add_lower(p: &mut Mat<f64>, sign: f64, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(p.as_mut(), lower, Accum::Add, a, full, b, full, sign, Par::Seq);
}

/// The upper triangle from the lower one: P stays symmetric to the last bit, or the recursion lets the difference grow.
fn mirror(p: &mut Mat<f64>) {
    for j in 0..p.ncols() {
        for i in 0..j {
            p[(i, j)] = p[(j, i)];
        }
    }
}

/// `x ← Λ⁻¹ x`.
fn forward(lambda: MatRef<'_, f64>, x: &mut [f64]) {
    for j in 0..x.len() {
        x[j] /= lambda[(j, j)];
        for i in j + 1..x.len() {
            x[i] -= lambda[(i, j)] * x[j];
        }
    }
}

/// `x ← Λ⁻ᵀ x`.
fn backward(lambda: MatRef<'_, f64>, x: &mut [f64]) {
    for j in (0..x.len()).rev() {
        for i in j + 1..x.len() {
            x[j] -= lambda[(i, j)] * x[i];
        }
        x[j] /= lambda[(j, j)];
    }
}
