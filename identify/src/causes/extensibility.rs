//! Stretch stiffness EA of a rope, Young's modulus of a sheet's membrane.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let unknowns = at.per_span(["stretch_stiffness", "youngs_modulus"], |_| 1.0);
    vec![Cause {
        meaning: "the rope or cloth stretches more, or less, than simulated",
        unknowns: unknowns.into_iter().map(|u| u.logarithmic()).collect(),
        excitation: "load it along itself: a heavier tip, or pulled taut",
        ..Cause::default()
    }]
}
