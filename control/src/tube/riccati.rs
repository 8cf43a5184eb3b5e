//! One Riccati recursion of the tube's cost plus weighted rows.

use faer::Mat;

use super::error::TubeError;
use super::problem::TubeProblem;
use crate::linear::{Cholesky, add_product, add_symmetric_product, mirror, set_product};

/// Cost to go S of deviations, going backward from stage N.
///
/// ```text
/// C  = G_kᵀ diag(η_k) G_k + blkdiag(Q_r, R_r)                its blocks xx, ux, uu
/// M  = C_uu + BᵀSB,  F = C_ux + BᵀSA,  K = −M⁻¹F,  S ← C_xx + AᵀSA + FᵀK
/// ```
/// Rows that bind x and u together make the cross term C_ux.
#[derive(Clone)]
pub(crate) struct Riccati<'a> {
    problem: &'a TubeProblem<'a>,
    s: Mat<f64>,
    next: Mat<f64>,
    s_a: Mat<f64>,
    s_b: Mat<f64>,
}

impl<'a> Riccati<'a> {
    /// At stage N, with weights of its rows.
    pub fn new(problem: &'a TubeProblem<'a>, eta: Option<&[f64]>) -> Self {
        let (nx, nu) = (problem.nx, problem.nu);
        let mut s = problem.cost.q_final.clone();
        if let (Some(eta), Some(rows)) = (eta, problem.rows.last()) {
            rows.add_weighted(eta, &mut s, &mut Mat::zeros(0, nx), &mut Mat::zeros(0, 0));
            mirror(&mut s);
        }
        Self { problem, s, next: Mat::zeros(nx, nx), s_a: Mat::zeros(nx, nx), s_b: Mat::zeros(nx, nu) }
    }

    /// Goes back over stage k with weights of its rows.
    ///
    /// # Errors
    /// [`TubeError::Indefinite`].
    pub fn step(&mut self, k: usize, eta: Option<&[f64]>) -> Result<Mat<f64>, TubeError> {
        let (a, b) = (&self.problem.ocp.stages[k].a, &self.problem.ocp.stages[k].b);
        let cost = self.problem.cost;
        set_product(self.s_a.as_mut(), self.s.as_ref(), a.as_ref());
        set_product(self.s_b.as_mut(), self.s.as_ref(), b.as_ref());
        let mut uu = cost.r.clone();
        let mut ux = Mat::zeros(self.problem.nu, self.problem.nx);
        self.next.copy_from(&cost.q);
        if let Some(eta) = eta {
            self.problem.rows[k].add_weighted(eta, &mut self.next, &mut ux, &mut uu);
        }
        add_symmetric_product(uu.as_mut(), b.transpose(), self.s_b.as_ref());
        add_product(ux.as_mut(), self.s_b.transpose(), a.as_ref(), 1.0);
        let factor = Cholesky::new(uu).map_err(|input| TubeError::Indefinite { stage: k, input })?;
        let mut gain = faer::Scale(-1.0) * &ux;
        factor.solve(gain.as_mut());
        add_symmetric_product(self.next.as_mut(), a.transpose(), self.s_a.as_ref());
        add_symmetric_product(self.next.as_mut(), ux.transpose(), gain.as_ref());
        mirror(&mut self.next);
        std::mem::swap(&mut self.s, &mut self.next);
        Ok(gain)
    }
}
