//! Friction of a joint proportional to its velocity: τ = −b v.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "friction proportional to velocity is missing or wrong",
        excitation: "swing at two speeds: viscous friction grows with speed, dry friction does not",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    };
    at.per_joint("damping", 0.1, &shape)
}
