//! How far a gripper turns a rod about itself as its arm goes elsewhere: so much by direction, or by place; two candidates per gripper.
//!
//! An arm that takes its gripper somewhere turns it about the rod's direction too, and where only positions are measured nobody sees that.
//! The turn is linear in the direction of the held edge (or in its place), against the smallest rotation from where the scene begins.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let one = |gripper: &str, by: &str, name, meaning, scale| Cause {
        name,
        object: Some(gripper.to_owned()),
        meaning,
        unknowns: (0..3).filter_map(|a| at.theta(&format!("{gripper}.roll_by_{by}[{a}]"), scale)).collect(),
        excitation: "measure the turn: a second marker beside the rod, on the gripper",
        ..Cause::default()
    };
    let both = |(gripper, _): (String, bool)| {
        [
            one(
                &gripper,
                "direction",
                "clamp_roll_by_direction",
                "a gripper turns the rod about itself as its direction changes",
                0.1,
            ),
            one(&gripper, "position", "clamp_roll_by_position", "a gripper turns the rod about itself as it goes elsewhere", 0.3),
        ]
    };
    at.rod_grippers().into_iter().flat_map(both).collect()
}
