//! Shapes, and the objects that may touch them.

use super::super::cloth_error::ClothMistake;
use super::super::cloth_initial::cloth_points;
use super::super::error::{Mistake, SceneError};
use super::super::file::{Integrator, Scene};
use super::super::initial::rope_points;
use super::super::vector::{V3, add, dot, norm, scale, sub, unit};
use super::{not_negative, positive};
use std::collections::BTreeSet;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    shapes(scene)?;
    let bodies = scene.body.iter().filter(|b| !b.shape.is_empty()).count();
    let shapes = scene.n_shapes() + scene.body.iter().map(|b| b.shape.len()).sum::<usize>();
    if shapes == 0 || (scene.n_shapes() == 0 && scene.rope.is_empty() && scene.cloth.is_empty() && bodies == 1) {
        return Ok(());
    }
    if scene.time.integrator == Integrator::Midpoint {
        return Err(SceneError::at("time.integrator", Mistake::MidpointContact { shapes }));
    }
    let held: BTreeSet<(&str, usize)> = held(scene).collect();
    if scene.rope.is_empty() && scene.cloth.is_empty() && bodies == 0 {
        return Err(SceneError::at("rope", Mistake::NothingFree { shapes }));
    }
    // a commanded node does not feel contact: such a rope would go through everything without a word
    let all_held = |name: &str, nodes: usize| (0..nodes).all(|node| held.contains(&(name, node)));
    if let Some((r, rope)) = scene.rope.iter().enumerate().find(|(_, rope)| all_held(&rope.name, rope.n_nodes())) {
        return Err(SceneError::at(format!("rope[{r}]"), Mistake::AllHeld { rope: rope.name.clone(), shapes }));
    }
    if let Some((c, cloth)) = scene.cloth.iter().enumerate().find(|(_, cloth)| all_held(&cloth.name, cloth.n_nodes())) {
        let error = ClothMistake::AllHeld { cloth: cloth.name.clone(), shapes };
        return Err(SceneError::at(format!("cloth[{c}]"), Mistake::Cloth { error }));
    }
    outside(scene, &held)
}

/// (object, node) of every node that a gripper holds.
fn held(scene: &Scene) -> impl Iterator<Item = (&str, usize)> {
    scene.gripper.iter().flat_map(|gripper| {
        let object = scene.held(gripper);
        let nodes = gripper.clamp.numbers().into_iter();
        nodes.filter_map(move |number| object.and_then(|object| Some((object.name(), object.node(number)?))))
    })
}

fn shapes(scene: &Scene) -> Result<(), SceneError> {
    for (i, plane) in scene.plane.iter().enumerate() {
        not_negative(&format!("plane[{i}].friction"), plane.friction, "-")?;
        if unit(plane.normal).is_none() {
            return Err(SceneError::at(format!("plane[{i}].normal"), Mistake::NoDirection));
        }
    }
    for (i, sphere) in scene.sphere.iter().enumerate() {
        not_negative(&format!("sphere[{i}].friction"), sphere.friction, "-")?;
        positive(&format!("sphere[{i}].radius"), sphere.radius, "m")?;
    }
    for (i, capsule) in scene.capsule.iter().enumerate() {
        not_negative(&format!("capsule[{i}].friction"), capsule.friction, "-")?;
        positive(&format!("capsule[{i}].radius"), capsule.radius, "m")?;
        if capsule.a == capsule.b {
            return Err(SceneError::at(format!("capsule[{i}].b"), Mistake::PointCapsule));
        }
    }
    Ok(())
}

/// No free node may start with its centre inside a shape: contact would push it out through the nearest side, or explode.
fn outside(scene: &Scene, held: &BTreeSet<(&str, usize)>) -> Result<(), SceneError> {
    for (r, rope) in scene.rope.iter().enumerate() {
        for (node, point) in rope_points(scene, r)?.into_iter().enumerate() {
            if held.contains(&(rope.name.as_str(), node)) {
                continue;
            }
            if let Some((shape, distance)) = deepest(scene, &rope.name, point) {
                let mistake = Mistake::Inside { rope: rope.name.clone(), node, depth: -distance, shape };
                return Err(SceneError::at(format!("rope[{r}].initial"), mistake));
            }
        }
    }
    for (c, cloth) in scene.cloth.iter().enumerate() {
        for (node, point) in cloth_points(cloth, c)?.into_iter().enumerate() {
            if held.contains(&(cloth.name.as_str(), node)) {
                continue;
            }
            if let Some((shape, distance)) = deepest(scene, &cloth.name, point) {
                let error = ClothMistake::Inside { cloth: cloth.name.clone(), node, depth: -distance, shape };
                return Err(SceneError::at(format!("cloth[{c}]"), Mistake::Cloth { error }));
            }
        }
    }
    Ok(())
}

/// The shape that a point of an object lies deepest in, of those that touch it, and its distance from the surface [m].
fn deepest(scene: &Scene, object: &str, point: V3) -> Option<(String, f64)> {
    let ignored = |shape: &str| {
        let of_pair = |[a, b]: &[String; 2]| (a == object && b == shape) || (a == shape && b == object);
        scene.contact.pair.iter().any(|rule| rule.ignore && of_pair(&rule.between))
    };
    let (kind, name, distance) =
        distances(scene, point).filter(|(_, name, _)| !ignored(name)).min_by(|a, b| a.2.total_cmp(&b.2))?;
    (distance < -1e-12).then(|| (format!("{kind} \"{name}\""), distance))
}

/// Kind and name of every shape and the distance of a point from its surface [m], negative inside.
fn distances(scene: &Scene, point: V3) -> impl Iterator<Item = (&'static str, &str, f64)> {
    let planes = scene.plane.iter().map(move |s| {
        let normal = unit(s.normal).unwrap_or([0.0, 0.0, 1.0]);
        ("plane", s.name.as_str(), dot(normal, sub(point, s.point)) - s.height)
    });
    let spheres = scene.sphere.iter().map(move |s| ("sphere", s.name.as_str(), norm(sub(point, s.center)) - s.radius));
    let capsules = scene.capsule.iter().map(move |s| {
        let axis = sub(s.b, s.a);
        let along = (dot(sub(point, s.a), axis) / dot(axis, axis)).clamp(0.0, 1.0);
        ("capsule", s.name.as_str(), norm(sub(point, add(s.a, scale(axis, along)))) - s.radius)
    });
    let blocks = scene.block.iter().map(move |s| {
        let y = turned(s.quaternion, sub(point, s.position));
        let over: V3 = std::array::from_fn(|k| y[k].abs() - s.half_extents[k]);
        ("box", s.name.as_str(), over.into_iter().fold(f64::NEG_INFINITY, f64::max))
    });
    let cylinders = scene.cylinder.iter().map(move |s| {
        let y = turned(s.quaternion, sub(point, s.position));
        ("cylinder", s.name.as_str(), (y[0].hypot(y[1]) - s.radius).max(y[2].abs() - s.half_length))
    });
    planes.chain(spheres).chain(capsules).chain(blocks).chain(cylinders)
}

/// A vector of the world in the axes of a quaternion.
fn turned(quaternion: [f64; 4], x: V3) -> V3 {
    let y = pliant_math::rotation::matrix(&quaternion).tr_mul(&pliant_math::Vec3::from(x));
    y.into()
}
