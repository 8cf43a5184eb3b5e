//! A rotation of the sensor's frame against the scene's.

use super::{Cause, Situation};
use crate::unknown::Unknown;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.plan.markers.is_empty() {
        return Vec::new();
    }
    vec![Cause {
        meaning: "the sensor's frame is rotated against the scene's",
        unknowns: (4..7).map(|a| Unknown::of_sensor(a, 0.01, (-1.0, 1.0))).collect(),
        excitation: "measure three markers at known places",
        ..Cause::default()
    }]
}
