//! A scale error of the sensor.

use super::{Cause, Situation};
use crate::sensor::SCALE;
use crate::unknown::Unknown;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.plan.markers.is_empty() {
        return Vec::new();
    }
    vec![Cause {
        meaning: "the sensor reads lengths too long or too short",
        unknowns: vec![Unknown::of_sensor(SCALE, 0.01, (0.5, 2.0))],
        excitation: "measure a known length",
        ..Cause::default()
    }]
}
