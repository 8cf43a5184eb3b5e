//! Logs, audits, fits, tests of scores and whole diagnoses.
//!
//! One binary for all files of this folder: linking is done once, and tests of different files run side by side.
#![allow(clippy::unwrap_used, clippy::panic)]

mod audit_deform_dlo;
mod audit_synthetic;
mod cloth;
mod cloth_logs;
mod fit_report;
mod late_commands;
mod library;
mod logs;
mod long;
mod measured_data;
mod pendulum;
mod readings;
mod rod_logs;
mod score_calibration;
mod score_reduced;
mod segments;
mod starts;
mod stats_helpers;
