//! Identify.

pub mod audit;
pub mod stats;
