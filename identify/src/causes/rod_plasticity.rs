//! A rod that stays bent: beyond a yield curvature its bending flows, x its elastic part, ẋ = k̇ − max(|x| − κ_y l, 0)/τ x/|x|.
//!
//! No flow is τ = ∞, so the fit's coordinate is 1/τ ≥ 0, in which the derivative at no flow exists. Without flow nothing determines the
//! yield: it is looked at for parts of the largest curvature that a record begins with, the best one counts, at a price.

use super::{Cause, Situation};
use crate::shoot::NEVER;
use crate::unknown::Unknown;
use nalgebra::Vector3;

/// Yield over the largest curvature.
const GRID: [f64; 3] = [0.05, 0.3, 0.6];
/// Shortest time of the flow \[s\]: a shorter one is plasticity without a rate for motions by hand.
const SHORTEST: f64 = 1e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let in_pieces = at.plan.in_pieces;
    at.per_rod(|rod| {
        let time = at.theta(&format!("{rod}.plastic_time"), 1.0).map(|u| u.inverse(0.1, (SHORTEST, NEVER)));
        let limit = at.plan.model.params().find(&format!("{rod}.yield_curvature"));
        let (largest, never) = (largest_curvature(at, rod), at.value(&format!("{rod}.plastic_time")) >= NEVER);
        let curvature = at.theta(&format!("{rod}.yield_curvature"), 1.0).into_iter();
        Cause {
            name: "rod_plasticity",
            meaning: "the rod stays bent where it was bent far",
            unknowns: if in_pieces { Vec::new() } else { time.into_iter().collect() },
            untestable: in_pieces
                .then(|| "the records are fitted in pieces, and what has flowed before a piece begins is unknown".to_owned()),
            excitation: "bend it sharply and let go: it does not come back to where it was",
            settings: limit.filter(|_| never).map_or_else(Vec::new, |k| GRID.map(|part| vec![(k, part * largest)]).to_vec()),
            afterwards: curvature.filter(|_| never && !in_pieces).map(Unknown::logarithmic).collect(),
            ..Cause::default()
        }
    })
}

/// The largest curvature at the nodes of a rod as records begin [1/m].
fn largest_curvature(at: &Situation, rod: &str) -> f64 {
    let Some(span) = at.plan.model.rope(rod) else { return 1.0 };
    let mut largest = 0.0_f64;
    for rec in &at.plan.fitted {
        let x = |node: usize| Vector3::from_column_slice(&rec.start.mean.q[3 * node..3 * node + 3]);
        for node in span.nodes.start + 1..span.nodes.end - 1 {
            let (a, b) = (x(node) - x(node - 1), x(node + 1) - x(node));
            largest = largest.max(2.0 * a.angle(&b) / (a.norm() + b.norm()));
        }
    }
    if largest.is_finite() && largest > 0.0 { largest } else { at.typical_curvature(rod) }
}
