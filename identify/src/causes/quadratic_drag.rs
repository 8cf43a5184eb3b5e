//! Air drag proportional to the square of speed: f = −k L |v − wind| (v − wind) per node of a rope, and on each triangle of a sheet
//! −k A |u| u n with u = (v − wind)·n; on a body −½ ρ A |u| u at its centre of mass, all bodies by one density ρ.
//!
//! Of bodies where a sensor of positions watches them, and there is neither rope nor cloth: what encoders read of the drag on an arm's links
//! is damping of its joints ([`super::quadratic_damping`]).

use super::{Cause, Situation};
use crate::unknown::Unknown;

/// Of air at sea level [kg/m³].
const AIR: f64 = 1.2;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "air drag proportional to the square of speed is missing or wrong",
        unknowns: unknowns(at),
        excitation: "swing fast and at two amplitudes: the damping must grow with amplitude",
        ..Cause::default()
    }]
}

fn unknowns(at: &Situation) -> Vec<Unknown> {
    let spans = at.per_span(["drag_quadratic", "drag_quadratic"], |span| at.typical_drag(span));
    if spans.is_empty() && !at.plan.markers.is_empty() { at.theta("air.density", AIR).into_iter().collect() } else { spans }
}
