//! Diagnosis: the errors of a simulation against measurements, and their causes.
//!
//! In order: audit of the data; baseline refit of the declared free parameters; the simulation's own error; score tests of
//! every cause from one linearization; refits of the significant ones, the naming rule among them; forward selection and
//! removal; profile intervals; gain on held-out records; the remainder. Where the residual is no noise and records are many,
//! causes are sought that carry over to other records together, instead of tested against a noise model (`search`).

mod audit;
mod baseline;
mod ceiling;
mod certainty;
mod coloured_noise;
mod constancy;
mod constants;
mod gain;
mod listing;
mod numerics;
mod pipeline;
mod reason;
mod remainder;
mod result;
mod scores;
mod search;
mod select;
mod selection;
mod story;
mod verdict;

pub use baseline::{FitReport, fit_scene};
pub use pipeline::{DiagnoseOptions, diagnose};
pub use result::*;
pub use scores::{Scores, score_scene};
