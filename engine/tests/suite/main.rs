//! The engine from outside: scene files, errors, statics, contact, invariants, convergence.
//!
//! One binary for all files of this folder: linking is done once, and tests of different files run side by side.
#![allow(clippy::unwrap_used, clippy::panic)]

mod bad_cloth;
mod bad_forces;
mod bad_motors;
mod bad_scenes;
mod bodies_contact;
mod chart;
mod cloth;
mod cloth_newton;
mod cloth_plate;
mod cogging;
mod colliders_against_parry;
mod common;
mod couplings;
mod edges_drops;
mod edges_statics;
mod friction;
mod grasp;
mod memory;
mod own_force;
mod physics;
mod quadratic_damping;
mod rims_carry;
mod rings;
mod robust_steps;
mod rods;
mod rods_memory;
mod rods_section;
mod scene_files;
mod shapes_against_parry;
mod vector;
mod warm_starts;
mod weightless;
