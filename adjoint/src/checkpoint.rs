//! Rollout gradients within a memory bound: states are kept at checkpoints, records are recomputed segment by segment.
//!
//! A checkpoint is the state and the contacts' warm start, so a replay solves the same systems from the same start and the
//! gradients are bitwise those of stored records.

use crate::AdjointError;
use crate::chain::{Chain, Smoothing, Warm};
use crate::rollout::{RolloutCotangent, add, check, pull_back};
use crate::step::Cotangent;
use pliant_engine::model::Model;
use pliant_engine::rollout::Rollout;
use pliant_engine::step::{StepOptions, StepTrace};
use pliant_math::State;
use std::sync::Arc;

/// A rollout without records: its states, and what is needed to recompute any segment.
#[derive(Clone, Debug)]
pub struct CheckpointedRollout {
    /// The model.
    pub model: Arc<Model>,
    /// The parameters.
    pub theta: Vec<f64>,
    /// Controls u₀ … u_{T−1}.
    pub controls: Vec<Vec<f64>>,
    /// States x₀ … x_T.
    pub states: Vec<State>,
    /// What happened in each step.
    pub traces: Vec<StepTrace>,
    /// Steps between checkpoints.
    pub segment: usize,
    options: StepOptions,
    smoothing: Option<Smoothing>,
    warm: Vec<Warm>,
}

/// Rolls out keeping records of at most `max_records` steps at a time.
pub fn checkpointed_rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: StepOptions,
    max_records: usize,
) -> Result<CheckpointedRollout, AdjointError> {
    checkpointed(model, theta, x0, controls, options, None, max_records)
}

/// Checkpoints hold what every chain of steps needs, those that are only recorded included.
pub(crate) fn checkpointed(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: StepOptions,
    smoothing: Option<Smoothing>,
    max_records: usize,
) -> Result<CheckpointedRollout, AdjointError> {
    let segment = max_records.max(1);
    let (mut states, mut traces, mut warm, mut state) = (vec![x0.clone()], Vec::new(), Vec::new(), x0.clone());
    let mut chain = Chain::new(model, theta, StepOptions { record: false, ..options }, smoothing)?;
    for (k, u) in controls.iter().enumerate() {
        if k % segment == 0 {
            warm.push(chain.warm());
        }
        let (trace, _) = chain.step(&mut state, u).map_err(|e| e.at_step(k))?;
        traces.push(trace);
        states.push(state.clone());
    }
    Ok(CheckpointedRollout {
        model: Arc::clone(model),
        theta: theta.to_vec(),
        controls: controls.to_vec(),
        states,
        traces,
        segment,
        options,
        smoothing,
        warm,
    })
}

impl CheckpointedRollout {
    /// As [`crate::rollout_vjp`], bitwise.
    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<RolloutCotangent, AdjointError> {
        check("x_bar", Some(x_bar.len()), self.controls.len() + 1)?;
        let mut out = RolloutCotangent {
            x0: Vec::new(),
            u: vec![vec![0.0; self.model.nu()]; self.controls.len()],
            theta: vec![0.0; self.model.n_params()],
        };
        let mut x = Cotangent::zero(&self.model);
        for (s, warm) in self.warm.iter().enumerate().rev() {
            let first = s * self.segment;
            let last = (first + self.segment).min(self.controls.len());
            let segment = self.replay(first, last, warm)?;
            pull_back(&segment, first, x_bar, &mut x, &mut out)?;
        }
        add(&mut x, &x_bar[0])?;
        out.x0 = [x.q, x.v, x.z].concat();
        Ok(out)
    }

    fn replay(&self, first: usize, last: usize, warm: &Warm) -> Result<Rollout, AdjointError> {
        let options = StepOptions { record: true, ..self.options };
        let mut chain = Chain::new(&self.model, &self.theta, options, self.smoothing)?;
        chain.set_warm(warm);
        let mut state = self.states[first].clone();
        let mut records = Vec::with_capacity(last - first);
        for (k, u) in self.controls[first..last].iter().enumerate() {
            let (_, record) = chain.step(&mut state, u).map_err(|e| e.at_step(first + k))?;
            records.extend(record);
        }
        Ok(Rollout {
            model: Arc::clone(&self.model),
            theta: self.theta.clone(),
            states: Vec::new(),
            controls: self.controls[first..last].to_vec(),
            traces: Vec::new(),
            records,
        })
    }
}
