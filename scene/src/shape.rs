//! Fixed shapes in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A half-space: everything below it is solid. Its parameters are `name.height`, `name.friction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// A point of the plane [m].
    #[serde(default)]
    pub point: [f64; 3],
    /// Outward normal (of any length).
    #[serde(default = "up")]
    pub normal: [f64; 3],
    /// Shift along the normal [m].
    #[serde(default)]
    pub height: f64,
    /// Friction coefficient [-].
    #[serde(default)]
    pub friction: f64,
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl Default for Plane {
    fn default() -> Self {
        Self { name: "floor".to_owned(), point: [0.0; 3], normal: up(), height: 0.0, friction: 0.0 }
    }
}

/// A ball. Its parameters are `name.center[0..2]`, `name.radius`, `name.friction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Center [m].
    pub center: [f64; 3],
    /// Radius [m].
    pub radius: f64,
    /// Friction coefficient [-].
    #[serde(default)]
    pub friction: f64,
}

/// The points within `radius` of the segment from `a` to `b`.
/// Its parameters are `name.a[0..2]`, `name.b[0..2]`, `name.radius`, `name.friction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Capsule {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// One end of the segment [m].
    pub a: [f64; 3],
    /// The other end of the segment [m].
    pub b: [f64; 3],
    /// Radius [m].
    pub radius: f64,
    /// Friction coefficient [-].
    #[serde(default)]
    pub friction: f64,
}

/// A cuboid. Its parameters are `name.position[0..2]`, `name.half_extent[0..2]`, `name.friction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Its middle [m].
    #[serde(default)]
    pub position: [f64; 3],
    /// Its orientation, a unit quaternion (w, x, y, z) [-].
    #[serde(default = "upright")]
    pub quaternion: [f64; 4],
    /// Half of its edges along its own axes [m].
    pub half_extents: [f64; 3],
    /// Friction coefficient [-].
    #[serde(default)]
    pub friction: f64,
}

/// A cylinder with flat ends about its own z axis.
/// Its parameters are `name.position[0..2]`, `name.radius`, `name.half_length`, `name.friction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Its middle [m].
    #[serde(default)]
    pub position: [f64; 3],
    /// Its orientation, a unit quaternion (w, x, y, z) [-].
    #[serde(default = "upright")]
    pub quaternion: [f64; 4],
    /// Radius [m].
    pub radius: f64,
    /// Half of its length [m].
    pub half_length: f64,
    /// Friction coefficient [-].
    #[serde(default)]
    pub friction: f64,
}

pub(super) fn upright() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

/// A shape that a body carries. Its parameters are `body.shape[k].position[0..2]`, `.radius`, `.half_length` or `.half_extent[0..2]` as
/// its kind has them, and `.friction` if it has one of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyShape {
    /// Its kind.
    pub kind: ShapeKind,
    /// Its middle in the body's frame [m].
    #[serde(default)]
    pub position: [f64; 3],
    /// Its orientation in the body's frame, a unit quaternion (w, x, y, z) [-].
    #[serde(default = "upright")]
    pub quaternion: [f64; 4],
    /// Radius of a sphere, a capsule or a cylinder [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Half the length of a cylinder, or of a capsule's axis between the centres of its round ends, along its own z axis [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_length: Option<f64>,
    /// Half of a box's edges along its own axes [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_extents: Option<[f64; 3]>,
    /// Points in the shape's own frame whose convex hull it is [m]; 4 to 256, not all in one plane. They are not parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// Friction coefficient [-]. Between two shapes their mean counts; a shape without one of its own takes its partner's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
}

/// Kinds of shapes that bodies carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShapeKind {
    /// A ball of `radius`.
    Sphere,
    /// Points within `radius` of a segment of the own z axis, `half_length` to either side.
    Capsule,
    /// Round about the own z axis, with flat ends: `radius` and `half_length`.
    Cylinder,
    /// A cuboid: `half_extents`.
    Box,
    /// A convex polyhedron, the hull of `points`.
    Hull,
}

/// Rule for two objects that may touch. Its parameters are `contact.pair[k].friction` and `contact.pair[k].compliance`,
/// as far as they are given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactRule {
    /// Names of two objects: bodies, ropes, sheets of cloth or fixed shapes.
    pub between: [String; 2],
    /// Whether they pass through each other.
    #[serde(default)]
    pub ignore: bool,
    /// Friction coefficient between them [-], instead of their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Compliance of each contact point between them [m/N]. For bodies only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compliance: Option<f64>,
}
