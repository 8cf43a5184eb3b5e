//! Viscous damping of bending: a moment proportional to the rate of curvature. It damps high modes most.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    // a typical damping: a hundredth of a second times the stiffness
    let typical = |rope: &str| 0.01 * at.value(&format!("{rope}.bend_stiffness")).max(1e-8);
    vec![Cause {
        meaning: "damping inside the material, proportional to the rate of bending, is missing or wrong",
        unknowns: at.per_rope("bend_damping", typical),
        excitation: "excite high modes: short strokes at high frequency; air drag damps slow large swings instead",
        ..Cause::default()
    }]
}
