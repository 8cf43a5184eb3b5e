//! The engine of pliant.

pub mod geometry;
pub mod kkt;
pub mod terms;
