//! Air drag proportional to the square of speed: f = −k L |v − wind| (v − wind) per node of a rope, and on each triangle of a sheet
//! −k A |u| u n with u = (v − wind)·n; on bodies −½ ρ A |u| u at their centres of mass, with the air's density ρ.

use super::air::Medium;
use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let spans = at.per_span(["drag_quadratic", "drag_quadratic"], |span| at.typical_drag(span));
    vec![Cause {
        meaning: "air drag proportional to the square of speed is missing or wrong",
        unknowns: spans.into_iter().chain(at.of_bodies(Medium::Density)).collect(),
        excitation: "swing fast and at two amplitudes: the damping must grow with amplitude",
        ..Cause::default()
    }]
}
