//! Air drag proportional to speed: f = −c L (v − wind) per node.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    vec![Cause {
        meaning: "air drag proportional to speed is missing or wrong",
        unknowns: at.per_rope("drag_linear", |rope| at.typical_drag(rope)),
        excitation: "swing at two amplitudes: linear drag damps both alike, quadratic drag the larger one more",
        ..Cause::default()
    }]
}
