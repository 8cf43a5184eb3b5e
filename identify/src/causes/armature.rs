//! The inertia of a rotor seen at the joint.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        name: "armature",
        meaning: "the rotor's inertia is missing or wrong",
        excitation: "accelerate fast by a known torque; with several joints, in several poses: a rotor stays, the links move",
        ..Cause::default()
    };
    at.per_joint("armature", 0.1, &shape)
}
