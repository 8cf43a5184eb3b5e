//! Shapes of other formats as those of a scene.

use super::inertia::Shape;
use super::pose::{Pose, plain};
use pliant_math::Vec3;
use pliant_scene::{Block, BodyShape, Capsule, Cylinder, Plane, Scene, ShapeKind, Sphere};

/// Why shapes are left out.
pub const NO_CONTACT: &str = "touches nothing: contact is switched off";

/// A primitive shape of a body at `pose` in its frame; none for an ellipsoid.
pub fn of_body(shape: &Shape, pose: &Pose, friction: f64) -> Option<BodyShape> {
    let (kind, radius, half_length, half_extents) = match *shape {
        Shape::Sphere { radius } => (ShapeKind::Sphere, Some(radius), None, None),
        Shape::Capsule { radius, half } => (ShapeKind::Capsule, Some(radius), Some(half), None),
        Shape::Cylinder { radius, half } => (ShapeKind::Cylinder, Some(radius), Some(half), None),
        Shape::Box { half } => (ShapeKind::Box, None, None, Some(half)),
        Shape::Ellipsoid { .. } => return None,
    };
    let (position, quaternion) = (plain(pose.position.into()), plain(pose.rotation));
    Some(BodyShape { kind, position, quaternion, radius, half_length, half_extents, points: None, friction: Some(friction) })
}

/// The convex hull of points in the axes of `pose`, about their middle.
pub fn hull(points: &[Vec3<f64>], pose: &Pose, friction: f64) -> BodyShape {
    let middle = points.iter().sum::<Vec3<f64>>() / points.len() as f64;
    BodyShape {
        kind: ShapeKind::Hull,
        position: plain(pose.point(&middle).into()),
        quaternion: plain(pose.rotation),
        radius: None,
        half_length: None,
        half_extents: None,
        points: Some(points.iter().map(|p| plain((p - middle).into())).collect()),
        friction: Some(friction),
    }
}

/// The half-space below the plane of x and y of `pose`.
pub fn plane(name: &str, pose: &Pose, friction: f64) -> Plane {
    let (point, normal) = (plain(pose.position.into()), plain(pose.direction(&Vec3::z()).into()));
    Plane { name: name.to_owned(), point, normal, height: 0.0, friction }
}

/// Adds a fixed shape at `pose` in the world; nothing for an ellipsoid.
pub fn add_fixed(scene: &mut Scene, name: &str, shape: &Shape, pose: &Pose, friction: f64) {
    let name = name.to_owned();
    let (position, quaternion) = (plain(pose.position.into()), plain(pose.rotation));
    match *shape {
        Shape::Sphere { radius } => scene.sphere.push(Sphere { name, center: position, radius, friction }),
        Shape::Capsule { radius, half } => {
            let [a, b] = [-half, half].map(|z| plain(pose.point(&Vec3::new(0.0, 0.0, z)).into()));
            scene.capsule.push(Capsule { name, a, b, radius, friction });
        }
        Shape::Cylinder { radius, half } => {
            scene.cylinder.push(Cylinder { name, position, quaternion, radius, half_length: half, friction });
        }
        Shape::Box { half } => scene.block.push(Block { name, position, quaternion, half_extents: half, friction }),
        Shape::Ellipsoid { .. } => {}
    }
}

/// A shape in words.
pub fn words(shape: &Shape) -> &'static str {
    match shape {
        Shape::Sphere { .. } => "a sphere",
        Shape::Capsule { .. } => "a capsule",
        Shape::Cylinder { .. } => "a cylinder",
        Shape::Box { .. } => "a box",
        Shape::Ellipsoid { .. } => "an ellipsoid",
    }
}
