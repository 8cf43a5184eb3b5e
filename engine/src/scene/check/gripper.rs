//! Grippers: each holds existing nodes that no other gripper holds.

use super::super::error::{Mistake, SceneError};
use super::super::file::Scene;
use super::super::gripper::{Clamp, Gripper, Motion};
use super::super::words::{list, nearest};
use super::positive;
use std::collections::BTreeMap;

pub(super) fn check<X>(scene: &Scene<X>) -> Result<(), SceneError> {
    let mut held = BTreeMap::new();
    for (g, gripper) in scene.gripper.iter().enumerate() {
        holds(scene, g, gripper, &mut held)?;
        if let Motion::Sine { frequency, .. } = gripper.motion {
            positive(&format!("gripper[{g}].motion.frequency"), frequency, "Hz")?;
        }
    }
    Ok(())
}

/// `held`: (rope, node) to the gripper that holds it.
fn holds<'a, X>(
    scene: &Scene<X>,
    g: usize,
    gripper: &'a Gripper,
    held: &mut BTreeMap<(&'a str, usize), &'a str>,
) -> Result<(), SceneError> {
    let Some(rope) = scene.rope.iter().find(|rope| rope.name == gripper.rope) else {
        let names = || scene.rope.iter().map(|rope| rope.name.as_str());
        let nearest = nearest(&gripper.rope, names()).map(str::to_owned);
        let mistake = Mistake::NoSuchRope { rope: gripper.rope.clone(), nearest, known: list(names()) };
        return Err(SceneError::at(format!("gripper[{g}].rope"), mistake));
    };
    let numbers = gripper.clamp.numbers();
    if numbers.is_empty() {
        return Err(SceneError::at(format!("gripper[{g}].nodes"), Mistake::HoldsNothing));
    }
    for (k, number) in numbers.into_iter().enumerate() {
        let field = match gripper.clamp {
            Clamp::Nodes(_) => format!("gripper[{g}].nodes[{k}]"),
            Clamp::End(_) => format!("gripper[{g}].end"),
        };
        let Some(node) = rope.node(number) else {
            let mistake = Mistake::NoSuchNode { rope: rope.name.clone(), node: number, nodes: rope.n_nodes() };
            return Err(SceneError::at(field, mistake));
        };
        if let Some(other) = held.insert((&gripper.rope, node), &gripper.name) {
            let mistake = Mistake::HeldTwice { rope: rope.name.clone(), node, other: other.to_owned() };
            return Err(SceneError::at(field, mistake));
        }
    }
    Ok(())
}
