//! Grippers: each holds existing nodes that no other gripper holds.

use super::super::cloth_error::ClothMistake;
use super::super::error::{Mistake, SceneError};
use super::super::file::Scene;
use super::super::gripper::{Clamp, Gripper, Motion};
use super::super::held::Held;
use super::super::words::{list, nearest};
use super::positive;
use std::collections::BTreeMap;

pub(super) fn check<X>(scene: &Scene<X>) -> Result<(), SceneError> {
    let mut held = BTreeMap::new();
    for (g, gripper) in scene.gripper.iter().enumerate() {
        holds(scene, g, gripper, &mut held)?;
        turns(scene, g, gripper)?;
        if let Motion::Sine { frequency, .. } = gripper.motion {
            positive(&format!("gripper[{g}].motion.frequency"), frequency, "Hz")?;
        }
    }
    Ok(())
}

/// Only edges of a rope that twists have a roll, and only a clamped end can be made to spin.
fn turns<X>(scene: &Scene<X>, g: usize, gripper: &Gripper) -> Result<(), SceneError> {
    let (rope, twists) = match scene.held(gripper) {
        Some(Held::Rope(rope, _)) => (Some(rope), rope.twist.is_some()),
        _ => (None, false),
    };
    let mut nodes: Vec<usize> = gripper.clamp.numbers().iter().filter_map(|k| rope?.node(*k)).collect();
    nodes.sort_unstable();
    let is_end = matches!(gripper.clamp, Clamp::End(_));
    let edge = is_end || nodes.windows(2).any(|pair| pair[1] == pair[0] + 1);
    let possible = [
        ("roll", gripper.roll != 0.0, twists && edge),
        ("roll_by_direction", gripper.roll_by_direction != [0.0; 3], twists && edge),
        ("roll_by_position", gripper.roll_by_position != [0.0; 3], twists && edge),
        ("spin", gripper.spin != 0.0, twists && is_end),
    ];
    match possible.into_iter().find(|(_, wanted, possible)| *wanted && !possible) {
        None => Ok(()),
        Some((key, ..)) => {
            let name = rope.map_or("a sheet", |rope| &rope.name);
            let what = if is_end { format!("\"{name}\"") } else { format!("what it holds of \"{name}\"") };
            Err(SceneError::at(format!("gripper[{g}].{key}"), Mistake::NothingToTurn { what }))
        }
    }
}

/// `held`: (object, node) to the gripper that holds it.
fn holds<'a, X>(
    scene: &'a Scene<X>,
    g: usize,
    gripper: &'a Gripper,
    held: &mut BTreeMap<(&'a str, usize), &'a str>,
) -> Result<(), SceneError> {
    let object = object(scene, g, gripper)?;
    let numbers = gripper.clamp.numbers();
    if numbers.is_empty() {
        return Err(SceneError::at(format!("gripper[{g}].nodes"), Mistake::HoldsNothing));
    }
    if let (Held::Cloth(cloth, _), Clamp::End(_)) = (object, &gripper.clamp) {
        let error = ClothMistake::NoEnds { cloth: cloth.name.clone() };
        return Err(SceneError::at(format!("gripper[{g}].end"), Mistake::Cloth { error }));
    }
    for (k, number) in numbers.into_iter().enumerate() {
        let field = match gripper.clamp {
            Clamp::Nodes(_) => format!("gripper[{g}].nodes[{k}]"),
            Clamp::End(_) => format!("gripper[{g}].end"),
        };
        let name = object.name().to_owned();
        let Some(node) = object.node(number) else {
            let mistake = match object {
                Held::Rope(rope, _) => Mistake::NoSuchNode { rope: name, node: number, nodes: rope.n_nodes() },
                Held::Cloth(cloth, _) => {
                    let error = ClothMistake::NoSuchNode { cloth: name, node: number, nodes: cloth.n_nodes() };
                    Mistake::Cloth { error }
                }
            };
            return Err(SceneError::at(field, mistake));
        };
        if let Some(other) = held.insert((object.name(), node), &gripper.name) {
            let other = other.to_owned();
            let mistake = match object {
                Held::Rope(..) => Mistake::HeldTwice { rope: name, node, other },
                Held::Cloth(..) => Mistake::Cloth { error: ClothMistake::HeldTwice { cloth: name, node, other } },
            };
            return Err(SceneError::at(field, mistake));
        }
    }
    Ok(())
}

/// The rope or sheet that a gripper names.
fn object<'a, X>(scene: &'a Scene<X>, g: usize, gripper: &'a Gripper) -> Result<Held<'a>, SceneError> {
    let given = usize::from(gripper.rope.is_some()) + usize::from(gripper.cloth.is_some());
    if given != 1 {
        let field = if given == 0 { format!("gripper[{g}]") } else { format!("gripper[{g}].cloth") };
        return Err(SceneError::at(field, Mistake::OneOf { keys: list(["rope", "cloth"]), given }));
    }
    if let Some(held) = scene.held(gripper) {
        return Ok(held);
    }
    let mistake = match &gripper.cloth {
        None => {
            let (rope, names) = (gripper.rope.clone().unwrap_or_default(), || scene.rope.iter().map(|rope| rope.name.as_str()));
            Mistake::NoSuchRope { nearest: nearest(&rope, names()).map(str::to_owned), known: list(names()), rope }
        }
        Some(name) => {
            let names = || scene.cloth.iter().map(|cloth| cloth.name.as_str());
            let (nearest, known) = (nearest(name, names()).map(str::to_owned), names().collect::<Vec<_>>().join(", "));
            Mistake::NoSuch { what: "cloth", name: name.clone(), nearest, known }
        }
    };
    Err(SceneError::at(format!("gripper[{g}].{}", if gripper.cloth.is_some() { "cloth" } else { "rope" }), mistake))
}
