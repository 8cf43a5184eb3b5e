//! A roll of a gripper that is linear in its place; see `clamp_roll_by_direction`. An arm turns its gripper by no more than about a turn a metre.

use super::{Cause, Situation};
use std::f64::consts::TAU;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod_gripper("roll_by_position", 0.3, TAU, "a gripper turns the rod about itself as it goes elsewhere")
}
