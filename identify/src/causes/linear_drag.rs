//! Air drag proportional to speed: f = −c L (v − wind) per node of a rope, and on each triangle of a sheet −c A (v − wind)·n n along its
//! normal; on bodies −6 η √(π A) (v − wind) at their centres of mass, with the air's viscosity η.

use super::air::Medium;
use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let spans = at.per_span(["drag_linear", "drag_normal"], |span| at.typical_drag(span));
    vec![Cause {
        meaning: "air drag proportional to speed is missing or wrong",
        unknowns: spans.into_iter().chain(at.of_bodies(Medium::Viscosity)).collect(),
        excitation: "swing at two amplitudes: linear drag damps both alike, quadratic drag the larger one more",
        ..Cause::default()
    }]
}
