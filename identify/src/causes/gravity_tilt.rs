//! The direction of gravity in the scene's frame.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let testable = at.value("gravity.magnitude") > 0.0;
    vec![Cause {
        meaning: "gravity is not along −z of the scene's frame",
        unknowns: if testable {
            (0..2).filter_map(|a| at.theta(&format!("gravity.tilt[{a}]"), 0.01)).collect()
        } else {
            Vec::new()
        },
        untestable: (!testable).then(|| "the scene has no gravity".to_owned()),
        excitation: "turn the set-up by 90° about the vertical: tilt stays with the room, a rotated camera frame turns along",
        ..Cause::default()
    }]
}
