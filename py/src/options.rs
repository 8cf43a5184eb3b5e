//! How a rollout is simulated: what every face of it takes.

use crate::errors;
use pliant::{
    Along, CheckpointedRollout, Differentiate, Grasping, Linearization, Model, Rollout, RolloutCotangent, Smoothing, State,
    StepOptions, StepTrace, Surrogate, checkpointed_rollout, rollout, surrogate_checkpointed_rollout, surrogate_rollout,
};
use pyo3::{PyErr, PyResult};
use std::sync::Arc;

/// Records of all steps or of none, or checkpoints from which they are recomputed; of the scene's contact or of a smoother one.
#[derive(Debug)]
pub enum Trajectory {
    /// All at once.
    Whole(Rollout),
    /// At most so many at a time.
    Checkpointed(CheckpointedRollout),
    /// All at once, of a smoother contact.
    Smoothed(Surrogate<Rollout>),
    /// At most so many at a time, of a smoother contact.
    SmoothedCheckpointed(Surrogate<CheckpointedRollout>),
}

/// What a simulation keeps.
#[derive(Clone, Copy, Debug)]
pub struct Keep {
    /// Steps' options.
    pub step: StepOptions,
    /// Largest number of records in memory.
    pub max_records: Option<usize>,
    /// The contact and grasp that are differentiated; the scene's own if `None`.
    pub smoothing: Option<Smoothing>,
}

impl Keep {
    /// From the keyword arguments `record`, `max_records`, `rest_gap`, `grasp` and `states`; the scene's own contact and grasp are no
    /// surrogate.
    pub fn new(
        model: &Model,
        record: bool,
        max_records: Option<usize>,
        [states, grasp]: [&str; 2],
        rest_gap: Option<f64>,
    ) -> PyResult<Self> {
        if max_records == Some(0) {
            return Err(errors::input("max_records is 0, but must be at least 1, or None to keep all"));
        }
        let along = match states {
            "smooth" => Along::Smooth,
            "hard" => Along::Hard,
            other => return Err(errors::input(format!("states is \"{other}\", but must be \"smooth\" or \"hard\""))),
        };
        let grasp = match grasp {
            "smooth" => Grasping::Smooth,
            "hard" => Grasping::Hard,
            other => return Err(errors::input(format!("grasp is \"{other}\", but must be \"smooth\" or \"hard\""))),
        };
        let smoothing = match rest_gap {
            Some(gap) if !(gap.is_finite() && gap > 0.0) => {
                return Err(errors::input(format!("rest_gap is {gap} m, but must be positive")));
            }
            None if along == Along::Hard && grasp == Grasping::Hard => {
                return Err(errors::input(
                    "states = \"hard\" needs a rest_gap, that of the steps to differentiate, or grasp = \"smooth\"",
                ));
            }
            gap => {
                let rest_gap = gap.unwrap_or(model.rest_gap());
                let other = rest_gap != model.rest_gap() || grasp == Grasping::Smooth;
                other.then_some(Smoothing { rest_gap, grasp, along })
            }
        };
        Ok(Self { step: StepOptions { record, ..StepOptions::default() }, max_records, smoothing })
    }

    /// Simulates.
    pub fn run(self, model: &Arc<Model>, theta: &[f64], x0: &[f64], u: &[Vec<f64>]) -> Result<Trajectory, PyErr> {
        let (x0, step) = (State::from_flat(x0, model.nq(), model.nv()), self.step);
        let records = self.max_records.filter(|&records| records < u.len() && step.record);
        match (self.smoothing, records) {
            (None, None) => return rollout(model, theta, &x0, u, step).map(Trajectory::Whole).map_err(errors::step),
            (None, Some(most)) => checkpointed_rollout(model, theta, &x0, u, step, most).map(Trajectory::Checkpointed),
            (Some(smoothing), None) => surrogate_rollout(model, theta, &x0, u, step, smoothing).map(Trajectory::Smoothed),
            (Some(smoothing), Some(most)) => {
                surrogate_checkpointed_rollout(model, theta, &x0, u, step, smoothing, most).map(Trajectory::SmoothedCheckpointed)
            }
        }
        .map_err(errors::adjoint)
    }
}

/// What both kinds of trajectory carry.
macro_rules! of_either {
    ($self:ident, $r:ident => $what:expr) => {
        match $self {
            Trajectory::Whole($r) => $what,
            Trajectory::Checkpointed($r) => $what,
            Trajectory::Smoothed(marked) => {
                let $r = marked.as_ref();
                $what
            }
            Trajectory::SmoothedCheckpointed(marked) => {
                let $r = marked.as_ref();
                $what
            }
        }
    };
}

impl Trajectory {
    pub fn model(&self) -> &Arc<Model> {
        of_either!(self, r => &r.model)
    }

    pub fn theta(&self) -> &[f64] {
        of_either!(self, r => &r.theta)
    }

    pub fn states(&self) -> &[State] {
        of_either!(self, r => &r.states)
    }

    pub fn controls(&self) -> &[Vec<f64>] {
        of_either!(self, r => &r.controls)
    }

    /// What happened in each step.
    pub fn traces(&self) -> &[StepTrace] {
        of_either!(self, r => &r.traces)
    }

    /// The contact that is differentiated, if it is not the scene's.
    pub fn smoothing(&self) -> Option<Smoothing> {
        match self {
            Self::Whole(_) | Self::Checkpointed(_) => None,
            Self::Smoothed(r) => Some(r.smoothing()),
            Self::SmoothedCheckpointed(r) => Some(r.smoothing()),
        }
    }

    /// States one after another, (T + 1) × nx.
    pub fn flat(&self) -> Vec<f64> {
        self.states().iter().flat_map(State::to_flat).collect()
    }

    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> PyResult<RolloutCotangent> {
        match self {
            Self::Whole(r) => r.vjp(x_bar),
            Self::Checkpointed(r) => r.vjp(x_bar),
            Self::Smoothed(r) => r.vjp(x_bar).map(Surrogate::into_unmarked),
            Self::SmoothedCheckpointed(r) => r.vjp(x_bar).map(Surrogate::into_unmarked),
        }
        .map_err(errors::adjoint)
    }

    pub fn jvp(&self, x0_dot: Option<&[f64]>, u_dot: Option<&[Vec<f64>]>, theta_dot: Option<&[f64]>) -> PyResult<Vec<Vec<f64>>> {
        match self {
            Self::Whole(r) => r.jvp(x0_dot, u_dot, theta_dot),
            Self::Smoothed(r) => r.jvp(x0_dot, u_dot, theta_dot).map(Surrogate::into_unmarked),
            Self::Checkpointed(_) | Self::SmoothedCheckpointed(_) => return Err(self.only_checkpoints("jvp")),
        }
        .map_err(errors::adjoint)
    }

    pub fn linearize(&self, k: usize) -> PyResult<Linearization> {
        match self {
            Self::Whole(r) => r.linearize(k),
            Self::Smoothed(r) => r.linearize(k).map(Surrogate::into_unmarked),
            Self::Checkpointed(_) | Self::SmoothedCheckpointed(_) => return Err(self.only_checkpoints("linearize")),
        }
        .map_err(errors::adjoint)
    }

    /// Says how to keep all records.
    fn only_checkpoints(&self, what: &str) -> PyErr {
        errors::input(format!(
            "{what} needs the records of all {} steps, but this rollout keeps only some at a time: simulate it without \
             `max_records`",
            self.controls().len()
        ))
    }
}
