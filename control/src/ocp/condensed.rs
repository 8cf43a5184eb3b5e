//! A problem of optimal control as a dense quadratic program of its inputs.
//!
//! With u = (u_0, …, u_{N−1}) the states are x_k = x̄_k + Γ_k u, where x̄ is the response without inputs and Γ_{k+1} = [A_k Γ_k, B_k, 0]
//! has columns of u_0 … u_k only. Per stage three products are formed over the columns that are not zero, N (N + 1)/2 blocks each:
//! Γ forwards, then backwards W_k = Q_k Γ_k + A_kᵀ W_{k+1}, of which block row k of the Hessian's lower triangle is
//! B_kᵀ W_{k+1} + S_k Γ_k + R_k (the adjoint way; Frison, Jørgensen 2013, IEEE CDC, the O(N²) algorithm). A diagonal Q costs no product.

use super::products::{add_to, multiply};
use super::{Ocp, OcpConstraint, OcpError, OcpSolution, OcpSolver, Rows};
use crate::qp::{ActiveSet, Constraint, Qp, QpError, QpSolution};
use faer::prelude::ReborrowMut;
use faer::{Accum, Mat, MatRef};

/// Condenses problems and solves them by [`ActiveSet`], from the working set of the last one if sizes are the same. Matrices that are the
/// same as the last problem's are not condensed again. Iterations are changes of the working set.
///
/// Costs N (N + 1)/2 · 6 nx² nu + (N nu)³ operations at full rank; an unstable system over a long horizon overflows or loses digits, and
/// [`Riccati`](super::Riccati) does not.
#[derive(Clone, Debug)]
pub struct Condensed {
    solver: ActiveSet,
    /// The problem whose matrices are condensed.
    last: Option<Ocp>,
    /// Γ_0 … Γ_N, nx × N nu, of which the first k nu columns are used.
    gamma: Vec<Mat<f64>>,
    /// W_{k+1} and W_k.
    w: [Mat<f64>; 2],
    hessian: Mat<f64>,
    /// Transposed rows of all stages, N nu × m.
    rows: Mat<f64>,
    /// First row of each stage, and their number.
    starts: Vec<usize>,
}

impl Condensed {
    /// Without a last solution.
    pub fn new() -> Self {
        Self {
            solver: ActiveSet::new(),
            last: None,
            gamma: Vec::new(),
            w: [Mat::new(), Mat::new()],
            hessian: Mat::new(),
            rows: Mat::new(),
            starts: Vec::new(),
        }
    }

    /// The condensed matrices: Hessian and rows.
    fn condense(&mut self, ocp: &Ocp) {
        if self.last.as_ref().is_some_and(|last| same_matrices(last, ocp)) {
            return;
        }
        let (nx, nu, n) = (ocp.nx(), ocp.nu(), ocp.stages.len());
        self.resize(nx, nu, n, ocp);
        for (k, stage) in ocp.stages.iter().enumerate() {
            let (before, after) = self.gamma.split_at_mut(k + 1);
            let (mut past, mut own) = after[0].as_mut().split_at_col_mut(k * nu);
            multiply(past.rb_mut(), Accum::Replace, stage.a.as_ref(), before[k].as_ref().subcols(0, k * nu));
            own.rb_mut().subcols_mut(0, nu).copy_from(&stage.b);
        }
        weigh(self.w[0].as_mut().subcols_mut(0, n * nu), Accum::Replace, ocp.q_final.as_ref(), self.gamma[n].as_ref());
        for (k, stage) in ocp.stages.iter().enumerate().rev() {
            let [later, now] = &mut self.w;
            let later = later.as_ref().subcols(0, (k + 1) * nu);
            let gamma = self.gamma[k].as_ref().subcols(0, k * nu);
            let mut row = self.hessian.as_mut().submatrix_mut(k * nu, 0, nu, (k + 1) * nu);
            multiply(row.rb_mut(), Accum::Replace, stage.b.transpose(), later);
            let (past, mut own) = row.split_at_col_mut(k * nu);
            own += &stage.r;
            if k > 0 {
                if !is_zero(stage.s.as_ref()) {
                    multiply(past, Accum::Add, stage.s.as_ref(), gamma);
                }
                let mut now = now.as_mut().subcols_mut(0, k * nu);
                multiply(now.rb_mut(), Accum::Replace, stage.a.transpose(), later.subcols(0, k * nu));
                weigh(now, Accum::Add, stage.q.as_ref(), gamma);
            }
            self.w.swap(0, 1);
        }
        for k in 0..=n {
            let rows = ocp.rows(k);
            let mut block = self.rows.as_mut().subcols_mut(self.starts[k], rows.len());
            let gamma = self.gamma[k].as_ref().subcols(0, k * nu);
            multiply(block.rb_mut().subrows_mut(0, k * nu), Accum::Replace, gamma.transpose(), rows.gx.transpose());
            if k < n {
                block.rb_mut().subrows_mut(k * nu, nu).copy_from(rows.gu.transpose());
                block.subrows_mut((k + 1) * nu, (n - k - 1) * nu).fill(0.0);
            }
        }
        self.last = Some(ocp.clone());
    }

    fn resize(&mut self, nx: usize, nu: usize, n: usize, ocp: &Ocp) {
        self.last = None;
        self.starts.clear();
        self.starts.push(0);
        let mut m = 0;
        for k in 0..=n {
            m += ocp.rows(k).len();
            self.starts.push(m);
        }
        if self.gamma.len() != n + 1 || self.gamma[0].shape() != (nx, n * nu) {
            self.gamma = vec![Mat::zeros(nx, n * nu); n + 1];
            self.w = [Mat::zeros(nx, n * nu), Mat::zeros(nx, n * nu)];
            self.hessian = Mat::zeros(n * nu, n * nu);
        }
        if self.rows.shape() != (n * nu, m) {
            self.rows = Mat::zeros(n * nu, m);
        }
    }

