//! A mean flow of the air. It acts through drag alone: without drag its score is identically zero.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.ropes().is_empty() {
        return Vec::new();
    }
    let has_drag =
        |rope: &&str| at.value(&format!("{rope}.drag_linear")) > 0.0 || at.value(&format!("{rope}.drag_quadratic")) > 0.0;
    let testable = at.ropes().iter().any(has_drag);
    let unknowns = (0..3).filter_map(|a| at.theta(&format!("air.wind[{a}]"), 0.1)).collect();
    vec![Cause {
        meaning: "the air moves",
        unknowns: if testable { unknowns } else { Vec::new() },
        untestable: (!testable)
            .then(|| "wind acts through drag, and the simulation has none: give the rope drag, or accept drag first".to_owned()),
        excitation: "turn the set-up by 90°: wind and tilt turn differently; or shield it",
        ..Cause::default()
    }]
}
