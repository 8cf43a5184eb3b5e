//! A rod that is curved by nature: a curvature at rest towards its two material axes, the same all along.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| Cause {
        name: "intrinsic_curvature",
        meaning: "the rod is curved by nature where the simulation has it straight, or otherwise than simulated",
        unknowns: (0..2).filter_map(|a| at.theta(&format!("{rod}.rest_curvature[{a}]"), at.typical_curvature(rod))).collect(),
        excitation: "turn both ends about the rod's own direction by the same angle: what is curved by nature turns along",
        ..Cause::default()
    })
}