    /// Gradient and limits at the response without inputs.
    fn vectors(&self, ocp: &Ocp) -> (Vec<f64>, Vec<f64>) {
        let (nu, n) = (ocp.nu(), ocp.stages.len());
        let free = ocp.rollout(&vec![vec![0.0; nu]; n]);
        let mut gradient = vec![0.0; n * nu];
        let mut later = ocp.q_final_linear.clone();
        add_to(&mut later, 1.0, ocp.q_final.as_ref(), &free[n]);
        for (k, stage) in ocp.stages.iter().enumerate().rev() {
            let own = &mut gradient[k * nu..(k + 1) * nu];
            own.copy_from_slice(&stage.r_linear);
            add_to(own, 1.0, stage.b.transpose(), &later);
            add_to(own, 1.0, stage.s.as_ref(), &free[k]);
            let mut now = stage.q_linear.clone();
            add_to(&mut now, 1.0, stage.q.as_ref(), &free[k]);
            add_to(&mut now, 1.0, stage.a.transpose(), &later);
            later = now;
        }
        let limits = (0..=n).flat_map(|k| ocp.rows(k).excess(&free[k], None)).map(|excess| -excess).collect();
        (gradient, limits)
    }

    fn expand(&self, ocp: &Ocp, solution: QpSolution) -> OcpSolution {
        let split = |values: &[f64]| values.chunks(ocp.nu()).map(<[f64]>::to_vec).collect::<Vec<_>>();
        let u = split(&solution.z);
        let x = ocp.rollout(&u);
        let violations = ocp.violations(&x, &u);
        OcpSolution {
            cost: ocp.cost(&x, &u, &violations),
            multipliers: self.starts.windows(2).map(|ends| solution.multipliers[ends[0]..ends[1]].to_vec()).collect(),
            bounds: split(&solution.bounds),
            iterations: solution.iterations,
            x,
            u,
            violations,
        }
    }

    fn constraint(&self, constraint: Constraint, nu: usize) -> OcpConstraint {
        match constraint {
            Constraint::Lower(j) => OcpConstraint::Lower { stage: j / nu, input: j % nu },
            Constraint::Upper(j) => OcpConstraint::Upper { stage: j / nu, input: j % nu },
            Constraint::Row(row) => {
                let stage = self.starts.partition_point(|start| *start <= row) - 1;
                OcpConstraint::Row { stage, row: row - self.starts[stage] }
            }
        }
    }
}

impl Default for Condensed {
    fn default() -> Self {
        Self::new()
    }
}

impl OcpSolver for Condensed {
    fn solve(&mut self, ocp: &Ocp) -> Result<OcpSolution, OcpError> {
        ocp.check()?;
        self.condense(ocp);
        let (gradient, limits) = self.vectors(ocp);
        let of_stages = |bound: fn(&super::Stage) -> &[f64]| ocp.stages.iter().flat_map(bound).copied().collect::<Vec<_>>();
        let weights: Vec<f64> = (0..=ocp.stages.len()).flat_map(|k| &ocp.rows(k).weights).copied().collect();
        let qp = Qp {
            hessian: self.hessian.as_ref(),
            gradient: &gradient,
            lower: &of_stages(|stage| &stage.lower),
            upper: &of_stages(|stage| &stage.upper),
            rows: self.rows.transpose(),
            limits: &limits,
            weights: &weights,
        };
        match self.solver.solve(&qp) {
            Ok(solution) => Ok(self.expand(ocp, solution)),
            Err(QpError::NotPositiveDefinite { pivot }) => {
                Err(OcpError::NotConvex { stage: pivot / ocp.nu(), input: pivot % ocp.nu() })
            }
            Err(QpError::Infeasible { constraints, by }) => {
                let constraints = constraints.into_iter().map(|constraint| self.constraint(constraint, ocp.nu())).collect();
                Err(OcpError::Infeasible { constraints, by })
            }
            Err(QpError::IterationLimit { changes }) => Err(OcpError::IterationLimit { iterations: changes, error: f64::NAN }),
            Err(error) => Err(OcpError::Condensed(error)),
        }
    }
}

/// `w += Q Γ` or `w = Q Γ`.
fn weigh(mut w: faer::MatMut<'_, f64>, accum: Accum, q: MatRef<'_, f64>, gamma: MatRef<'_, f64>) {
    let diagonal = (0..q.ncols()).all(|j| q.col(j).iter().enumerate().all(|(i, entry)| i == j || *entry == 0.0));
    if !diagonal {
        return multiply(w, accum, q, gamma);
    }
    for j in 0..w.ncols() {
        for (i, w) in w.rb_mut().col_mut(j).iter_mut().enumerate() {
            let weighed = q[(i, i)] * gamma[(i, j)];
            *w = if accum == Accum::Replace { weighed } else { *w + weighed };
        }
    }
}

fn is_zero(m: MatRef<'_, f64>) -> bool {
    (0..m.ncols()).all(|j| m.col(j).iter().all(|entry| *entry == 0.0))
}

fn same_matrices(a: &Ocp, b: &Ocp) -> bool {
    let rows = |a: &Rows, b: &Rows| a.gx == b.gx && a.gu == b.gu;
    a.stages.len() == b.stages.len()
        && a.stages
            .iter()
            .zip(&b.stages)
            .all(|(a, b)| a.a == b.a && a.b == b.b && a.q == b.q && a.s == b.s && a.r == b.r && rows(&a.rows, &b.rows))
        && a.q_final == b.q_final
        && rows(&a.rows_final, &b.rows_final)
}
