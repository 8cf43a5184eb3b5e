//! Values of a problem at given states and inputs.

use super::products::add_to;
use super::{Ocp, Rows};
use crate::kernels::dot;

impl Ocp {
    /// x_0 … x_N of the inputs u_0 … u_{N−1}.
    pub fn rollout(&self, u: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut x = Vec::with_capacity(self.stages.len() + 1);
        x.push(self.x0.clone());
        for (k, stage) in self.stages.iter().enumerate() {
            let mut next = stage.d.clone();
            add_to(&mut next, 1.0, stage.a.as_ref(), &x[k]);
            add_to(&mut next, 1.0, stage.b.as_ref(), &u[k]);
            x.push(next);
        }
        x
    }

    /// max(0, G x + G u − limit) of the rows of stages 0 … N.
    pub fn violations(&self, x: &[Vec<f64>], u: &[Vec<f64>]) -> Vec<Vec<f64>> {
        (0..x.len()).map(|k| self.rows(k).excess(&x[k], u.get(k)).into_iter().map(|excess| excess.max(0.0)).collect()).collect()
    }

    /// Value of the cost, with the prices of soft rows' violations.
    pub fn cost(&self, x: &[Vec<f64>], u: &[Vec<f64>], violations: &[Vec<f64>]) -> f64 {
        let mut cost = 0.0;
        for (k, stage) in self.stages.iter().enumerate() {
            let (mut of_x, mut of_u) = (stage.q_linear.clone(), stage.r_linear.clone());
            add_to(&mut of_x, 0.5, stage.q.as_ref(), &x[k]);
            add_to(&mut of_u, 0.5, stage.r.as_ref(), &u[k]);
            add_to(&mut of_u, 1.0, stage.s.as_ref(), &x[k]);
            cost += dot(&of_x, &x[k]) + dot(&of_u, &u[k]);
        }
        if let Some(last) = x.last() {
            let mut of_x = self.q_final_linear.clone();
            add_to(&mut of_x, 0.5, self.q_final.as_ref(), last);
            cost += dot(&of_x, last);
        }
        let price = |(weight, violation): (&f64, &f64)| if weight.is_finite() { weight * violation } else { 0.0 };
        cost + violations
            .iter()
            .enumerate()
            .map(|(k, at)| self.rows(k).weights.iter().zip(at).map(price).sum::<f64>())
            .sum::<f64>()
    }
}

impl Rows {
    /// G_x x + G_u u − limits; without u at the last stage.
    pub(super) fn excess(&self, x: &[f64], u: Option<&Vec<f64>>) -> Vec<f64> {
        let mut excess: Vec<f64> = self.limits.iter().map(|limit| -limit).collect();
        add_to(&mut excess, 1.0, self.gx.as_ref(), x);
        if let Some(u) = u {
            add_to(&mut excess, 1.0, self.gu.as_ref(), u);
        }
        excess
    }
}
