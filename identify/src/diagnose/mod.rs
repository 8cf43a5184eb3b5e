//! Diagnosis: what a simulation gets wrong against measurements, and why.
//!
//! 1. audit of the data; 2. baseline refit of the declared free parameters; 3. the simulation's own error; 4. score tests of
//! every cause from one linearization; 5. refits of the significant ones, the naming rule among them; 6. forward selection
//! and removal; 7. profile intervals; 8. gain on held-out records; what remains is said.

mod audit;
mod baseline;
mod certainty;
mod gain;
mod pipeline;
mod remainder;
mod result;
mod select;
mod test;

pub use baseline::{FitReport, fit_scene};
pub use pipeline::{DiagnoseOptions, diagnose};
pub use result::*;
