//! Stretch stiffness EA.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "the rope stretches more, or less, than simulated",
        unknowns: at.per_rope("stretch_stiffness", |_| 1.0).into_iter().map(|u| u.logarithmic()).collect(),
        excitation: "load the rope along itself: a heavier tip, or pulled taut",
        ..Cause::default()
    }]
}
