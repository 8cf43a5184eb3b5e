//! A rotation of the sensor's frame against the scene's.

use super::{Cause, Situation};
use crate::unknown::Unknown;

pub(super) fn cause(_at: &Situation) -> Cause {
    Cause {
        name: "frame_rotation",
        object: None,
        meaning: "the sensor's frame is rotated against the scene's",
        unknowns: (4..7).map(|a| Unknown::of_sensor(a, 0.01, (-1.0, 1.0))).collect(),
        untestable: None,
        excitation: "measure three markers at known places",
        ..Cause::default()
    }
}
