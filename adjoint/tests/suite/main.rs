//! Derivatives of steps, rollouts and equilibria, judged by differences, by dot tests and by each other.
//!
//! One binary for all files of this folder: linking is done once, and tests of different files run side by side.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../../../engine/tests/suite/common/mod.rs"]
mod common;
mod forces;
mod friction_at_zero;
mod inverse;
mod judged;
mod long;
mod retries;
mod surrogate;
mod vector;
