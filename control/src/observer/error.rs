//! Why there is no observer.

use crate::tube::TubeError;

/// Why there is no observer.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ObserverError {
    /// Sizes, numbers and order, as of tubes.
    #[error(transparent)]
    Tube(#[from] TubeError),
    /// A measurement was missing or came too early.
    #[error("stage {stage}: a measurement must come with every stage from {first} on, and with none before")]
    Arrival {
        /// Stage k.
        stage: usize,
        /// First stage with a measurement: the delay d.
        first: usize,
    },
}
