//! Derivatives as methods of a rollout.

use crate::{AdjointError, Linearization, Rollout, RolloutCotangent};

/// Derivatives of a recorded rollout.
pub trait Differentiate {
    /// Tangents of x₀ … x_T along `x0_dot` (2 nv + nz), `u_dot` (T rows) and `theta_dot`; `None` is zero.
    ///
    /// # Errors
    /// A rollout without records or with checkpoints, or arguments of another size.
    fn jvp(
        &self,
        x0_dot: Option<&[f64]>,
        u_dot: Option<&[Vec<f64>]>,
        theta_dot: Option<&[f64]>,
    ) -> Result<Vec<Vec<f64>>, AdjointError>;

    /// Pulls cotangents `x_bar` of x₀ … x_T (T + 1 rows of 2 nv + nz) back to x₀, u and θ.
    ///
    /// # Errors
    /// A rollout without records, or arguments of another size.
    fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<RolloutCotangent, AdjointError>;

    /// A, B and C of step `k`: row-major, x = (q, v, z).
    ///
    /// # Errors
    /// A rollout without a record of that step.
    fn linearize(&self, k: usize) -> Result<Linearization, AdjointError>;
}

impl Differentiate for Rollout {
    fn jvp(
        &self,
        x0_dot: Option<&[f64]>,
        u_dot: Option<&[Vec<f64>]>,
        theta_dot: Option<&[f64]>,
    ) -> Result<Vec<Vec<f64>>, AdjointError> {
        pliant_adjoint::rollout_jvp(self, x0_dot, u_dot, theta_dot)
    }

    fn vjp(&self, x_bar: &[Vec<f64>]) -> Result<RolloutCotangent, AdjointError> {
        pliant_adjoint::rollout_vjp(self, x_bar)
    }

    fn linearize(&self, k: usize) -> Result<Linearization, AdjointError> {
        pliant_adjoint::rollout_linearize(self, k)
    }
}
