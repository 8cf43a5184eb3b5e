//! A first-order lag between the command and the torque: T ẏ = u − y.
//!
//! At T = 0 its derivative is that of a delay as long; what tells them apart is of second order in T, so a short lag stays ambiguous.

use super::{Cause, Situation, unread};

/// A typical time constant \[s\].
const TYPICAL: f64 = 1e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a motor follows its commands with a lag",
        untestable: unread(at),
        excitation: "command steps and fast sines: a lag weakens fast commands, a delay does not",
        ..Cause::default()
    };
    let mut out = at.per_actuator("lag", TYPICAL, &shape);
    if out.len() > 1 {
        let all = at.theta("*.lag", TYPICAL);
        let meaning = "all motors follow their commands with the same lag";
        out.extend(all.map(|all| Cause { meaning, unknowns: at.testable(vec![all], &shape), ..shape }));
    }
    out
}
