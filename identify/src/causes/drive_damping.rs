//! The gain of a velocity drive: k_d in τ = k_d (u − q̇).

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a velocity drive is stronger or weaker than simulated",
        excitation: "load the arm with a known weight while a speed is commanded: the speed errs by the torque over the gain",
        ..Cause::default()
    };
    let mut out = at.per_drive_gain("damping", &shape);
    out.retain(|cause| !cause.object.as_deref().is_some_and(|name| at.holds_position(name)));
    out
}
