//! Friction of a joint proportional to its velocity: τ = −b v. The damping of a position drive at the joint is the same force.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let alone = "friction proportional to velocity is missing or wrong";
    let driven = "friction proportional to velocity, or the damping of a position drive, is missing or wrong";
    let shape = Cause {
        meaning: if at.actuators().into_iter().any(|name| at.holds_position(name)) { driven } else { alone },
        excitation: "swing at two speeds: viscous friction grows with speed, dry friction does not",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    };
    at.per_joint("damping", 0.1, &shape)
}
