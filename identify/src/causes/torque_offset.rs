//! A constant torque on top of what is commanded.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a motor adds a constant torque",
        excitation: "let the arm hang without command, and turn its base over: an offset stays, a tilt turns along",
        ..Cause::default()
    };
    at.per_actuator("offset", 0.1, &shape)
}
