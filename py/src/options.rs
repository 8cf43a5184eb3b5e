//! Options of a rollout: the keyword arguments of `rollout` and `rollout_batch`.

use crate::errors;
use pliant::{
    Along, Differentiate, Grasping, Linearization, Model, Rollout, RolloutCotangent, RolloutOptions, Smoothing, State,
    StepOptions, StepTrace, Surrogate, rollout, rollout_jacobians, rollout_jvp_columns, surrogate_rollout,
};
use pyo3::{PyErr, PyResult};
use std::sync::Arc;

/// A rollout of the scene's contact, or of a smoother one.
#[derive(Debug)]
pub enum Trajectory {
    /// Of the scene's own.
    Exact(Rollout),
    /// Of a smoother one.
    Smoothed(Surrogate<Rollout>),
}

/// Options of a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Keep {
    /// Of the rollout.
    pub options: RolloutOptions,
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
        let step = StepOptions { record, ..StepOptions::default() };
        Ok(Self { options: RolloutOptions { step, max_records }, smoothing })
    }

    /// Simulates.
    pub fn run(self, model: &Arc<Model>, theta: &[f64], x0: &[f64], u: &[Vec<f64>]) -> Result<Trajectory, PyErr> {
        let x0 = State::from_flat(x0, model.nq(), model.nv());
        match self.smoothing {
            None => rollout(model, theta, &x0, u, self.options).map(Trajectory::Exact).map_err(errors::step),
            Some(smoothing) => {
                let surrogate = surrogate_rollout(model, theta, &x0, u, self.options, smoothing);
                surrogate.map(Trajectory::Smoothed).map_err(errors::adjoint)
            }
        }
    }
}

impl Trajectory {
    fn rollout(&self) -> &Rollout {
        match self {
            Self::Exact(r) => r,
            Self::Smoothed(r) => r.as_ref(),
        }
    }

    pub fn model(&self) -> &Arc<Model> {
        &self.rollout().model
    }

    pub fn theta(&self) -> &[f64] {
        &self.rollout().theta
    }

    pub fn states(&self) -> &[State] {
        &self.rollout().states
    }

    pub fn controls(&self) -> &[Vec<f64>] {
        &self.rollout().controls
    }

    /// Iterations and halvings of each step.
    pub fn traces(&self) -> &[StepTrace] {
        &self.rollout().traces
    }

    /// The smoothing of the steps that are differentiated, of a surrogate.
    pub fn smoothing(&self) -> Option<Smoothing> {
        match self {
            Self::Exact(_) => None,
            Self::Smoothed(r) => Some(r.smoothing()),
        }
    }

    /// States one after another, (T + 1) × nx.
    pub fn flat(&self) -> Vec<f64> {
        self.states().iter().flat_map(State::to_flat).collect()
    }

    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> PyResult<RolloutCotangent> {
        match self {
            Self::Exact(r) => r.vjp(x_bar),
            Self::Smoothed(r) => r.vjp(x_bar).map(Surrogate::into_unmarked),
        }
        .map_err(errors::adjoint)
    }

    pub fn jvp(&self, x0_dot: Option<&[f64]>, u_dot: Option<&[Vec<f64>]>, theta_dot: Option<&[f64]>) -> PyResult<Vec<Vec<f64>>> {
        match self {
            Self::Exact(r) => r.jvp(x0_dot, u_dot, theta_dot),
            Self::Smoothed(r) => r.jvp(x0_dot, u_dot, theta_dot).map(Surrogate::into_unmarked),
        }
        .map_err(errors::adjoint)
    }

    /// A, B and C of all steps; a smoothed rollout's mark stays with the class that Python sees.
    pub fn jacobians(&self, a: &mut [f64], b: &mut [f64], c: Option<&mut [f64]>) -> PyResult<()> {
        rollout_jacobians(self.rollout(), a, b, c).map_err(errors::adjoint)
    }

    pub fn jvp_columns(
        &self,
        columns: usize,
        x0_dot: Option<&[f64]>,
        u_dot: Option<&[Vec<f64>]>,
        theta_dot: Option<&[f64]>,
    ) -> PyResult<Vec<Vec<f64>>> {
        rollout_jvp_columns(self.rollout(), columns, x0_dot, u_dot, theta_dot).map_err(errors::adjoint)
    }

    pub fn linearize(&self, k: usize) -> PyResult<Linearization> {
        match self {
            Self::Exact(r) => r.linearize(k),
            Self::Smoothed(r) => r.linearize(k).map(Surrogate::into_unmarked),
        }
        .map_err(errors::adjoint)
    }
}
