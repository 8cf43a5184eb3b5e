//! A stiffening or softening spring at a joint: τ = −k₃ (q − q₀)³.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a spring whose stiffness depends on its deflection is missing or wrong",
        excitation: "swing at two amplitudes: the frequency depends on them",
        variable: Some(Variable::Position),
        ..Cause::default()
    };
    at.per_joint("cubic_stiffness", 1.0, &shape)
}
