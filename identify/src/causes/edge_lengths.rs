//! Edges of a rod of another length than the scene says: markers that are not where they were measured to be.
//!
//! All of them longer by the same part are hardly another thing than a sensor that reads lengths too short, so it is asked of rods only, of
//! which every edge matters; a rope has its length, and the sensor its scale.

use super::{Cause, Situation};

/// A typical error, as a part of the edge's length.
const TYPICAL: f64 = 0.01;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let model = &at.plan.model;
    let one = |rope: &str| {
        let span = model.rope(rope)?;
        // an edge that a gripper holds by both nodes is as long as that says
        let held = |e: usize| span.edge(e).iter().all(|node| model.prescribed()[*node]);
        let free = (0..span.fractions.len()).filter(|e| !held(*e));
        Some(Cause {
            object: (at.ropes().len() > 1).then(|| rope.to_owned()),
            meaning: "the rope is longer at rest in some places, or shorter, than simulated (where markers or links really are)",
            unknowns: at.along(&free.map(|e| format!("{rope}.edge[{e}].rest_strain")).collect::<Vec<_>>(), TYPICAL),
            excitation: "pull it straight and measure it from place to place",
            ..Cause::default()
        })
    };
    at.ropes().into_iter().filter(|rope| at.is_rod(rope)).filter_map(one).collect()
}
