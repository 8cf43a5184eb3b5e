//! The command, plans and closed loops by it, the page that shows a run, and the rules for the sources of all crates.
//!
//! One binary for all files of this folder: linking is done once, and tests of different files run side by side.
#![allow(clippy::unwrap_used, clippy::panic)]

mod command;
mod house;
mod init;
mod plan;
mod view;
