//! Checks gradients of rollouts: differences with their own uncertainty, Taylor slopes and the dot test, block by block.
//!
//! The scalar checked is L = Σ_k w_k·x_k over all states of a rollout with random weights (turns of balls counted from the rollout
//! at hand). For each block of inputs (x₀, u, each quantity of θ) and a random direction d in it:
//! - *relative error* of ⟨∇L, d⟩ against the extrapolated difference of least uncertainty; that uncertainty is the difference's own
//!   *floor*;
//! - *Taylor slope*: |L(p + εd) − L(p) − ε⟨∇L, d⟩| must fall like ε² (unless the map is affine along d);
//! - *dot test*: ⟨w, J d⟩ by jvp equals ⟨Jᵀw, d⟩ by vjp, but for rounding, which is seen by doing both again with d/3 and w/3;
//! - *switches*: how many contacts changed between separate, stick and slip, motors began or ceased to saturate, plastic rods to
//!   flow, rods with friction to unload, delays passed a whole number of steps, or steps were halved differently, within a
//!   difference. A difference with a switch judges nothing.
//!
//! The dot test is always judged. Where no difference is free of switches and certain to 1e-6, the block is
//! [`Verdict::Inconclusive`]: at a kink of the map, or where its smooth range lies below rounding.

mod block;
mod constants;
mod difference;
#[cfg(test)]
mod verdicts;

pub use constants::{GRADCHECK, GradcheckConstants};

use crate::{AdjointError, rollout_jvp, rollout_vjp};
use block::Block;
use difference::Derivative;
use pliant_engine::model::Model;
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::State;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Judged, and right.
    Pass,
    /// jvp and vjp disagree, or the gradient and a difference that judges.
    Fail,
    /// jvp and vjp agree, but no difference judges.
    Inconclusive,
}

/// Result for one block of inputs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BlockReport {
    /// `x0.q`, `x0.v`, `x0.z`, `u`, or the path of a quantity of θ with its indices as `*`.
    pub name: String,
    /// Number of entries.
    pub size: usize,
    /// ⟨∇L, d⟩ by vjp.
    pub derivative: f64,
    /// The difference of least uncertainty; NaN if each has a switch.
    pub difference: f64,
    /// |derivative − difference| over the larger of the two, or over 1e-4 of L's terms per scale of the block if both are smaller.
    pub relative_error: f64,
    /// Uncertainty of the difference, relative to the same; infinite if each has a switch.
    pub floor: f64,
    /// Smallest of the three steps of the difference along d, in the block's unit; 0 if each has a switch.
    pub step: f64,
    /// Slope of the Taylor remainder over these steps; `None` if it is below noise (the map is affine along d).
    pub taylor_slope: Option<f64>,
    /// Disagreement of jvp and vjp along d, beyond L's last digit over the block's scale and their own rounding, relative to their terms.
    pub dot_test: f64,
    /// Switches within the smallest difference, if each has some; otherwise 0.
    pub switches: usize,
    /// The difference is one-sided, because the value is at its physical bound.
    pub one_sided: bool,
    /// The verdict.
    pub verdict: Verdict,
    /// Why the block does not pass, with the figures; `None` if it passes.
    pub reason: Option<String>,
}

impl BlockReport {
    /// Whether jvp and vjp agree.
    pub fn modes_agree(&self) -> bool {
        self.dot_test <= GRADCHECK.dot_test
    }
}

/// Result of a gradient check.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// `Fail` if a block fails; `Inconclusive` if none fails and some are inconclusive.
    pub verdict: Verdict,
    /// Number of blocks that pass or fail.
    pub judged: usize,
    /// Number of blocks.
    pub total: usize,
    /// Largest relative error of the blocks that are judged.
    pub worst_relative_error: f64,
    /// The Taylor slope farthest from 2 of the blocks that are judged; `None` if the map is affine in each of them.
    pub taylor_slope: Option<f64>,
    /// Largest disagreement of jvp and vjp.
    pub dot_test: f64,
    /// Switches within the smallest differences of the blocks whose differences all have some.
    pub switches: usize,
    /// Steps that were halved in the base rollout.
    pub retries: usize,
    /// Block by block.
    pub blocks: Vec<BlockReport>,
}

