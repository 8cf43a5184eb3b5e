//! Grippers: each holds existing nodes that no other gripper holds.

use super::super::cloth_error::ClothMistake;
use super::super::error::{Mistake, SceneError};
use super::super::file::Scene;
use super::super::gripper::{Clamp, Grasp, Gripper, Motion};
use super::super::held::Held;
use super::super::rope::Rope;
use super::super::words::{list, nearest};
use super::{not_negative, positive};
use std::collections::BTreeMap;

/// Farthest reach of a gripper [m]; beyond, another unit is meant.
const LONGEST_REACH: f64 = 1.0;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    let mut held = BTreeMap::new();
    for (g, gripper) in scene.gripper.iter().enumerate() {
        holds(scene, g, gripper, &mut held)?;
        turns(scene, g, gripper)?;
        if let Motion::Sine { frequency, .. } = gripper.motion {
            positive(&format!("gripper[{g}].motion.frequency"), frequency, "Hz")?;
        }
        if let Motion::Path { points } = &gripper.motion {
            rising(points.iter().map(|point| point[0]), &format!("gripper[{g}].motion.points"))?;
        }
        if let Clamp::Grasp(grasp) = &gripper.clamp {
            self::grasp(grasp, &format!("gripper[{g}].grasp"))?;
        }
    }
    Ok(())
}

/// Only edges of a rope that twists have a roll, and only a clamped end can be made to spin.
fn turns(scene: &Scene, g: usize, gripper: &Gripper) -> Result<(), SceneError> {
    let (rope, twists) = match scene.held(gripper) {
        Some(Held::Rope(rope, _)) => (Some(rope), rope.twist.is_some()),
        _ => (None, false),
    };
    let is_end = matches!(gripper.clamp, Clamp::End(_));
    let edge = rope.is_some_and(|rope| holds_edge(rope, gripper));
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

/// Whether the gripper clamps an end of its rope, or both nodes of an edge.
pub(super) fn holds_edge(rope: &Rope, gripper: &Gripper) -> bool {
    let mut nodes: Vec<usize> = gripper.clamp.numbers().iter().filter_map(|k| rope.node(*k)).collect();
    nodes.sort_unstable();
    let closes = rope.closed && nodes.first() == Some(&0) && nodes.last() == Some(&(rope.n_nodes() - 1));
    matches!(gripper.clamp, Clamp::End(_)) || nodes.windows(2).any(|pair| pair[1] == pair[0] + 1) || closes
}

/// Sizes and schedule of a gripper that grasps.
fn grasp(grasp: &Grasp, field: &str) -> Result<(), SceneError> {
    not_negative(&format!("{field}.stiffness"), grasp.stiffness, "N/m")?;
    not_negative(&format!("{field}.closing_time"), grasp.closing_time, "s")?;
    let lengths = [("radius", grasp.radius), ("smoothing", grasp.smoothing), ("tail_reach", grasp.far())];
    lengths.into_iter().try_for_each(|(key, value)| positive(&format!("{field}.{key}"), value, "m"))?;
    positive(&format!("{field}.steepness"), grasp.steepness, "-")?;
    if !(0.0..=1.0).contains(&grasp.tail) {
        return Err(SceneError::at(format!("{field}.tail"), Mistake::Range { value: grasp.tail, low: 0.0, high: 1.0 }));
    }
    if grasp.radius > LONGEST_REACH {
        let reason = ", farther than a gripper reaches".to_owned();
        let mistake = Mistake::Unit { value: grasp.radius, unit: "m", reason, likely: "mm", instead: 1e-3 * grasp.radius };
        return Err(SceneError::at(format!("{field}.radius"), mistake));
    }
    rising(grasp.closing.iter().map(|entry| entry[0]), &format!("{field}.closing"))
}

/// Times of a schedule.
fn rising(times: impl Iterator<Item = f64>, field: &str) -> Result<(), SceneError> {
    let mut before = f64::NEG_INFINITY;
    for (k, time) in times.enumerate() {
        if time <= before {
            return Err(SceneError::at(format!("{field}[{k}]"), Mistake::NotLater { time, before }));
        }
        before = time;
    }
    Ok(())
}

/// `held`: (object, node) to the gripper that holds it.
fn holds<'a>(
    scene: &'a Scene,
    g: usize,
    gripper: &'a Gripper,
    held: &mut BTreeMap<(&'a str, usize), &'a str>,
) -> Result<(), SceneError> {
    let object = object(scene, g, gripper)?;
    let numbers = gripper.clamp.numbers();
    if let Clamp::Grasp(_) = gripper.clamp {
        return Ok(());
    }
    if numbers.is_empty() {
        return Err(SceneError::at(format!("gripper[{g}].nodes"), Mistake::HoldsNothing));
    }
    if let (Held::Rope(rope, _), Clamp::End(_), true) = (object, &gripper.clamp, object.is_closed()) {
        let mistake = Mistake::NoEnds { rope: rope.name.clone(), what: "end" };
        return Err(SceneError::at(format!("gripper[{g}].end"), mistake));
    }
    if let (Held::Cloth(cloth, _), Clamp::End(_)) = (object, &gripper.clamp) {
        let error = ClothMistake::NoEnds { cloth: cloth.name.clone() };
        return Err(SceneError::at(format!("gripper[{g}].end"), Mistake::Cloth { error }));
    }
    for (k, number) in numbers.into_iter().enumerate() {
        let field = match gripper.clamp {
            Clamp::Nodes(_) => format!("gripper[{g}].nodes[{k}]"),
            Clamp::End(_) | Clamp::Grasp(_) => format!("gripper[{g}].end"),
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
            let (own, other) = (other == gripper.name, other.to_owned());
            let mistake = match object {
                Held::Rope(..) => Mistake::HeldTwice { rope: name, node, other, own },
                Held::Cloth(..) => Mistake::Cloth { error: ClothMistake::HeldTwice { cloth: name, node, other, own } },
            };
            return Err(SceneError::at(field, mistake));
        }
    }
    Ok(())
}

/// The rope or sheet that a gripper names.
fn object<'a>(scene: &'a Scene, g: usize, gripper: &'a Gripper) -> Result<Held<'a>, SceneError> {
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
