//! Masses at single nodes beside the rope's own: markers, sleeves, splices.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let model = &at.plan.model;
    let one = |rope: &str| {
        let nodes = model.rope(rope)?.nodes.clone();
        // held nodes move as they are told, and the mass of a free end is a cause of its own
        let free = nodes.clone().skip(1).take(nodes.len().saturating_sub(2)).filter(|node| !model.driven()[*node]);
        let share = at.value(&format!("{rope}.linear_density")) * at.value(&format!("{rope}.length")) / nodes.len() as f64;
        let paths = free.map(|node| format!("{rope}.node[{}].mass", node - nodes.start));
        Some(Cause {
            name: "mass_distribution",
            object: (at.ropes().len() > 1).then(|| rope.to_owned()),
            meaning: "the mass is distributed along the rope otherwise than simulated (markers, sleeves)",
            unknowns: paths.filter_map(|path| at.theta(&path, 0.1 * share)).collect(),
            excitation: "weigh it piece by piece",
            ..Cause::default()
        })
    };
    // ropes of many nodes have no mass to themselves at each that data could tell apart
    let few = |rope: &&str| model.rope(rope).is_some_and(|r| r.nodes.len() <= MOST_NODES && at.is_rod(rope));
    at.ropes().into_iter().filter(few).filter_map(one).collect()
}

/// Nodes of a rope whose masses are looked at one by one.
const MOST_NODES: usize = 40;
