//! Air drag proportional to speed: f = −c L (v − wind) per node.

use super::{Cause, Situation};

pub(super) fn cause(at: &Situation) -> Cause {
    Cause {
        name: "linear_drag",
        object: None,
        meaning: "air drag proportional to speed is missing or wrong",
        unknowns: at.per_rope("drag_linear", |rope| at.typical_drag(rope)),
        untestable: None,
        excitation: "swing at two amplitudes: linear drag damps both alike, quadratic drag the larger one more",
        ..Cause::default()
    }
}
