//! A trajectory: steps in a row, with the record of each or with checkpoints from which records are recomputed.

use crate::grasp::Grasping;
use crate::model::Model;
use crate::step::newton::Work;
use crate::step::{Run, StepError, StepOptions, StepRecord, StepTrace, Stepper, Warm};
use pliant_math::State;
use pliant_scene::available_memory;
use std::sync::Arc;

/// How a trajectory is simulated. `StepOptions` convert to it, with no bound on the records.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RolloutOptions {
    /// How steps are taken, and whether derivatives are wanted.
    pub step: StepOptions,
    /// Largest number of records in memory, at least 1. If there are more steps, checkpoints are kept instead, and a vjp simulates
    /// again as many steps at a time; `None` keeps all records.
    pub max_records: Option<usize>,
}

impl From<StepOptions> for RolloutOptions {
    fn from(step: StepOptions) -> Self {
        Self { step, max_records: None }
    }
}

/// Through which states the smoother steps of a surrogate are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// The states of the scene's own contact: the forward simulation stays as it is.
    Hard,
    /// The states of the smoother contact itself.
    Smooth,
}

/// How the steps of a surrogate are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Rest gap δ_b \[m\] of the steps that are differentiated; κ_b = δ_b m g. Positive; usually larger than the scene's.
    pub rest_gap: f64,
    /// Grasp of the steps that are differentiated.
    pub grasp: Grasping,
    /// Through which states.
    pub along: Along,
}

/// A simulated trajectory, and its records or checkpoints if they were asked for.
#[derive(Clone, Debug)]
pub struct Rollout {
    /// The model.
    pub model: Arc<Model>,
    /// The parameters it ran with.
    pub theta: Vec<f64>,
    /// States x₀ … x_T.
    pub states: Vec<State>,
    /// Controls u₀ … u_{T−1}.
    pub controls: Vec<Vec<f64>>,
    /// Iterations and halvings of each step.
    pub traces: Vec<StepTrace>,
    /// Records of each step, or empty.
    pub records: Vec<StepRecord>,
    /// Checkpoints, if there are more steps than records may be kept.
    pub checkpoints: Option<Checkpoints>,
}

/// Warm starts at every so many steps: with the states there, enough to simulate any part of a rollout again, bitwise.
#[derive(Clone, Debug)]
pub struct Checkpoints {
    /// Steps between checkpoints.
    segment: usize,
    warm: Vec<ChainWarm>,
    options: StepOptions,
    smoothing: Option<Smoothing>,
}

/// Simulates the model from `x0` through the rows of `controls`: x_{k+1} = F(x_k, u_k; θ).
///
/// # Errors
/// An argument of another size, a parameter out of its bounds; a step that fails, with its number.
pub fn rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: impl Into<RolloutOptions>,
) -> Result<Rollout, StepError> {
    smoothed_rollout(model, theta, x0, controls, options.into(), None)
}

/// As [`rollout`], with records of smoother steps: for `pliant_adjoint::surrogate_rollout`, which marks the result.
#[doc(hidden)]
pub fn smoothed_rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    RolloutOptions { step, max_records }: RolloutOptions,
    smoothing: Option<Smoothing>,
) -> Result<Rollout, StepError> {
    let kept = if step.record { max_records.map_or(controls.len(), |most| most.max(1).min(controls.len())) } else { 0 };
    records_fit(kept, model)?;
    let segment = max_records.map(|most| most.max(1)).filter(|most| step.record && *most < controls.len());
    let mut checkpoints = segment.map(|segment| Checkpoints { segment, warm: Vec::new(), options: step, smoothing });
    let mut chain = Chain::new(model, theta, StepOptions { record: step.record && segment.is_none(), ..step }, smoothing)?;
    let mut out = Rollout {
        model: Arc::clone(model),
        theta: theta.to_vec(),
        states: vec![x0.clone()],
        controls: controls.to_vec(),
        traces: Vec::with_capacity(controls.len()),
        records: Vec::new(),
        checkpoints: None,
    };
    let (mut state, mut run) = (x0.clone(), Run::default());
    for (k, u) in controls.iter().enumerate() {
        if let Some(checkpoints) = checkpoints.as_mut().filter(|c| k % c.segment == 0) {
            checkpoints.warm.push(chain.warm());
        }
        let (trace, record) = chain.step(&mut state, u).map_err(|e| e.at_step(k))?;
        chain.forward.continue_run(&mut run, &trace.last_halves, &out.states[k], &state).map_err(|e| e.at_step(k))?;
        out.states.push(state.clone());
        out.traces.push(trace);
        out.records.extend(record);
    }
    out.checkpoints = checkpoints;
    Ok(out)
}

/// Refuses records of so many steps that certainly do not fit into memory.
pub(crate) fn records_fit(records: usize, model: &Model) -> Result<(), StepError> {
    available_memory().map_or(Ok(()), |available| fits(records, model.tree().nv(), available))
}

