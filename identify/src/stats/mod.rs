//! Statistics of residuals: noise models, score tests, naming, multiplicity, bootstrap. Pure functions over slices.
//!
//! The flow of a diagnosis, in five lines:
//! 1. [`ar::ArModel::fit`] on the residuals of all records, then [`ar::ArModel::whiten`] and
//!    [`ar::ArModel::whiten_columns`] on residual and Jacobian of each record;
//! 2. [`reduced::Reduced::of_record`] projects the record's own nuisance out and keeps a small triangle; merge them;
//! 3. [`score::score_test`] for every candidate; [`multiple::holm`] over its p-values;
//! 4. [`sign_flip`] where there are at least ten records;
//! 5. [`naming`]: one name, an ambiguity set, or nothing.
//!
//! Layout: a record's residual is row-major time × channel, its Jacobian row-major (time · channel) × column.

pub mod ar;
mod basis;
pub mod bootstrap;
mod clusters;
mod constants;
pub mod dist;
mod error;
pub mod multiple;
pub mod naming;
pub mod reduced;
pub mod ridge;
pub mod score;
pub mod sign_flip;
#[cfg(test)]
pub(crate) mod testing;
pub mod whiteness;

pub(crate) use constants::{MAD_TO_SIGMA, STATS};
pub use error::StatsError;
