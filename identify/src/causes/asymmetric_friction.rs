//! Dry friction that differs by direction: |τ| ≤ c₊ against positive velocities, c₋ against negative ones.
//!
//! While the friction itself is to be found too, this is *exactly* a constant torque on top of symmetric friction,
//! ```text
//! c₊ = c + d, c₋ = c − d:   τ ∈ [−c₊, c₋] = [−c, c] − d
//! ```
//! in sliding and in sticking, so that beside `torque_offset` it is never named.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "dry friction against negative velocities differs from that against positive ones",
        excitation: "turn the joint at the same slow speed both ways, then its base over: a constant torque of the motor stays",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    };
    let mut out = at.per_joint("friction_backward", 0.1, &shape);
    for cause in &mut out {
        let joint = cause.object.clone().unwrap_or_default();
        if at.value(&format!("{joint}.friction")) == 0.0 {
            cause.unknowns.clear();
            cause.untestable =
                Some("the joint has no dry friction that could differ: give it some, or accept it first".to_owned());
        }
    }
    out
}
