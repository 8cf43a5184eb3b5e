//! Stretch stiffness EA.

use super::{Cause, Situation};

pub(super) fn cause(at: &Situation) -> Cause {
    Cause {
        name: "extensibility",
        object: None,
        meaning: "the rope stretches more, or less, than simulated",
        unknowns: at.per_rope("stretch_stiffness", |_| 1.0).into_iter().map(|u| u.logarithmic()).collect(),
        untestable: None,
        excitation: "load the rope along itself: a heavier tip, or pulled taut",
        ..Cause::default()
    }
}
