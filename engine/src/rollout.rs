//! A trajectory: steps in a row.

use crate::model::Model;
use crate::step::newton::Work;
use crate::step::{StepError, StepOptions, StepRecord, StepTrace, Stepper};
use pliant_math::State;
use std::sync::Arc;

/// A simulated trajectory, and its records if they were asked for.
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
    /// What happened in each step.
    pub traces: Vec<StepTrace>,
    /// Records of each step, or empty.
    pub records: Vec<StepRecord>,
}

/// Runs the model from `x0` through the rows of `controls`.
///
/// A step that fails stops the rollout with an error carrying its number.
pub fn rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: StepOptions,
) -> Result<Rollout, StepError> {
    let mut stepper = Stepper::new(model, theta, options)?;
    rollout_by(model, theta, x0, controls, |state, u| stepper.step(state, u))
}

/// As [`rollout`], with steps taken by `step`: it replaces the state by the next one, and returns a trace and the record to keep.
pub fn rollout_by(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    mut step: impl FnMut(&mut State, &[f64]) -> Result<(StepTrace, Option<StepRecord>), StepError>,
) -> Result<Rollout, StepError> {
    let mut out = Rollout {
        model: Arc::clone(model),
        theta: theta.to_vec(),
        states: vec![x0.clone()],
        controls: controls.to_vec(),
        traces: Vec::with_capacity(controls.len()),
        records: Vec::new(),
    };
    let mut state = x0.clone();
    for (k, u) in controls.iter().enumerate() {
        let (trace, record) = step(&mut state, u).map_err(|e| e.at_step(k))?;
        out.states.push(state.clone());
        out.traces.push(trace);
        out.records.extend(record);
    }
    Ok(out)
}

impl Rollout {
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
