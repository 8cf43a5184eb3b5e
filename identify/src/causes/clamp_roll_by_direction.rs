//! A roll of a gripper that is linear in the direction of the held edge.
//!
//! An arm that takes its gripper somewhere turns it about the rod's direction too, and where only positions are measured nobody sees that.
//! The roll is counted from the smallest rotation from where the scene begins.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod_gripper("roll_by_direction", 0.1, "a gripper turns the rod about itself as its direction changes")
}
