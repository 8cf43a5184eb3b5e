//! A mean flow of the air. It acts through drag alone: without drag its score is identically zero.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let spans: Vec<&str> = at.plan.model.node_spans().map(|(name, _)| name).collect();
    let bodies = spans.is_empty() && !at.plan.markers.is_empty() && at.plan.model.params().find("air.density").is_some();
    if spans.is_empty() && !bodies {
        return Vec::new();
    }
    let of_spans = ["drag_linear", "drag_normal", "drag_quadratic"];
    let mut drags = spans.iter().flat_map(|span| of_spans.map(|drag| format!("{span}.{drag}"))).chain(["air.density".to_owned()]);
    let testable = drags.any(|drag| at.value(&drag) > 0.0);
    let unknowns = (0..3).filter_map(|a| at.theta(&format!("air.wind[{a}]"), 0.1)).collect();
    vec![Cause {
        meaning: "the air moves",
        unknowns: if testable { unknowns } else { Vec::new() },
        untestable: (!testable).then(|| {
            "wind acts through drag, and the simulation has none: give the rope or cloth drag, or the air density, or accept drag first".to_owned()
        }),
        excitation: "turn the set-up by 90°: wind and tilt turn differently; or shield it",
        ..Cause::default()
    }]
}
