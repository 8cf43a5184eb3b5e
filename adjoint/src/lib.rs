//! Derivatives of steps, rollouts and equilibria.
//!
//! A step solved r(y; x, u, θ) = 0 and kept the factorization of K = ∂r/∂y at the root. Then
//! ```text
//! jvp: ẏ = −K⁻¹ (∂r/∂p) ṗ        vjp: λ = −K⁻ᵀ ȳ,  p̄ += (∂r/∂p)ᵀ λ        p = (q, v, u, θ)
//! ```
//! and everything else is the chain rule over stages, steps and time. Nothing is factored going backwards.

mod chain;
mod checkpoint;
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

pub use chain::{Along, Smoothing};
pub use checkpoint::{CheckpointedRollout, checkpointed_rollout};
pub use equilibrium::{equilibrium_tangent, equilibrium_vjp};
pub use linearization::Linearization;
pub use linearize::{Linearizer, linearize};
pub use rollout::{RolloutCotangent, rollout_jvp, rollout_vjp};
pub use seeds::Seeds;
pub use step::{Cotangent, Tangent};
pub use surrogate::{Surrogate, surrogate_checkpointed_rollout, surrogate_rollout};
pub use tangent::TangentStepper;

/// Why a derivative could not be taken.
#[derive(Clone, Debug, thiserror::Error)]
pub enum AdjointError {
    /// The rollout was simulated without records.
    #[error("this rollout kept no records: simulate it with `record: true` to differentiate it")]
    NoRecords,
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
