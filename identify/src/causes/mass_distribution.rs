//! Masses at single nodes beside the rope's own: markers, sleeves, splices.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let model = &at.plan.model;
    let one = |rope: &str| {
        let nodes = model.rope(rope)?.nodes.clone();
        // held nodes move as they are told, and the mass of a free end is a cause of its own
        let free = nodes.clone().skip(1).take(nodes.len().saturating_sub(2)).filter(|node| !model.prescribed()[*node]);
        let share = at.value(&format!("{rope}.linear_density")) * at.value(&format!("{rope}.length")) / nodes.len() as f64;
        let paths: Vec<String> = free.map(|node| format!("{rope}.node[{}].mass", node - nodes.start)).collect();
        Some(Cause {
            object: (at.ropes().len() > 1).then(|| rope.to_owned()),
            meaning: "the mass is distributed along the rope otherwise than simulated (markers, sleeves)",
            unknowns: at.along(&paths, 0.1 * share),
            excitation: "weigh it piece by piece",
            ..Cause::default()
        })
    };
    at.ropes().into_iter().filter(|rope| at.is_rod(rope)).filter_map(one).collect()
}
