//! A scale error of the sensor.

use super::{Cause, Situation};
use crate::sensor::SCALE;
use crate::unknown::Unknown;

pub(super) fn cause(_at: &Situation) -> Cause {
    Cause {
        name: "length_scale",
        object: None,
        meaning: "the sensor reads lengths too long or too short",
        unknowns: vec![Unknown::of_sensor(SCALE, 0.01, (0.5, 2.0))],
        untestable: None,
        excitation: "measure a known length",
        ..Cause::default()
    }
}
