//! A mean flow of the air. It acts through drag alone: without drag its score is identically zero.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let spans: Vec<&str> = at.plan.model.node_spans().map(|(name, _)| name).collect();
    if spans.is_empty() && !at.bodies_meet_the_air() {
        return Vec::new();
    }
    let drags = ["drag_linear", "drag_normal", "drag_quadratic"];
    let with_drag = |span: &&str| drags.iter().any(|drag| at.value(&format!("{span}.{drag}")) > 0.0);
    let testable = spans.iter().any(with_drag) || at.has_drag_on_bodies();
    let unknowns = (0..3).filter_map(|a| at.theta(&format!("air.wind[{a}]"), 0.1)).collect();
    vec![Cause {
        meaning: "the air moves",
        unknowns: if testable { unknowns } else { Vec::new() },
        untestable: (!testable).then(|| {
            "wind acts through drag, and the simulation has none: give the rope or cloth drag or the air a density, or accept drag first".to_owned()
        }),
        excitation: "turn the set-up by 90°: wind and tilt turn differently; or shield it",
        ..Cause::default()
    }]
}
