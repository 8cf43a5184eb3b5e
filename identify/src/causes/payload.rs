//! The mass of a body at the end of an arm, with all that it carries; its distribution in space stays.

use super::{Cause, Situation};
use pliant_engine::bodies::Tree;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "the last link, with what it carries, is heavier or lighter than simulated",
        excitation: "weigh it; or hold the arm level by known torques",
        ..Cause::default()
    };
    at.per_mass(ends(at.plan.model.tree()), &shape)
}

/// Names of the bodies that carry no other.
fn ends(tree: &Tree) -> impl Iterator<Item = &String> {
    let bodies = tree.bodies();
    bodies.iter().enumerate().filter(|(k, _)| !bodies.iter().any(|b| b.parent == Some(*k))).map(|(_, b)| &b.name)
}
