//! Viscosity of a sheet in its own plane: a stress η Ġ against the rate of strain. It damps what stretches and shears, and no bending.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    // a typical viscosity: a hundredth of a second times the stiffness
    let typical = |sheet: &str| 0.01 * at.value(&format!("{sheet}.youngs_modulus")).max(1e-8);
    vec![Cause {
        meaning: "damping inside the cloth, proportional to the rate at which it stretches and shears, is missing or wrong",
        unknowns: at.per_sheet("membrane_damping", typical),
        excitation: "jerk it along its own plane, taut, and see how fast it comes to rest; ripples do not show it",
        ..Cause::default()
    }]
}
