//! Parameters from data, and the physical effects that a scene lacks to explain them.
//!
//! **The problem.** Measured marker positions y_k \[m\] are a sensor's map of simulated states plus coloured noise:
//! ```text
//! y_k = S(x(t_k; x₀, u, θ); σ) + ε_k,      ε_k = Σ_j φ_j ε_{k−j} + white noise
//! ```
//! σ are the sensor's own unknowns (bias, scale, rotation, time offset), φ_j the noise model's coefficients. A *cause* is a set
//! of entries of (θ, σ) that the scene holds fixed. Which of them must be freed for the residual to be noise, and to what
//! values?
//!
//! **The flow.**
//! 1. logs are read by the mapping of the experiment ([`log`]) and audited for faults that no physics explains ([`audit`]);
//! 2. the declared free parameters are fitted on the fitted records by shooting with exact gradients ([`shooting`], [`fit`]);
//! 3. every cause of the library ([`causes`]) is tested without a refit, by its score with the fitted unknowns projected out ([`stats`]);
//! 4. the best are refitted, accepted or rejected one by one, held against their rivals, and given intervals ([`mod@diagnose`]);
//! 5. records that were held out tell the gain, and the remainder whether something outside the library is left.
//!
//! A verdict names causes, calls them ambiguous, says that the library does not hold them, finds the scene adequate, or is
//! withheld. Nothing here knows a force: everything comes through rollouts and their derivatives.

pub mod audit;
pub mod causes;
pub mod diagnose;
pub mod error;
pub mod fit;
pub mod form;
pub mod journal;
pub mod log;
mod number;
#[cfg(feature = "report")]
pub mod report;
pub mod sensor;
pub mod shooting;
pub mod stats;
pub mod unknown;

pub use diagnose::{DiagnoseOptions, Diagnosis, FitReport, Verdict, diagnose, diagnose_kept, fit_scene};
pub use error::IdentifyError;
