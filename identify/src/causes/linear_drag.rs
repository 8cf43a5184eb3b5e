//! Air drag proportional to speed: f = −c L (v − wind) per node of a rope, and on each triangle of a sheet −c A (v − wind)·n n along its
//! normal.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "air drag proportional to speed is missing or wrong",
        unknowns: at.per_span(["drag_linear", "drag_normal"], |span| at.typical_drag(span)),
        excitation: "swing at two amplitudes: linear drag damps both alike, quadratic drag the larger one more",
        ..Cause::default()
    }]
}
