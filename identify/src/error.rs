//! Why a fit or a diagnosis failed.

use crate::log::LogError;
use pliant_engine::model::BuildError;
use pliant_engine::step::StepError;

/// Why a fit or a diagnosis failed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The scene, the logs or the request are wrong.
    #[error("{0}")]
    Input(String),
    /// The experiment or its logs are wrong; with the place.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The scene cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A record cannot be simulated.
    #[error("record `{record}`: {source}")]
    Simulation {
        /// Record.
        record: String,
        /// The engine's message.
        source: StepError,
    },
    /// A free parameter influences nothing that was measured.
    #[error(
        "parameter `{path}` influences nothing that was measured: take it out of `experiment.fit.free`, or measure something that depends on it"
    )]
    DeadParameter {
        /// Path.
        path: String,
    },
    /// A statistic could not be computed.
    #[error("statistics: {0}")]
    Stats(#[from] crate::stats::StatsError),
    /// The fit did not converge.
    #[error(
        "the fit did not converge after {iterations} iterations: last relative gain {gain:.2e}; try other starting values or narrower bounds"
    )]
    NotConverged {
        /// Iterations.
        iterations: usize,
        /// Relative decrease of the last accepted step.
        gain: f64,
    },
}

impl IdentifyError {
    /// Whether the input is at fault (exit code 2) rather than the numerics (exit code 1).
    pub fn is_input(&self) -> bool {
        matches!(
            self,
            Self::Input(_)
                | Self::Log(_)
                | Self::Build(_)
                | Self::DeadParameter { .. }
                | Self::Simulation { source: StepError::Command { .. }, .. }
        )
    }
}
