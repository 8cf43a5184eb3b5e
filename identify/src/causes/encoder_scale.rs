//! The scale of a joint's encoder.

use super::{Cause, Situation};
use crate::sensor::GAIN;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "an encoder reads angles too large or too small",
        excitation: "turn the joint by a full revolution, or between two stops at known places",
        ..Cause::default()
    };
    at.per_encoder(GAIN, 0.01, (0.2, 5.0), &shape)
}
