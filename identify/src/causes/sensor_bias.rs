//! A constant error of the markers' readings.

use super::{Cause, Situation};
use crate::unknown::Unknown;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.plan.markers.is_empty() {
        return Vec::new();
    }
    let shared = at.plan.shared_sensor && at.plan.model.contact_pairs().is_empty();
    let unknowns = (0..3).map(|a| Unknown::of_sensor(a, 1e-3, (-1.0, 1.0))).collect();
    vec![Cause {
        meaning: "the markers' readings are shifted by a constant",
        unknowns: if shared { Vec::new() } else { unknowns },
        untestable: shared.then(|| {
            "one sensor reads markers and grippers: a common shift moves the whole scene and changes nothing".to_owned()
        }),
        excitation: "measure a marker at a known place",
        ..Cause::default()
    }]
}
