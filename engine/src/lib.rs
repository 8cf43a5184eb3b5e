//! The engine of pliant.

pub mod kkt;
pub mod terms;
