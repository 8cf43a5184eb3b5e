//! The zero of a joint's encoder that moves with the time: y = q + d t, from the first sample of every record on.

use super::{Cause, Situation};
use crate::sensor::DRIFT;

/// The largest drift that is believed [rad/s or m/s], a degree in a second. What a sensor cannot do is no explanation: on a real pendulum a drift
/// of four degrees in a second stood in for dynamics that the model lacked.
const MOST: f64 = 0.0175;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "an encoder's zero moves with the time",
        excitation: "let the joint stand still for as long as a record: what its encoder reads should stay",
        ..Cause::default()
    };
    at.per_encoder(DRIFT, 0.01, (-MOST, MOST), &shape)
}
