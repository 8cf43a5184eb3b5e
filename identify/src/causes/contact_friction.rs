//! Friction where something touches: |f_t| ≤ μ f_n.
//!
//! A cone of size zero has no derivative, so it is looked at where μ is small. Where two solids touch and both have a μ, the mean of
//! the two counts: no log can tell which of them is wrong.

use super::{Cause, Situation};
use crate::unknown::Probe;

/// Where friction is looked at if there is none, and where its fit begins.
const PROBED: Probe = Probe { small: 1e-3, start: 0.1 };

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "friction in a contact is missing or wrong",
        excitation: "let it slide to a stop on the level, and tilt the ground until it begins to slide",
        ..Cause::default()
    };
    let mut out = at.per_path(".friction", 0.1, &shape);
    // dry friction of joints is another law
    out.retain(|cause| cause.object.as_ref().is_some_and(|o| at.plan.model.params().find(&format!("{o}.armature")).is_none()));
    for cause in &mut out {
        cause.unknowns = std::mem::take(&mut cause.unknowns).into_iter().map(|u| u.probed(PROBED)).collect();
    }
    out
}
