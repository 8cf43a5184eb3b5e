//! A mean flow of the air. It acts through drag alone: without drag its score is identically zero.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let mut spans = at.plan.model.node_spans().map(|(name, _)| name).peekable();
    if spans.peek().is_none() {
        return Vec::new();
    }
    let drags = ["drag_linear", "drag_normal", "drag_quadratic"];
    let testable = spans.any(|span| drags.iter().any(|drag| at.value(&format!("{span}.{drag}")) > 0.0));
    let unknowns = (0..3).filter_map(|a| at.theta(&format!("air.wind[{a}]"), 0.1)).collect();
    vec![Cause {
        meaning: "the air moves",
        unknowns: if testable { unknowns } else { Vec::new() },
        untestable: (!testable).then(|| {
            "wind acts through drag, and the simulation has none: give the rope or cloth drag, or accept drag first".to_owned()
        }),
        excitation: "turn the set-up by 90°: wind and tilt turn differently; or shield it",
        ..Cause::default()
    }]
}
