//! The mass of a sheet of cloth: wet, coated, or of another weave than the scene says.
//!
//! A motion shows mass only beside the stiffness, drag and damping of the same sheet, which all act less on a heavier one.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "the cloth is heavier or lighter than simulated",
        unknowns: at.per_sheet("area_density", |_| 1.0),
        excitation: "weigh it",
        ..Cause::default()
    }]
}
