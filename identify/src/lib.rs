//! Identify.

pub mod audit;
pub mod causes;
pub mod diagnose;
pub mod error;
pub mod fit;
pub mod log;
pub mod report;
pub mod sensor;
pub mod shoot;
pub mod stats;
pub mod unknown;

pub use error::IdentifyError;
pub use diagnose::{DiagnoseOptions, Diagnosis, FitReport, Verdict, diagnose, fit_scene};
