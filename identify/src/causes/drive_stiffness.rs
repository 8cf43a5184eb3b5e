//! The gain of a position drive: kₚ in τ = kₚ (u − q) − k_d q̇.
//!
//! Its other gain k_d acts as viscous friction of the joint does, to the last digit where no limit cuts it, and is told as that.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a position drive is stiffer or softer than simulated",
        excitation: "load the arm with a known weight while it holds still: the drive gives way by the torque over its stiffness",
        ..Cause::default()
    };
    at.per_drive_gain("stiffness", &shape)
}
