//! A problem of optimal control as a dense quadratic program of its inputs.
//!
//! With u = (u_0, …, u_{N−1}) the states are x_k = x̄_k + Γ_k u, where x̄ is the response without inputs and Γ_{k+1} = [A_k Γ_k, B_k, 0]
//! has columns of u_0 … u_k only. Per stage three products are formed over the columns that are not zero, N (N + 1)/2 blocks each:
//! Γ forwards, then backwards W_k = Q_k Γ_k + A_kᵀ W_{k+1}, of which block row k of the Hessian's lower triangle is
//! B_kᵀ W_{k+1} + S_k Γ_k + R_k (the adjoint way; Frison, Jørgensen 2013, IEEE CDC, the O(N²) algorithm). A diagonal Q and rows of few
//! states cost no product of matrices: Γ and W are stored transposed, so that a state's response lies contiguously.

use super::products::{add_to, multiply};
use super::snapshot::Snapshot;
use super::{Ocp, OcpConstraint, OcpError, OcpSolution, OcpSolver};
use crate::constants::OCP;
use crate::qp::{ActiveSet, Constraint, Qp, QpError, QpSolution};
use faer::prelude::ReborrowMut;
use faer::{Accum, Mat, MatMut, MatRef, unzip, zip};

/// Condenses problems and solves them by [`ActiveSet`], from the working set of the last one if sizes are the same. Matrices that are the
/// same as the last problem's are not condensed again. Iterations are changes of the working set.
///
/// Costs N (N + 1)/2 · 6 nx² nu + (N nu)³ operations at full rank; an unstable system over a long horizon overflows or loses digits, and
/// [`Riccati`](super::Riccati) does not.
#[derive(Clone, Debug)]
pub struct Condensed {
    solver: ActiveSet,
    /// The matrices that are condensed, if they are all there.
    last: Snapshot,
    /// Γ_0ᵀ … Γ_Nᵀ, N nu × nx, of which the first k nu rows are used.
    gamma: Vec<Mat<f64>>,
    /// W_{k+1}ᵀ and W_kᵀ.
    w: [Mat<f64>; 2],
    /// Upper triangle.
    hessian: Mat<f64>,
    /// Transposed rows of all stages, N nu × m.
    rows: Mat<f64>,
    /// First row of each stage, and their number.
    starts: Vec<usize>,
    nu: usize,
}

impl Condensed {
    /// Without a last solution.
    pub fn new() -> Self {
        Self {
            solver: ActiveSet::new(),
            last: Snapshot::default(),
            gamma: Vec::new(),
            w: [Mat::new(), Mat::new()],
            hessian: Mat::new(),
            rows: Mat::new(),
            starts: Vec::new(),
            nu: 0,
        }
    }

    /// Forgets the working set: the next problem starts from none. Memory is kept.
    pub fn forget(&mut self) {
        self.solver.forget();
    }

    /// Moves the working set by a stage towards the present, for a next problem that begins where the last one's second stage did: the
    /// bounds and rows of stage k + 1 become those of stage k. Rows that stage k has not are left out, and the last stage starts without any.
    pub fn shift(&mut self) {
        let (nu, stages) = (self.nu, self.starts.len().saturating_sub(1));
        let starts = std::mem::take(&mut self.starts);
        let earlier = |j: usize| j.checked_sub(nu);
        self.solver.renumber(|constraint| match constraint {
            Constraint::Lower(j) => earlier(j).map(Constraint::Lower),
            Constraint::Upper(j) => earlier(j).map(Constraint::Upper),
            Constraint::Row(row) => {
                let stage = starts.partition_point(|start| *start <= row) - 1;
                let moved = starts[stage.checked_sub(1)?] + (row - starts[stage]);
                (stage < stages && moved < starts[stage]).then_some(Constraint::Row(moved))
            }
        });
        self.starts = starts;
    }

    /// The condensed matrices: Hessian and rows.
    fn condense(&mut self, ocp: &Ocp) {
        if !self.last.take(ocp) {
            return;
        }
        let (nx, nu, n) = (ocp.nx(), ocp.nu(), ocp.stages.len());
        self.resize(nx, nu, n, ocp);
        for (k, stage) in ocp.stages.iter().enumerate() {
            let (before, after) = self.gamma.split_at_mut(k + 1);
            let (past, mut own) = after[0].as_mut().split_at_row_mut(k * nu);
            multiply(past, Accum::Replace, before[k].as_ref().subrows(0, k * nu), stage.a.transpose());
            own.rb_mut().subrows_mut(0, nu).copy_from(stage.b.transpose());
        }
        self.w[0].fill(0.0);
        add_weighed(self.w[0].as_mut(), self.gamma[n].as_ref(), ocp.q_final.as_ref());
        for (k, stage) in ocp.stages.iter().enumerate().rev() {
            let [later, now] = &mut self.w;
            let later = later.as_ref().subrows(0, (k + 1) * nu);
            let gamma = self.gamma[k].as_ref().subrows(0, k * nu);
            let mut column = self.hessian.as_mut().submatrix_mut(0, k * nu, (k + 1) * nu, nu);
            multiply(column.rb_mut(), Accum::Replace, later, stage.b.as_ref());
            let (past, mut own) = column.split_at_row_mut(k * nu);
            own += &stage.r;
            multiply(past, Accum::Add, gamma, stage.s.transpose());
            let mut now = now.as_mut().subrows_mut(0, k * nu);
            multiply(now.rb_mut(), Accum::Replace, later.subrows(0, k * nu), stage.a.as_ref());
            add_weighed(now, gamma, stage.q.as_ref());
            self.w.swap(0, 1);
        }
        for k in 0..=n {
            let rows = ocp.rows(k);
            let mut block = self.rows.as_mut().subcols_mut(self.starts[k], rows.len());
            block.fill(0.0);
            let gamma = self.gamma[k].as_ref().subrows(0, k * nu);
            add_weighed(block.rb_mut().subrows_mut(0, k * nu), gamma, rows.gx.transpose());
            if k < n {
                block.subrows_mut(k * nu, nu).copy_from(rows.gu.transpose());
            }
        }
    }

    fn resize(&mut self, nx: usize, nu: usize, n: usize, ocp: &Ocp) {
        self.nu = nu;
        self.starts.clear();
        self.starts.push(0);
        let mut m = 0;
        for k in 0..=n {
            m += ocp.rows(k).len();
            self.starts.push(m);
        }
        if self.gamma.len() != n + 1 || self.gamma[0].shape() != (n * nu, nx) {
            self.gamma = vec![Mat::zeros(n * nu, nx); n + 1];
            self.w = [Mat::zeros(n * nu, nx), Mat::zeros(n * nu, nx)];
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
            hessian: self.hessian.transpose(),
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

/// `w += Γᵀ M`, by columns of Γᵀ where M has few entries.
fn add_weighed(mut w: MatMut<'_, f64>, gamma: MatRef<'_, f64>, m: MatRef<'_, f64>) {
    let nonzero = |j: usize| (0..m.nrows()).filter(move |&i| m[(i, j)] != 0.0);
    let count: usize = (0..m.ncols()).map(|j| nonzero(j).count()).sum();
    if count * OCP.sparse_rows > m.nrows() * m.ncols() {
        return multiply(w, Accum::Add, gamma, m);
    }
    for j in 0..m.ncols() {
        let mut w = w.rb_mut().col_mut(j);
        for i in nonzero(j) {
            let factor = m[(i, j)];
            zip!(w.rb_mut(), gamma.col(i)).for_each(|unzip!(w, gamma)| *w += factor * *gamma);
        }
    }
}
