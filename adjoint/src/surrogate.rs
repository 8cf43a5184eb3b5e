//! Gradients of a smoother contact or grasp than the one simulated, marked as such in their type.
//!
//! Hard contact gives no gradient before it is made, and a useless one through an impact. At a rest gap δ_b larger than the
//! scene's the force κ/gap reaches further (`pliant_smoothing::reach`), and so does its derivative. Two ways to take it:
//!
//! | [`Along`](crate::Along) | states | derivative of |
//! |---|---|---|
//! | `Hard` | the scene's own contact | each step at δ_b, taken from the hard state x_k: A_k, B_k, C_k and their products |
//! | `Smooth` | a rollout at δ_b | that rollout: differences confirm it |
//!
//! A grasp is as blind out of reach ([`pliant_engine::grasp`]); with [`Grasping::Smooth`](pliant_engine::grasp::Grasping::Smooth) the steps that are differentiated have the
//! smoothed activation of θ (`name.smoothing`, `tail`, `tail_reach`), at the scene's rest gap or another.
//!
//! Along the hard trajectory the products belong to *no* function: good for planning, where each step is corrected anyway, and
//! not to be compared with differences beyond one step. A [`Surrogate`] says in its type that it is no derivative of the scene.

use crate::AdjointError;
use crate::linearization::Linearization;
use crate::rollout::{RolloutCotangent, rollout_jvp, rollout_linearize, rollout_vjp};
use pliant_engine::model::Model;
use pliant_engine::rollout::{Rollout, RolloutOptions, Smoothing, smoothed_rollout};
use pliant_math::State;
use std::sync::Arc;

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
    options: impl Into<RolloutOptions>,
    smoothing: Smoothing,
) -> Result<Surrogate<Rollout>, AdjointError> {
    let value = smoothed_rollout(model, theta, x0, controls, options.into(), Some(smoothing))?;
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
        Ok(self.with(rollout_linearize(&self.value, k)?))
    }
}
