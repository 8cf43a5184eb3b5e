//! How a rollout is simulated: what every face of it takes.

use crate::errors;
use pliant::{
    CheckpointedRollout, Differentiate, Model, Rollout, RolloutCotangent, State, StepOptions, StepTrace, checkpointed_rollout,
    rollout,
};
use pyo3::PyErr;
use std::sync::Arc;

/// Records of all steps, or of none, or checkpoints from which they are recomputed.
#[derive(Debug)]
pub enum Trajectory {
    /// All at once.
    Whole(Rollout),
    /// At most so many at a time.
    Checkpointed(CheckpointedRollout),
}

/// What a simulation keeps.
#[derive(Clone, Copy, Debug)]
pub struct Keep {
    /// Steps' options.
    pub step: StepOptions,
    /// Largest number of records in memory.
    pub max_records: Option<usize>,
}

impl Keep {
    /// Simulates.
    pub fn run(self, model: &Arc<Model>, theta: &[f64], x0: &[f64], u: &[Vec<f64>]) -> Result<Trajectory, PyErr> {
        let x0 = State::from_flat(x0);
        match self.max_records {
            Some(records) if records < u.len() && self.step.record => {
                let kept = checkpointed_rollout(model, theta, &x0, u, self.step, records).map_err(errors::adjoint)?;
                Ok(Trajectory::Checkpointed(kept))
            }
            _ => rollout(model, theta, &x0, u, self.step).map(Trajectory::Whole).map_err(errors::step),
        }
    }
}

impl Trajectory {
    pub fn model(&self) -> &Arc<Model> {
        match self {
            Self::Whole(r) => &r.model,
            Self::Checkpointed(r) => &r.model,
        }
    }

    pub fn theta(&self) -> &[f64] {
        match self {
            Self::Whole(r) => &r.theta,
            Self::Checkpointed(r) => &r.theta,
        }
    }

    pub fn states(&self) -> &[State] {
        match self {
            Self::Whole(r) => &r.states,
            Self::Checkpointed(r) => &r.states,
        }
    }

    pub fn controls(&self) -> &[Vec<f64>] {
        match self {
            Self::Whole(r) => &r.controls,
            Self::Checkpointed(r) => &r.controls,
        }
    }

    /// States one after another, (T + 1) × nx.
    pub fn flat(&self) -> Vec<f64> {
        self.states().iter().flat_map(State::to_flat).collect()
    }

    /// What happened in each step; not kept with checkpoints.
    pub fn traces(&self) -> Option<&[StepTrace]> {
        match self {
            Self::Whole(r) => Some(&r.traces),
            Self::Checkpointed(_) => None,
        }
    }

    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<RolloutCotangent, PyErr> {
        match self {
            Self::Whole(r) => r.vjp(x_bar),
            Self::Checkpointed(r) => r.vjp(x_bar),
        }
        .map_err(errors::adjoint)
    }

    pub fn jvp(
        &self,
        x0_dot: Option<&[f64]>,
        u_dot: Option<&[Vec<f64>]>,
        theta_dot: Option<&[f64]>,
    ) -> Result<Vec<Vec<f64>>, PyErr> {
        self.whole("jvp")?.jvp(x0_dot, u_dot, theta_dot).map_err(errors::adjoint)
    }

    /// All records, or an error that says how to keep them.
    pub fn whole(&self, what: &str) -> Result<&Rollout, PyErr> {
        match self {
            Self::Whole(r) => Ok(r),
            Self::Checkpointed(r) => Err(errors::input(format!(
                "{what} needs the records of all {} steps, but this rollout keeps at most {} at a time: simulate it without \
                 `max_records`",
                r.controls.len(),
                r.segment
            ))),
        }
    }
}
