//! Viscous damping of bending: a moment proportional to the rate of curvature. It damps high modes most.

use super::{Cause, Situation};
use crate::form::Variable;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "damping inside the material, proportional to the rate of bending, is missing or wrong",
        unknowns: at.per_span(["bend_damping", "bend_damping"], |span| at.typical_damping(span)),
        excitation: "excite high modes: short strokes at high frequency; air drag damps slow large swings instead",
        variable: Some(Variable::Velocity),
        ..Cause::default()
    }]
}
