//! A rod that is curved by nature: a curvature at rest towards its two material axes, the same all along.
//!
//! How a clamp is turned about a straight, round rod shows only by the twist it brings in; once the rod is curved it decides where its
//! loops go, together with how stiff the rod is in twist. Of a real cable nobody measures either, so a search frees them beside it.

use super::{Cause, Situation};
use crate::unknown::{Target, matches};
use std::f64::consts::FRAC_PI_3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let (bending, companions) = (at.value(&format!("{rod}.bend_stiffness")), at.unmeasured_of(rod));
        let entry = |u: &crate::unknown::Unknown| if let Target::Theta(entries) = &u.target { entries[0] } else { 0 };
        // as stiff in twist as it is now, or as a round rod of rubber is: with less a curved rod just rolls over
        let turned = |angle: f64| {
            let start = |u: &crate::unknown::Unknown| match u.path.ends_with(".roll") {
                true => (entry(u), at.values.theta[entry(u)] + angle),
                false => (entry(u), bending),
            };
            companions.iter().map(start).collect()
        };
        let starts: Vec<_> = std::iter::once(Vec::new()).chain([0.0, 2.0 * FRAC_PI_3, -2.0 * FRAC_PI_3].map(turned)).collect();
        // a rod whose joints are all curved on their own has no further even part
        let all = at.joints_of(rod, "rest_curvature[0]").iter().all(|path| at.free.iter().any(|free| matches(&free.path, path)));
        let paths = if all { 0..0 } else { 0..2 };
        Cause {
            meaning: "the rod is curved by nature where the simulation has it straight, or otherwise than simulated",
            unknowns: paths.filter_map(|a| at.theta(&format!("{rod}.rest_curvature[{a}]"), at.typical_curvature(rod))).collect(),
            excitation: "turn both ends about the rod's own direction by the same angle: what is curved by nature turns along",
            companions,
            starts,
            ..Cause::default()
        }
    })
}
