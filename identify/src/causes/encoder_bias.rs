//! The zero of a joint's encoder.

use super::{Cause, Situation};
use crate::sensor::BIAS;
use pliant_math::params::ANY;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "an encoder's zero is off",
        excitation: "drive the joint to a stop whose place is known, or turn the base over: gravity's tilt turns along",
        ..Cause::default()
    };
    at.per_encoder(BIAS, 0.01, ANY, &shape)
}
