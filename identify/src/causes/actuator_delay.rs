//! Commands that reach a motor late.
//!
//! A delay common to all motors moves the readings as a delay of the readings does: that is `sensor_delay`, which has this cause as its
//! equivalent. Only that *one* motor is later than the others can be told. A delay by a part of a step counts as such (the motor sees
//! the mean command over the step), so the derivative at no delay exists; to first order it is that of a lag as long.

use super::{Cause, Situation, unread};
use crate::shooting::SHOOTING;
use crate::unknown::Unknown;

/// Typical size of a delay \[s\].
const TYPICAL: f64 = 1e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a motor gets its commands late",
        untestable: unread(at),
        excitation: "command steps: a late motor does nothing for a while, a lagging one begins at once",
        ..Cause::default()
    };
    // a single motor is late together with everything that is read
    let actuators = at.actuators();
    if actuators.len() < 2 {
        return Vec::new();
    }
    let first = at.plan.model.nu() - actuators.len();
    let one = |(k, name): (usize, &str)| {
        let path = format!("{name}.delay");
        // a motor whose delay the scene has remembers its commands; of the others it is the inputs that are late
        let late = || Unknown::of_late(path.clone(), first + k, TYPICAL, (0.0, SHOOTING.longest_delay));
        let unknown = at.theta(&path, TYPICAL).unwrap_or_else(late);
        Cause { object: Some(name.to_owned()), unknowns: at.testable(vec![unknown], &shape), ..shape.clone() }
    };
    actuators.into_iter().enumerate().map(one).collect()
}
