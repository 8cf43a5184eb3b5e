//! A rod that is twisted by nature: an even twist at rest.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| Cause {
        meaning: "the rod is twisted by nature where the simulation has it untwisted, or otherwise than simulated",
        unknowns: at.theta(&format!("{rod}.rest_twist"), at.typical_curvature(rod)).into_iter().collect(),
        excitation: "let one end turn freely: what is twisted by nature turns it",
        ..Cause::default()
    })
}
