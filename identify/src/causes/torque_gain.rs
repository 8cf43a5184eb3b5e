//! The torque that a motor makes per unit of its command.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a motor makes more or less torque than its command says",
        excitation: "hang a known mass on the arm: gain and all inertias, weights and frictions scale together without one",
        ..Cause::default()
    };
    at.per_actuator("gain", 0.1, &shape)
}
