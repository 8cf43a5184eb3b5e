//! Dry friction that grows with the torque a gear carries: |τ| ≤ c + μ |T|, T the torque of the joint's motors and springs.
//!
//! Like dry friction it has no derivative at μ = 0 where there is no other, so it is looked at where μ is small.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "friction grows with the torque that the joint carries",
        excitation: "repeat a motion with another payload, or hold still against springs of different force and break away",
        ..Cause::default()
    };
    at.per_joint_of("load_friction", &shape, |_| 0.05)
}
