//! Gradients of a smoother contact or grasp than the one simulated, marked as such in their type.
//!
//! Hard contact gives no gradient before it is made, and a useless one through an impact. At a rest gap δ_b larger than the
//! scene's the force κ/gap reaches further (`pliant_smoothing::reach`), and so does its derivative. Two ways to take it:
//!
//! | [`Along`] | states | derivative of |
//! |---|---|---|
//! | `Hard` | the scene's own contact | each step at δ_b, taken from the hard state x_k: A_k, B_k, C_k and their products |
//! | `Smooth` | a rollout at δ_b | that rollout: differences confirm it |
//!
//! A grasp is as blind out of reach ([`pliant_engine::grasp`]); with [`Grasping::Smooth`] the steps that are differentiated have the
//! smoothed activation of θ (`name.smoothing`, `tail`, `tail_reach`), at the scene's rest gap or another.
//!
//! Along the hard trajectory the products belong to *no* function: good for planning, where each step is corrected anyway, and
//! not to be compared with differences beyond one step. A [`Surrogate`] says in its type that it is no derivative of the scene.

use crate::AdjointError;
use crate::checkpoint::{CheckpointedRollout, checkpointed};
use crate::linearize::{Linearization, linearize};
use crate::rollout::{RolloutCotangent, rollout_jvp, rollout_vjp};
use pliant_engine::grasp::Grasping;
use pliant_engine::model::Model;
use pliant_engine::rollout::{Rollout, rollout_by};
use pliant_engine::state::State;
use pliant_engine::step::{StepError, StepOptions, StepRecord, StepTrace, Stepper};
use std::sync::Arc;

/// Through which states the smoother steps are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// The states of the scene's own contact: the forward simulation stays as it is.
    Hard,
    /// The states of the smoother contact itself.
    Smooth,
}

/// How derivatives are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Rest gap δ_b \[m\] of the steps that are differentiated; κ_b = δ_b m g. Positive; usually larger than the scene's.
    pub rest_gap: f64,
    /// Grasp of the steps that are differentiated.
    pub grasp: Grasping,
    /// Through which states.
    pub along: Along,
}

/// Something made with a contact or a grasp that is not the scene's.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct Surrogate<T> {
    value: T,
    smoothing: Smoothing,
}

impl<T> Surrogate<T> {
    /// The smoothing it was made with.
    pub fn smoothing(&self) -> Smoothing {
        self.smoothing
    }

    /// Takes the mark off: from here on only the caller knows.
    pub fn into_unmarked(self) -> T {
        self.value
    }

    fn with<U>(&self, value: U) -> Surrogate<U> {
        Surrogate { value, smoothing: self.smoothing }
    }
}

impl<T> AsRef<T> for Surrogate<T> {
    fn as_ref(&self) -> &T {
        &self.value
    }
}

/// Rolls out, recording steps of another rest gap or grasp. States and traces are those of `smoothing.along`.
///
/// # Errors
/// A rest gap that is not positive; a hard or a smoothed step that fails, with its number.
pub fn surrogate_rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: StepOptions,
    smoothing: Smoothing,
) -> Result<Surrogate<Rollout>, AdjointError> {
    let mut chain = Chain::new(model, theta, options, Some(smoothing))?;
    let value = rollout_by(model, theta, x0, controls, |state, u| chain.step(state, u))?;
    Ok(Surrogate { value, smoothing })
}

/// As [`surrogate_rollout`], keeping records of at most `max_records` steps at a time.
///
/// # Errors
/// As [`surrogate_rollout`].
pub fn surrogate_checkpointed_rollout(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: StepOptions,
    smoothing: Smoothing,
    max_records: usize,
) -> Result<Surrogate<CheckpointedRollout>, AdjointError> {
    let value = checkpointed(model, theta, x0, controls, options, Some(smoothing), max_records)?;
    Ok(Surrogate { value, smoothing })
}

impl Surrogate<Rollout> {
    /// As [`rollout_jvp`], of the smoothed steps.
    ///
    /// # Errors
    /// A rollout without records, or arguments of another size.
    pub fn jvp(
        &self,
        x0_dot: Option<&[f64]>,
        u_dot: Option<&[Vec<f64>]>,
        theta_dot: Option<&[f64]>,
    ) -> Result<Surrogate<Vec<Vec<f64>>>, AdjointError> {
        Ok(self.with(rollout_jvp(&self.value, x0_dot, u_dot, theta_dot)?))
    }

    /// As [`rollout_vjp`], of the smoothed steps.
    ///
    /// # Errors
    /// A rollout without records, or arguments of another size.
    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<Surrogate<RolloutCotangent>, AdjointError> {
        Ok(self.with(rollout_vjp(&self.value, x_bar)?))
    }

    /// A, B and C of the smoothed step from x_k.
    ///
    /// # Errors
    /// A rollout without a record of that step.
    pub fn linearize(&self, k: usize) -> Result<Surrogate<Linearization>, AdjointError> {
        let record = self.value.records.get(k).ok_or(AdjointError::NoRecords)?;
        Ok(self.with(linearize(&self.value.model, &self.value.theta, record, true)))
    }
}

impl Surrogate<CheckpointedRollout> {
    /// As [`CheckpointedRollout::vjp`], of the smoothed steps.
    ///
    /// # Errors
    /// Arguments of another size.
    pub fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<Surrogate<RolloutCotangent>, AdjointError> {
        Ok(self.with(self.value.vjp(x_bar)?))
    }
}

/// Advances a state, and records what is to be differentiated: that step, or one of smoother contact from the same state.
///
/// The smoother steps have a warm start of their own, so each chain solves what it would solve alone.
pub(crate) struct Chain<'m> {
    forward: Stepper<'m>,
    smooth: Option<Stepper<'m>>,
}

/// Warm starts of a chain: part of a checkpoint.
pub(crate) type Warm = [Option<pliant_engine::step::Warm>; 2];

impl<'m> Chain<'m> {
    pub fn new(
        model: &'m Model,
        theta: &'m [f64],
        options: StepOptions,
        smoothing: Option<Smoothing>,
    ) -> Result<Self, StepError> {
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

    pub fn step(&mut self, state: &mut State, u: &[f64]) -> Result<(StepTrace, Option<StepRecord>), StepError> {
        let Some(smooth) = &mut self.smooth else { return self.forward.step(state, u) };
        let (of_smooth, record) = smooth.step(&mut state.clone(), u)?;
        let (mut trace, _) = self.forward.step(state, u)?;
        trace.work.add(of_smooth.work);
        trace.retries += of_smooth.retries;
        Ok((trace, record))
    }

    pub fn warm(&self) -> Warm {
        [self.forward.warm_start().cloned(), self.smooth.as_ref().and_then(|s| s.warm_start().cloned())]
    }

    pub fn set_warm(&mut self, [forward, smooth]: &Warm) {
        self.forward.set_warm_start(forward.clone());
        if let Some(stepper) = &mut self.smooth {
            stepper.set_warm_start(smooth.clone());
        }
    }
}
