//! Where a plane really is along its normal. Nothing moves with it unless something touches it.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a plane is higher or lower than the scene says",
        excitation: "let something rest on it, and let it fall from a known height",
        ..Cause::default()
    };
    at.per_path(".height", 1e-3, &shape)
}
