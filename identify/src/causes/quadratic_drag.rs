//! Air drag proportional to the square of speed: f = −k L |v − wind| (v − wind) per node of a rope, and on each triangle of a sheet
//! −k A |u| u n with u = (v − wind)·n.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "air drag proportional to the square of speed is missing or wrong",
        unknowns: at.per_span(["drag_quadratic", "drag_quadratic"], |span| at.typical_drag(span)),
        excitation: "swing fast and at two amplitudes: the damping must grow with amplitude",
        ..Cause::default()
    }]
}