impl Report {
    /// Blocks with this verdict.
    pub fn with(&self, verdict: Verdict) -> impl Iterator<Item = &BlockReport> {
        self.blocks.iter().filter(move |b| b.verdict == verdict)
    }
}

/// Inputs of a rollout, by which it is differentiated.
#[derive(Clone, Debug)]
pub(crate) struct Inputs {
    pub x0: State,
    pub u: Vec<Vec<f64>>,
    pub theta: Vec<f64>,
}

/// L and the events on the way: modes of all contacts and halvings of all steps.
pub(crate) struct Sample {
    pub value: f64,
    /// Sum of the sizes of the terms of L.
    pub parts: f64,
    pub modes: Vec<u8>,
}

/// Checks jvp and vjp of the rollout of `model`, its steps solved at least to [`GradcheckConstants::tolerance`], from `x0` through `controls` at `theta`; `seed` chooses weights and directions.
pub fn gradcheck(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    seed: u64,
) -> Result<Report, AdjointError> {
    gradcheck_with_progress(model, theta, x0, controls, seed, &mut |_, _, _| ())
}

/// How many steps of a scene are checked where no number is asked for, so that it takes seconds: fewer of large models.
pub fn default_steps(model: &Model) -> usize {
    (GRADCHECK.steps_times_dofs / model.nv().max(1)).clamp(GRADCHECK.fewest_steps, GRADCHECK.steps)
}

/// [`gradcheck`] that calls `progress` with how many blocks were begun before, how many there are, and the block's name as each begins. Blocks
/// are shared among the threads of rayon's pool.
pub fn gradcheck_with_progress(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    seed: u64,
    progress: &mut (dyn FnMut(usize, usize, &str) + Send),
) -> Result<Report, AdjointError> {
    let model = &Arc::new(Model::clone(model).solved_to(GRADCHECK.tolerance));
    let mut random = Random(seed);
    let inputs = Inputs { x0: x0.clone(), u: controls.to_vec(), theta: theta.to_vec() };
    let scale = 1.0 / (controls.len() + 1) as f64;
    let weights: Vec<Vec<f64>> =
        (0..=controls.len()).map(|_| (0..model.ndx()).map(|_| scale * random.symmetric()).collect()).collect();
    let base = run(model, &inputs)?;
    let gradient = rollout_vjp(&base, &weights)?;
    // a sweep is linear: along a third of a direction it gives a third, but for its rounding
    let third = |x: &[f64]| -> Vec<f64> { x.iter().map(|x| x / 3.0).collect() };
    let gradient_of_third = rollout_vjp(&base, &weights.iter().map(|w| third(w)).collect::<Vec<_>>())?;
    let sampled = |rollout: &Rollout| Sample {
        value: levels(model, &base, rollout).zip(&weights).map(|(x, w)| dot(&x, w)).sum(),
        parts: rollout.states.iter().zip(&weights).map(|(x, w)| abs_dot(&sizes(model, x), w)).sum(),
        modes: modes(rollout),
    };
    let at_base = sampled(&base);
    let (all, begun) = (block::all(model, &inputs, &mut random), Mutex::new((0, progress)));
    let check = |block: &Block| {
        let (k, progress) = &mut *begun.lock().unwrap_or_else(PoisonError::into_inner);
        progress(*k, all.len(), &block.name);
        *k += 1;
        let tangent = rollout_jvp(&base, Some(&block.x0), Some(&block.u), Some(&block.theta))?;
        let u_third: Vec<Vec<f64>> = block.u.iter().map(|u| third(u)).collect();
        let tangent_of_third = rollout_jvp(&base, Some(&third(&block.x0)), Some(&u_third), Some(&third(&block.theta)))?;
        let along = |tangent: &[Vec<f64>]| -> f64 { tangent.iter().zip(&weights).map(|(t, w)| dot(t, w)).sum() };
        let by_parts: f64 = tangent.iter().zip(&weights).map(|(t, w)| abs_dot(t, w)).sum();
        let (by_vjp, by_jvp) = (block.dot(&gradient), along(&tangent));
        let derivative = Derivative {
            by_vjp,
            by_jvp,
            size: by_parts.max(by_vjp_size(block, &gradient)),
            rounding: (3.0 * block.dot(&gradient_of_third) - by_vjp).abs() + (3.0 * along(&tangent_of_third) - by_jvp).abs(),
        };
        let sample = |eps: f64| Ok(sampled(&run(model, &block.moved(model, &inputs, eps))?));
        Ok(difference::judge(block, &derivative, &at_base, sample))
    };
    let blocks = all.par_iter().map(check).collect::<Result<Vec<_>, AdjointError>>()?;
    Ok(summary(blocks, base.retries()))
}

