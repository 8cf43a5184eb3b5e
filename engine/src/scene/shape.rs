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
