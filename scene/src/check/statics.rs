//! Conditions of `start = "equilibrium"`: no part that may move without a force, which would make the matrix of statics singular.

use super::super::error::{Mistake, SceneError};
use super::super::file::Scene;
use super::super::gripper::{Clamp, Gripper};
use super::super::held::Held;
use super::super::rope::{Rest, Rope, Start};
use super::gripper::holds_edge;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    let ropes = scene.rope.iter().enumerate().map(|(r, rope)| (format!("rope[{r}].start"), rope.start));
    let sheets = scene.cloth.iter().enumerate().map(|(c, cloth)| (format!("cloth[{c}].start"), cloth.start));
    // one of them asks for all: the equilibrium is the whole scene's
    let Some((field, _)) = ropes.chain(sheets).find(|(_, start)| *start == Start::Equilibrium) else { return Ok(()) };
    for cloth in &scene.cloth {
        if holders(scene, &cloth.name).next().is_none() {
            return Err(SceneError::at(field, Mistake::Unheld { what: "cloth", name: cloth.name.clone() }));
        }
    }
    scene.rope.iter().enumerate().try_for_each(|(r, rope)| self::rope(scene, r, rope, &field))
}

fn rope(scene: &Scene, r: usize, rope: &Rope, field: &str) -> Result<(), SceneError> {
    let name = || rope.name.clone();
    if holders(scene, &rope.name).next().is_none() {
        return Err(SceneError::at(field, Mistake::Unheld { what: "rope", name: name() }));
    }
    let held: usize = holders(scene, &rope.name).map(|gripper| gripper.clamp.numbers().len()).sum();
    if rope.stretch_stiffness == 0.0 && held < rope.n_nodes() {
        return Err(SceneError::at(format!("rope[{r}].stretch_stiffness"), Mistake::Unstretched { rope: name() }));
    }
    let Some(twist) = rope.twist.as_ref().filter(|_| turns_freely(rope)) else { return Ok(()) };
    if twist.stiffness == 0.0 {
        return Err(SceneError::at(format!("rope[{r}].twist.stiffness"), Mistake::Untwisted { rope: name() }));
    }
    if !holders(scene, &rope.name).any(|gripper| holds_edge(rope, gripper)) {
        return Err(SceneError::at(field, Mistake::Rolls { rope: name() }));
    }
    Ok(())
}

/// Grippers that hold nodes of an object.
fn holders<'a>(scene: &'a Scene, name: &'a str) -> impl Iterator<Item = &'a Gripper> {
    scene
        .gripper
        .iter()
        .filter(move |gripper| !matches!(gripper.clamp, Clamp::Grasp(_)) && scene.held(gripper).map(Held::name) == Some(name))
}

/// Whether bending does not know how the section stands: equally stiff to all sides, and straight at rest.
fn turns_freely(rope: &Rope) -> bool {
    rope.twist.as_ref().is_some_and(|twist| {
        let straight = twist.rest == Rest::Straight && twist.rest_curvature == [0.0; 2];
        let round = twist.bend_stiffness_2.is_none_or(|second| second == rope.bend_stiffness);
        straight && round && twist.joint.iter().all(|joint| joint.rest_curvature == [0.0; 2])
    })
}