fn run(model: &Arc<Model>, inputs: &Inputs) -> Result<Rollout, AdjointError> {
    Ok(rollout(model, &inputs.theta, &inputs.x0, &inputs.u, StepOptions::default())?)
}

/// The numbers of all states of `other`, turns of balls counted from those of `base`.
fn levels<'a>(model: &'a Model, base: &'a Rollout, other: &'a Rollout) -> impl Iterator<Item = Vec<f64>> + 'a {
    base.states.iter().zip(&other.states).map(|(a, b)| {
        let mut x = sizes(model, a);
        x.iter_mut().zip(model.difference(b, a)).for_each(|(x, d)| *x += d);
        x
    })
}

/// Sizes of the numbers that a change of state is a difference of; turns of balls are rounded like numbers of size one.
fn sizes(model: &Model, x: &State) -> Vec<f64> {
    let n = model.n_node_dofs();
    let mut out = x.q[..n].to_vec();
    for joint in model.tree().joints() {
        let size = if joint.kind.n_dofs() == 1 { x.q[n + joint.q] } else { 1.0 };
        out.extend(std::iter::repeat_n(size, joint.kind.n_dofs()));
    }
    out.extend_from_slice(&x.v);
    out.extend_from_slice(&x.z);
    out
}

fn summary(blocks: Vec<BlockReport>, retries: usize) -> Report {
    let judged = || blocks.iter().filter(|b| b.verdict != Verdict::Inconclusive);
    let any = |verdict: Verdict| blocks.iter().any(|b| b.verdict == verdict);
    let slopes = judged().filter_map(|b| b.taylor_slope);
    Report {
        verdict: [Verdict::Fail, Verdict::Inconclusive].into_iter().find(|v| any(*v)).unwrap_or(Verdict::Pass),
        judged: judged().count(),
        total: blocks.len(),
        worst_relative_error: judged().map(|b| b.relative_error).fold(0.0, f64::max),
        taylor_slope: slopes.max_by(|a, b| (a - 2.0).abs().total_cmp(&(b - 2.0).abs())),
        dot_test: blocks.iter().map(|b| b.dot_test).fold(0.0, f64::max),
        switches: blocks.iter().map(|b| b.switches).sum(),
        retries,
        blocks,
    }
}

/// Sum of the sizes of the parts of ⟨∇L, d⟩: rounding is relative to the parts, not to their sum.
fn by_vjp_size(block: &Block, gradient: &crate::RolloutCotangent) -> f64 {
    abs_dot(&block.x0, &gradient.x0)
        + abs_dot(&block.theta, &gradient.theta)
        + block.u.iter().zip(&gradient.u).map(|(a, b)| abs_dot(a, b)).sum::<f64>()
}

/// Branches of every step: of its motors' signals, of contacts, joints and motors in each of its stages, and how many these are.
fn modes(rollout: &Rollout) -> Vec<u8> {
    let mut out = Vec::new();
    for (record, u) in rollout.records.iter().zip(&rollout.controls) {
        out.extend(rollout.model.signal_modes(u, &rollout.theta));
        out.push(record.stages.len() as u8);
        for (_, stage) in &record.stages {
            out.extend(stage.contact_modes(&rollout.model, &rollout.theta));
        }
    }
    out
}

fn abs_dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x * y).abs()).sum()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// SplitMix64 (Steele, Lea, Flood 2014): enough for directions, and the same everywhere.
pub(crate) struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [−1, 1).
    pub(crate) fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}
