//! A delay of the markers' clock against the grippers'.

use super::{Cause, Situation};
use crate::sensor::TIME_OFFSET;
use crate::unknown::Unknown;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.plan.markers.is_empty() {
        return Vec::new();
    }
    let shared = at.plan.shared_sensor;
    let unknown = Unknown::of_sensor(TIME_OFFSET, 1e-3, (-0.2, 0.2));
    vec![Cause {
        meaning: "the markers' clock is late or early against the grippers'",
        unknowns: if shared { Vec::new() } else { vec![unknown] },
        untestable: shared.then(|| "one sensor reads markers and grippers: they share its clock".to_owned()),
        excitation: "a sharp start of the motion, seen by both",
        ..Cause::default()
    }]
}
