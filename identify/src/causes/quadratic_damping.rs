//! Damping of a joint that grows with the square of its speed: τ = −k |v| v.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "damping that grows with the square of the speed (air, fluid) is missing or wrong",
        excitation: "let it swing free from large and small angles: the ratio of successive swings tells damping by the square \
                     from viscous",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    };
    at.per_joint("quadratic_damping", 0.1, &shape)
}
