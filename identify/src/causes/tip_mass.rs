//! A mass at the rope's last node.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    if at.ropes().is_empty() {
        return Vec::new();
    }
    let model = &at.plan.model;
    let free_end = |rope: &&str| model.rope(rope).is_some_and(|r| !model.prescribed()[r.nodes.end - 1]);
    let mass = |rope: &str| 0.1 * at.value(&format!("{rope}.linear_density")) * at.value(&format!("{rope}.length"));
    let unknowns: Vec<_> =
        at.ropes().into_iter().filter(free_end).filter_map(|rope| at.theta(&format!("{rope}.tip_mass"), mass(rope))).collect();
    vec![Cause {
        meaning: "the rope's free end carries another mass than simulated",
        untestable: unknowns.is_empty().then(|| "the last node is held by a gripper, so its mass acts on nothing".to_owned()),
        unknowns,
        excitation: "weigh it; or swing the free end",
        ..Cause::default()
    }]
}
