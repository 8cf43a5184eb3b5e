//! Dry friction of a joint: |τ| ≤ c, opposing its motion. Its law has no derivative at c = 0, so it is looked at where c is small.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "dry (Coulomb) friction is missing or wrong",
        excitation: "reverse slowly, and let a free swing die: it stops off centre, after a finite time",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    };
    at.per_joint("friction", 0.1, &shape)
}
