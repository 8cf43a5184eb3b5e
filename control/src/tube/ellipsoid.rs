//! Ellipsoids about the nominal trajectory.

use faer::Mat;

use super::constants::TUBE;
use super::error::TubeError;
use super::gains::Gains;
use super::problem::TubeProblem;
use super::rows::RowValues;
use super::{Reach, Tube, TubeSynthesis};
use crate::linear::{add_product, add_symmetric_product, mirror, product};

/// Factor γ_k on the half-widths √(g Σ_k gᵀ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scaling {
    /// √n with n the number of balls of times 0 … k, hence √(k+1) with one a time: Σ_{l ≤ n} a_l ≤ √n (Σ a_l²)^½ by Cauchy and Schwarz, so
    /// that the half-width is an upper bound of the exact tightening of the same gains, and the policy's trajectories stay within.
    Bound,
    /// A constant. Below √n nothing is guaranteed; with disturbances of a normal law it is a quantile.
    Fixed(f64),
}

/// Ellipsoids Σ_{k+1} = (A + BK) Σ_k (A + BK)ᵀ + E_{k+1} E_{k+1}ᵀ, Σ_0 = E_0 E_0ᵀ, and one gain per stage: O(N nx³) in all.
///
/// ```text
/// h_{k,i} = γ_k (g_i [1; K] Σ_k [1; K]ᵀ g_iᵀ)^½,   weights η_{k,i} = μ_{k,i} γ_k² / (2 h_{k,i}), the derivative of μ h by g Σ gᵀ
/// ```
/// Reference: Zanelli, Frey, Messerer and Diehl (2021), "Zero-order robust nonlinear MPC with ellipsoidal uncertainty sets"; gains by a
/// Riccati recursion: arXiv 2511.10473.
#[derive(Clone, Copy, Debug)]
pub struct EllipsoidalTube {
    /// γ.
    pub scaling: Scaling,
}

impl EllipsoidalTube {
    fn gamma(&self, problem: &TubeProblem<'_>, k: usize) -> f64 {
        match self.scaling {
            Scaling::Bound => (problem.balls[..=k].iter().map(Vec::len).sum::<usize>() as f64).sqrt(),
            Scaling::Fixed(gamma) => gamma,
        }
    }

    fn weights(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>, k: usize) -> Option<Vec<f64>> {
        let previous = previous?;
        let (tightenings, sizes) = (previous.tightenings.stage(k), previous.sizes.stage(k));
        let multipliers = multipliers.stage(k);
        let squared = self.gamma(problem, k).powi(2);
        let eta = |((&mu, &h), &size): ((&f64, &f64), &f64)| {
            let floored = h.max(TUBE.norm_floor * size);
            if mu > 0.0 && floored > 0.0 { mu * squared / (2.0 * floored) } else { 0.0 }
        };
        multipliers.iter().any(|mu| *mu > 0.0).then(|| multipliers.iter().zip(tightenings).zip(sizes).map(eta).collect())
    }
}

impl TubeSynthesis for EllipsoidalTube {
    fn synthesize(&self, problem: &TubeProblem<'_>, multipliers: &RowValues, previous: Option<&Tube>) -> Result<Tube, TubeError> {
        let gains = Gains::of_weights(problem, |k| self.weights(problem, multipliers, previous, k))?;
        let mut tightenings = RowValues::zeros(problem.ocp);
        let mut shapes = Vec::with_capacity(problem.horizon() + 1);
        let mut cost = 0.0;
        let mut sigma = Mat::zeros(problem.nx, problem.nx);
        for k in 0..=problem.horizon() {
            let e = &problem.columns[k];
            add_symmetric_product(sigma.as_mut(), e.as_ref(), e.transpose());
            mirror(&mut sigma);
            let gain = (k < problem.horizon()).then(|| gains.get(k, k));
            let k_sigma = gain.map(|gain| product(gain.as_ref(), sigma.as_ref()));
            let inputs = gain.zip(k_sigma.as_ref()).map(|(gain, k_sigma)| product(k_sigma.as_ref(), gain.transpose()));
            let gamma = self.gamma(problem, k);
            let widths = problem.rows[k].variances(&sigma, gain);
            for (h, variance) in tightenings.stage_mut(k).iter_mut().zip(widths) {
                *h = gamma * variance.max(0.0).sqrt();
            }
            let state_cost = if k < problem.horizon() { &problem.cost.q } else { &problem.cost.q_final };
            cost += trace_of_product(state_cost, &sigma);
            if let (Some(gain), Some(inputs)) = (gain, &inputs) {
                cost += trace_of_product(&problem.cost.r, inputs);
                let stage = &problem.ocp.stages[k];
                let mut closed = stage.a.clone();
                add_product(closed.as_mut(), stage.b.as_ref(), gain.as_ref(), 1.0);
                let moved = product(closed.as_ref(), sigma.as_ref());
                let mut next = Mat::zeros(problem.nx, problem.nx);
                add_symmetric_product(next.as_mut(), moved.as_ref(), closed.transpose());
                shapes.push(std::mem::replace(&mut sigma, next));
            }
        }
        shapes.push(sigma);
        let (reach, sizes) = (Reach::Ellipsoids(shapes), tightenings.clone());
        Ok(Tube { gains, reach, tightenings, cost: Some(cost), norms: Vec::new(), sizes }.after(previous))
    }
}

/// tr(a b) of symmetric a and b.
fn trace_of_product(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (0..a.ncols()).map(|c| a.col_as_slice(c).iter().zip(b.col_as_slice(c)).map(|(a, b)| a * b).sum::<f64>()).sum()
}
