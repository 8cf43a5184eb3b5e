//! A roll of a gripper that is linear in the direction of the held edge.
//!
//! An arm that takes its gripper somewhere turns it about the rod's direction too, and where only positions are measured nobody sees that.
//! The roll is counted from the smallest rotation from where the scene begins. An arm turns its gripper by no more than about a turn while its
//! direction changes by one; what asks for more, as a gust along an edge that hardly turns, is something else.

use super::{Cause, Situation};
use std::f64::consts::TAU;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod_gripper("roll_by_direction", 0.1, TAU, "a gripper turns the rod about itself as its direction changes")
}