/// Refuses records that certainly do not fit into memory, from their dense matrices of bodies: ∂f/∂q̄, ∂f/∂v̄, the matrix of the step,
/// its factor, and the mass matrix.
fn fits(records: usize, dofs: usize, available: u64) -> Result<(), StepError> {
    let bytes = (5 * size_of::<f64>() as u64).saturating_mul((dofs as u64).pow(2)).saturating_mul(records as u64);
    if bytes > available { Err(StepError::Memory { records, dofs, bytes, available }) } else { Ok(()) }
}

impl Rollout {
    /// Number of parts between checkpoints; one without checkpoints.
    pub fn n_segments(&self) -> usize {
        self.checkpoints.as_ref().map_or(1, |c| c.warm.len())
    }

    /// Simulates part `s` between checkpoints again, with its records but without states and traces, and returns it with the number of
    /// its first step.
    ///
    /// # Errors
    /// A step that fails, with its number; none fails that did not before.
    pub fn segment(&self, s: usize) -> Result<(usize, Rollout), StepError> {
        let Some(Checkpoints { segment, warm, options, smoothing }) = &self.checkpoints else { return Ok((0, self.clone())) };
        let first = s * segment;
        let controls = &self.controls[first..(first + segment).min(self.controls.len())];
        let mut chain = Chain::new(&self.model, &self.theta, *options, *smoothing)?;
        chain.set_warm(&warm[s]);
        let mut state = self.states[first].clone();
        let mut records = Vec::with_capacity(controls.len());
        for (k, u) in controls.iter().enumerate() {
            let (_, record) = chain.step(&mut state, u).map_err(|e| e.at_step(first + k))?;
            records.extend(record);
        }
        let (model, theta, controls) = (Arc::clone(&self.model), self.theta.clone(), controls.to_vec());
        let part = Rollout { model, theta, states: Vec::new(), controls, traces: Vec::new(), records, checkpoints: None };
        Ok((first, part))
    }

    /// Work of all steps.
    pub fn work(&self) -> Work {
        let mut sum = Work::default();
        self.traces.iter().for_each(|t| sum.add(t.work));
        sum
    }

    /// Number of halvings.
    pub fn retries(&self) -> usize {
        self.traces.iter().map(|t| t.retries).sum()
    }

    /// Total energy \[J\] at every state.
    pub fn energy(&self) -> Vec<f64> {
        let total =
            |x: &State| self.model.kinetic_energy(&x.q, &x.v, &self.theta) + self.model.potential_energy(&x.q, &x.z, &self.theta);
        self.states.iter().map(total).collect()
    }
}

/// Advances a state, and records the step to differentiate: that step, or one of smoother contact from the same state.
///
/// The smoother steps have a warm start of their own, so each chain solves what it would solve alone.
struct Chain<'m> {
    forward: Stepper<'m>,
    smooth: Option<Stepper<'m>>,
}

/// Warm starts of a chain: part of a checkpoint.
type ChainWarm = [Option<Warm>; 2];

impl<'m> Chain<'m> {
    fn new(model: &'m Model, theta: &'m [f64], options: StepOptions, smoothing: Option<Smoothing>) -> Result<Self, StepError> {
        let Some(Smoothing { rest_gap, grasp, along }) = smoothing else {
            return Ok(Self { forward: Stepper::new(model, theta, options)?, smooth: None });
        };
        let smooth = Stepper::new(model, theta, options)?.with_rest_gap(rest_gap)?.with_grasping(grasp);
        Ok(match along {
            Along::Smooth => Self { forward: smooth, smooth: None },
            Along::Hard => {
                let forward = Stepper::new(model, theta, StepOptions { record: false, ..options })?;
                Self { forward, smooth: Some(smooth) }
            }
        })
    }

    fn step(&mut self, state: &mut State, u: &[f64]) -> Result<(StepTrace, Option<StepRecord>), StepError> {
        let Some(smooth) = &mut self.smooth else { return self.forward.step(state, u) };
        let (of_smooth, record) = smooth.step(&mut state.clone(), u)?;
        let (mut trace, _) = self.forward.step(state, u)?;
        trace.work.add(of_smooth.work);
        trace.retries += of_smooth.retries;
        Ok((trace, record))
    }

    fn warm(&self) -> ChainWarm {
        [self.forward.warm_start().cloned(), self.smooth.as_ref().and_then(|s| s.warm_start().cloned())]
    }

    fn set_warm(&mut self, [forward, smooth]: &ChainWarm) {
        self.forward.set_warm_start(forward.clone());
        if let Some(stepper) = &mut self.smooth {
            stepper.set_warm_start(smooth.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn records_that_do_not_fit_are_refused_with_their_bytes() {
        fits(0, 6000, 0).unwrap();
        fits(3, 6000, 5 << 30).unwrap();
        let error = fits(4, 6000, 5 << 30).unwrap_err();
        assert!(matches!(error, StepError::Memory { bytes: 5_760_000_000, records: 4, .. }), "{error}");
        assert!(error.to_string().contains("max_records"), "{error}");
    }
}
