//! Commands that reach a motor late.
//!
//! All motors late alike are, from outside, readings that are late: that is `sensor_delay`, which has this cause as its twin. What can
//! be told is that *one* motor is later than the others. A delay of a part of a step counts as such (the motor sees the mean over the
//! step of what reaches it), so the derivative at no delay exists; to first order it is that of a lag as long.

use super::{Cause, Situation, unread};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        name: "actuator_delay",
        meaning: "a motor gets its commands late",
        untestable: unread(at),
        excitation: "command steps: a late motor does nothing for a while, a lagging one begins at once",
        ..Cause::default()
    };
    // a single motor is late together with everything that is read
    if at.actuators().len() > 1 { at.per_actuator("delay", 1e-3, &shape) } else { Vec::new() }
}
