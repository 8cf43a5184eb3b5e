//! A linear spring at a joint: τ = −k (q − q₀).

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a linear spring (a cable, a transmission, a gas spring) is missing or wrong",
        excitation: "hold the joint at several places; the holding torque grows in proportion",
        variable: Some(Variable::Position),
        ..Cause::default()
    };
    at.per_joint("stiffness", 1.0, &shape)
}
