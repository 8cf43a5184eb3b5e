//! Why there is no observer.

use crate::tube::TubeError;

/// Why there is no observer.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ObserverError {
    /// Sizes, numbers and order, as of tubes.
    #[error(transparent)]
    Tube(#[from] TubeError),
    /// F Fᵀ + C Σ Cᵀ is singular: a measurement without noise of something already known.
    #[error("measurement {measurement} repeats what is known: its innovation has no variance in component {component}")]
    Innovation {
        /// Number s = 1 … N of the measurement.
        measurement: usize,
        /// The component of y at which the factorization stopped.
        component: usize,
    },
    /// A measurement was missing or came too early.
    #[error("stage {stage}: a measurement must come with every stage from {first} on, and with none before")]
    Arrival {
        /// Stage k.
        stage: usize,
        /// First stage with a measurement: the delay d.
        first: usize,
    },
    /// Delays are one step or more.
    #[error("a delay of 0 steps: the input of a stage cannot depend on that stage's measurement")]
    NoDelay,
}
