//! A rod that stays bent: beyond a yield curvature its bending flows, x its elastic part, ẋ = k̇ − max(|x| − κ_y l, 0)/τ x/|x|.
//!
//! No flow is τ = ∞, so the fit's coordinate is 1/τ ≥ 0, in which the derivative at no flow exists. Without flow nothing determines the
//! yield: it is looked at for parts of the largest curvature that a record begins with, the best one counts, at a price.

use super::{Cause, Situation};
use crate::shooting::SHOOTING;
use crate::unknown::Unknown;

/// Yield over the largest curvature.
const GRID: [f64; 3] = [0.05, 0.3, 0.6];
/// Shortest time of the flow \[s\]: a shorter one is plasticity without a rate for motions by hand.
const SHORTEST: f64 = 1e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let in_pieces = at.plan.in_pieces();
    at.per_rod(|rod| {
        let time = at.theta(&format!("{rod}.plastic_time"), 1.0).map(|u| u.inverse(0.1, (SHORTEST, SHOOTING.inactive_time)));
        let limit = at.plan.model.params().find(&format!("{rod}.yield_curvature"));
        let (largest, never) = (at.largest_curvature(rod), at.value(&format!("{rod}.plastic_time")) >= SHOOTING.inactive_time);
        let curvature = at.theta(&format!("{rod}.yield_curvature"), 1.0).into_iter();
        Cause {
            meaning: "the rod stays bent where it was bent far",
            unknowns: if in_pieces { Vec::new() } else { time.into_iter().collect() },
            untestable: in_pieces
                .then(|| "the records are fitted in pieces, and what has flowed before a piece begins is unknown".to_owned()),
            excitation: "bend it sharply and let go: it does not come back to where it was",
            nuisance_grid: limit.filter(|_| never).map_or_else(Vec::new, |k| GRID.map(|part| vec![(k, part * largest)]).to_vec()),
            afterwards: curvature.filter(|_| never && !in_pieces).map(Unknown::logarithmic).collect(),
            ..Cause::default()
        }
    })
}
