//! Model predictive path integral control (MPPI), the sampling method that gradients are compared with.
//!
//! ```text
//! u^i = clip(U + ε^i),  ε^i ~ N(0, σ²),  i = 1 … samples        σ of each input
//! S_i = J(u^i) + w Σ max(0, c)² + γ λ Σ_k U_kᵀ Σ⁻¹ ε_k^i
//! U  ← U + Σ_i ω_i (u^i − U),   ω_i ∝ exp(−(S_i − min S)/λ)
//! ```
//! (Williams et al. 2017, *Information theoretic MPC for model-based reinforcement learning*.) A sample whose rollout fails has no weight.
//! Samples are drawn from a generator of their own each, so that results do not depend on the number of threads. λ → 0 is random
//! shooting: the best sample.

use crate::plan::PlanError;
use crate::problem::{Problem, Terms};
use pliant_engine::model::Model;
use pliant_engine::rollout::rollout;
use pliant_engine::step::StepOptions;
use pliant_math::State;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Settings.
#[derive(Clone, Debug, PartialEq)]
pub struct MppiOptions {
    /// Rollouts per update.
    pub samples: usize,
    /// σ of each input (nu), in its unit.
    pub sigma: Vec<f64>,
    /// Temperature λ, in the unit of the cost.
    pub temperature: f64,
    /// γ, the share of the control cost [-].
    pub gamma: f64,
    /// w, price of a squared violation.
    pub violation: f64,
    /// Seed of the samples.
    pub seed: u64,
}

/// A controller.
pub struct Mppi<P> {
    problem: P,
    model: Arc<Model>,
    theta: Vec<f64>,
    options: MppiOptions,
    controls: Vec<Vec<f64>>,
    updates: u64,
}

impl<P: Problem> Mppi<P> {
    /// A controller whose first plan is `controls`: one row per step that it looks ahead.
    ///
    /// # Errors
    /// No rows, rows or σ of another size than the model's inputs.
    pub fn new(
        problem: P,
        model: &Arc<Model>,
        theta: &[f64],
        controls: Vec<Vec<f64>>,
        options: MppiOptions,
    ) -> Result<Self, PlanError> {
        if controls.is_empty() || options.samples == 0 {
            return Err(PlanError::Empty);
        }
        let sizes = controls.iter().map(Vec::len).chain([options.sigma.len()]);
        if let Some((row, got)) = sizes.enumerate().find(|(_, size)| *size != model.nu()) {
            return Err(PlanError::Inputs { row, got, expected: model.nu() });
        }
        Ok(Self { problem, model: Arc::clone(model), theta: theta.to_vec(), options, controls, updates: 0 })
    }

    /// Improves the plan from the measured state `x`; returns the inputs to apply now, and shifts the plan.
    ///
    /// # Errors
    /// Every sample fails: the error of the first.
    pub fn update(&mut self, x: &State) -> Result<Vec<f64>, PlanError> {
        let samples: Vec<Result<Sample, PlanError>> =
            (0..self.options.samples).into_par_iter().map(|i| self.sample(i, x)).collect();
        self.updates += 1;
        let least = samples.iter().flatten().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
        if !least.is_finite() {
            return Err(samples.into_iter().find_map(Result::err).unwrap_or(PlanError::Empty));
        }
        let weight = |cost: f64| (-(cost - least) / self.options.temperature).exp();
        let sum: f64 = samples.iter().flatten().map(|(cost, _)| weight(*cost)).sum();
        let mut next = vec![vec![0.0; self.model.nu()]; self.controls.len()];
        for (cost, u) in samples.iter().flatten() {
            let share = weight(*cost) / sum;
            next.iter_mut().zip(u).for_each(|(to, from)| to.iter_mut().zip(from).for_each(|(a, b)| *a += share * b));
        }
        let first = next[0].clone();
        next.rotate_left(1);
        if let [.., before, last] = next.as_mut_slice() {
            last.clone_from(before);
        }
        self.controls = next;
        Ok(first)
    }

    /// Its cost and inputs.
    fn sample(&self, i: usize, x: &State) -> Result<Sample, PlanError> {
        let MppiOptions { sigma, temperature, gamma, violation, seed, .. } = &self.options;
        let mut random = Pcg64::seed_from_u64(seed ^ (self.updates * 0x9E37_79B9 + i as u64).wrapping_mul(0x5851_F42D_4C95_7F2D));
        let (nu, n) = (self.model.nu(), self.controls.len());
        let (mut lower, mut upper) = (vec![0.0; nu], vec![0.0; nu]);
        let (mut controls, mut shift) = (self.controls.clone(), 0.0);
        for (k, u) in controls.iter_mut().enumerate() {
            self.problem.bounds(k, &mut lower, &mut upper);
            for (c, u) in u.iter_mut().enumerate() {
                let epsilon = sigma[c] * normal(&mut random);
                if sigma[c] > 0.0 {
                    shift += *u * epsilon / (sigma[c] * sigma[c]);
                }
                *u = (*u + epsilon).clamp(lower[c], upper[c]);
            }
        }
        let options = StepOptions { record: false, ..StepOptions::default() };
        let run = rollout(&self.model, &self.theta, x, &controls, options).map_err(PlanError::Guess)?;
        let (mut cost, mut terms) = (gamma * temperature * shift, Terms::default());
        for (k, x) in run.states.iter().enumerate() {
            terms.clear();
            self.problem.evaluate(k, n, x, controls.get(k).map(Vec::as_slice), &mut terms).map_err(PlanError::Problem)?;
            cost += terms.cost() + violation * terms.constraints.values.iter().map(|c| c.max(0.0).powi(2)).sum::<f64>();
        }
        if cost.is_finite() {
            Ok((cost, controls))
        } else {
            Err(PlanError::NotFinite { what: "the cost", value: cost, stage: n })
        }
    }
}

/// Cost and inputs of a sample.
type Sample = (f64, Vec<Vec<f64>>);

/// A standard normal number (Box and Muller).
pub(crate) fn normal(random: &mut Pcg64) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}
