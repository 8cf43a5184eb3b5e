//! Whole diagnoses of some minutes, run by `cargo test --release --workspace --test diagnoses` alone; the suite tests the same causes by
//! their scores.
#![allow(clippy::unwrap_used, clippy::panic)]

mod diagnose_pendulum;
mod diagnose_rod;
mod diagnose_together;
#[path = "../../identify/tests/suite/pendulum/mod.rs"]
mod pendulum;
#[path = "../../identify/tests/suite/rod_logs/mod.rs"]
mod rod_logs;
