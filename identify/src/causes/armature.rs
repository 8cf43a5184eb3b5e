//! The inertia of a rotor seen at the joint.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "the rotor's inertia is missing or wrong",
        excitation: "accelerate fast by a known torque; with several joints, in several poses: a rotor stays, the links move",
        ..Cause::default()
    };
    // a free body has no rotor; what the scene calls so there would be a second mass without weight
    let damped = |joint: &str| at.plan.model.params().find(&format!("{joint}.damping")).is_some();
    at.per_joint("armature", 0.1, &shape).into_iter().filter(|c| c.object.as_deref().is_some_and(damped)).collect()
}
