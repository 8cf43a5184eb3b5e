//! Air drag proportional to the square of speed: f = −k L |v − wind| (v − wind) per node.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "air drag proportional to the square of speed is missing or wrong",
        unknowns: at.per_rope("drag_quadratic", |rope| at.typical_drag(rope)),
        excitation: "swing fast and at two amplitudes: the damping must grow with amplitude",
        ..Cause::default()
    }]
}
