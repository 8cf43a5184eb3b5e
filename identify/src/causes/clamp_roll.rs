//! How far a gripper has turned a rod about itself: a constant angle; a candidate per gripper.
//!
//! Turning all grippers of a rod by the same angle turns the rod's section, which its own curvature says already: the first one counts
//! as not turned.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let later = at.rod_grippers().into_iter().filter(|(_, first)| !first);
    later
        .map(|(gripper, _)| Cause {
            meaning: "a gripper holds the rod turned about its own direction against the other end, by an angle nobody measured",
            unknowns: at.theta(&format!("{gripper}.roll"), 0.1).into_iter().collect(),
            object: Some(gripper),
            excitation: "turn this gripper about the rod's own direction by a known angle",
            ..Cause::default()
        })
        .collect()
}
