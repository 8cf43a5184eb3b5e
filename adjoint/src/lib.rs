//! Derivatives of steps, rollouts and equilibria.
//!
//! A step solved r(y; x, u, θ) = 0 and kept the factorization of K = ∂r/∂y at the root. Then
//! ```text
//! jvp: ẏ = −K⁻¹ (∂r/∂p) ṗ        vjp: λ = −K⁻ᵀ ȳ,  p̄ += (∂r/∂p)ᵀ λ        p = (q, v, u, θ)
//! ```
//! and everything else is the chain rule over stages, steps and time. Nothing is factored going backwards.

mod constants;
mod equilibrium;
pub mod gradcheck;
mod implicit;
mod inverse;
mod linearization;
mod linearize;
mod rollout;
mod seeds;
mod stage;
mod step;
mod surrogate;
mod tangent;

pub use equilibrium::{equilibrium_jvp, equilibrium_jvp_columns, equilibrium_vjp};
pub use linearization::Linearization;
pub use linearize::{Linearizer, linearize};
pub use pliant_engine::rollout::{Along, Smoothing};
pub use rollout::{RolloutCotangent, rollout_jacobians, rollout_jvp, rollout_jvp_columns, rollout_linearize, rollout_vjp};
pub use seeds::Seeds;
pub use step::{Cotangent, Tangent};
pub use surrogate::{Surrogate, surrogate_rollout};
pub use tangent::TangentStepper;

/// Why a derivative could not be taken.
#[derive(Clone, Debug, thiserror::Error)]
pub enum AdjointError {
    /// The rollout was simulated without records.
    #[error("this rollout kept no records: simulate it with `record: true` to differentiate it")]
    NoRecords,
    /// A jvp or the Jacobians of a step are asked of a rollout that keeps checkpoints.
    #[error("this rollout keeps checkpoints instead of records, for a vjp: simulate it without `max_records`")]
    Checkpointed,
    /// An argument has the wrong size.
    #[error("{what} has {got} entries, but {expected} are needed")]
    Size {
        /// Which argument.
        what: &'static str,
        /// Its size.
        got: usize,
        /// The right size.
        expected: usize,
    },
    /// A step failed while being recomputed.
    #[error(transparent)]
    Step(#[from] pliant_engine::step::StepError),
}
