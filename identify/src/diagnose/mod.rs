//! Diagnosis: the errors of a simulation against measurements, and their causes.
//!
//! In order: audit of the data; baseline refit of the declared free parameters by least squares; the procedure, which accepts one cause after
//! the other (`procedure`); the simulation's own error in the units of what was found (`numerics`); intervals; what is left; gain on
//! held-out records; the verdict. The numbers that decide stand in `policy.rs`.

mod audit;
mod baseline;
mod beside;
mod ceiling;
mod certainty;
mod constancy;
mod forms;
mod gain;
mod listing;
mod next;
mod numerics;
mod pipeline;
mod policy;
mod procedure;
mod reason;
mod remainder;
mod result;
mod scores;
mod story;
mod verdict;

#[cfg(test)]
pub(crate) use audit::starts::tests as testing;

pub use baseline::{FitReport, fit_scene};
pub use next::{NextExperiment, ToldPair};
pub use pipeline::{DiagnoseOptions, diagnose, diagnose_kept};
pub use result::*;
pub use scores::{Scores, score_scene};
