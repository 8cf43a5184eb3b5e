//! Readings that are late.
//!
//! All of them late alike by d, with unknown initial states, are those of a motion whose commands are late by d: from outside no log
//! tells the two apart, unless something else is measured on the commands' side.

use super::{Cause, Situation};
use crate::sensor::{DELAY, TIME_OFFSET};
use crate::unknown::Unknown;

const EXCITATION: &str =
    "log what the motor does (its current) beside the joint: a late motor is late there too, a late encoder is not";

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    // where there are markers, the delay of everything that is read is `time_offset`
    let of_all = at.plan.markers.is_empty().then(|| common(at));
    of_encoders(at).into_iter().chain(of_all).collect()
}

/// One encoder later than the others.
fn of_encoders(at: &Situation) -> Vec<Cause> {
    let shape = Cause { meaning: "an encoder is late or early against the others", excitation: EXCITATION, ..Cause::default() };
    let all = at.per_encoder(DELAY, 1e-3, (-0.2, 0.2), &shape);
    // a single encoder is late together with everything that is read
    if at.plan.observed().len() > 1 { all } else { Vec::new() }
}

/// All readings late alike.
fn common(at: &Situation) -> Cause {
    let prescribed = at.has_actuators();
    Cause {
        meaning: "everything that is read is late or early against the commands",
        unknowns: if prescribed { vec![Unknown::of_sensor(TIME_OFFSET, 1e-3, (-0.2, 0.2))] } else { Vec::new() },
        untestable: (!prescribed)
            .then(|| "nothing is commanded: readings that are late are those of a motion that began later".to_owned()),
        excitation: EXCITATION,
        equivalents: vec!["actuator_delay"],
        ..Cause::default()
    }
}
