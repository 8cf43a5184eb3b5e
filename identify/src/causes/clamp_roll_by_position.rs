//! A roll of a gripper that is linear in its place; see `clamp_roll_by_direction`.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod_gripper("roll_by_position", 0.3, "a gripper turns the rod about itself as it goes elsewhere")
}
