//! A rod that is curved by nature, otherwise from place to place: kinks, the memory of a coil, a cable that was laid badly.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let paths = at.joints_of(rod, "rest_curvature[0]").into_iter().chain(at.joints_of(rod, "rest_curvature[1]"));
        Cause {
            name: "uneven_curvature",
            meaning: "the rod is curved by nature, in another way from place to place (kinks, the memory of a coil)",
            unknowns: paths.filter_map(|path| at.theta(&path, at.typical_curvature(rod))).collect(),
            excitation: "turn both ends about the rod's own direction by the same angle, with the rod slack and with it stretched",
            ..Cause::default()
        }
    })
}
