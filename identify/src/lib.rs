//! Identify.

pub mod stats;
