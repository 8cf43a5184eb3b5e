//! A joint's spring that gives way: its elastic part e creeps, ė = q̇ − sign(e) max(|e| − e_y, 0)/τ.
//!
//! No creep is τ = ∞, so the fit's coordinate is 1/τ ≥ 0, in which the derivative at no creep exists. Without creep nothing determines
//! the yield e_y: it is looked at for none and for a part of the largest deflection, the best one counts, at a price.

use super::{Cause, Situation};
use crate::shooting::SHOOTING;

/// Yield over the joint's largest deflection.
const GRID: [f64; 3] = [1e-6, 0.3, 0.6];
/// Shortest time of creep \[s\]: a shorter one is a damper.
const SHORTEST: f64 = 1e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "the joint's spring gives way with time (creep)",
        excitation: "hold the joint deflected for long, then let go: it does not come back to where it was",
        untestable: at
            .plan
            .in_pieces()
            .then(|| "the records are fitted in pieces, and what has crept before a piece begins is unknown".to_owned()),
        ..Cause::default()
    };
    let mut out = at.per_joint_of("plastic_time", &shape, |_| 1.0);
    for cause in &mut out {
        let joint = cause.object.clone().unwrap_or_default();
        cause.unknowns =
            std::mem::take(&mut cause.unknowns).into_iter().map(|u| u.inverse(0.1, (SHORTEST, SHOOTING.inactive_time))).collect();
        let deflection = at.largest_deflection(&joint);
        let entry = at.plan.model.params().find(&format!("{joint}.yield")).filter(|_| !cause.unknowns.is_empty());
        cause.nuisance_grid = entry.map_or_else(Vec::new, |entry| GRID.map(|part| vec![(entry, part * deflection)]).to_vec());
    }
    out
}
