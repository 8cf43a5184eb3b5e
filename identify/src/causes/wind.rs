//! A mean flow of the air. It acts through drag alone: without drag its score is identically zero.
//!
//! On bodies only where the scene has a drag on them. A drag that was found is small there, and with it a wind of tens of metres a second is any
//! constant force: on half of the tosses of a real cube such a wind, another one in each, took the place of a wrong length.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let spans: Vec<&str> = at.plan.model.node_spans().map(|(name, _)| name).collect();
    let on_bodies = at.bodies_meet_the_air() && at.has_drag_on_bodies();
    if spans.is_empty() && !on_bodies {
        return Vec::new();
    }
    let drags = ["drag_linear", "drag_normal", "drag_quadratic"];
    let with_drag = |span: &&str| drags.iter().any(|drag| at.value(&format!("{span}.{drag}")) > 0.0);
    let testable = spans.iter().any(with_drag) || on_bodies;
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
