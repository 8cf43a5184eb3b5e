//! Bodies and joints in a scene file.

use super::shape::BodyShape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rigid body and the joints that carry it. Its parameters are `name.mass`, `name.center_of_mass[0..2]` and `name.spread[0..5]`, and
/// `name.drag_area` if the key is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Name of the body it hangs on; the world if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Origin in the parent's frame with all joints at zero [m]; of a body with a free joint, its start.
    #[serde(default)]
    pub position: [f64; 3],
    /// Orientation in the parent's frame with all joints at zero, a unit quaternion (w, x, y, z) [-]; of a body with a free joint,
    /// its start.
    #[serde(default = "upright")]
    pub quaternion: [f64; 4],
    /// Mass [kg]; 0 for a frame that only holds others.
    #[serde(default)]
    pub mass: f64,
    /// Centre of mass in the body's frame [m].
    #[serde(default)]
    pub center_of_mass: [f64; 3],
    /// Moments of inertia about the centre of mass in the body's axes: xx, yy, zz, xy, xz, yz [kg·m²]. Products are entries of the
    /// matrix, −∫ x y dm. Needed if there is mass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia: Option<[f64; 6]>,
    /// Area times drag coefficient A [m²], a parameter `name.drag_area` if given: in air of `air.density` ρ, `air.viscosity` η and velocity
    /// `air.wind` the force −(6 η √(π A) + ½ ρ A |u|) u acts at the centre of mass, u its velocity less the wind. If left out, a quarter of
    /// the surface of the box that has the body's mass and inertia, which is what it shows on average to any direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drag_area: Option<f64>,
    /// Its joints, one after the other; none if it is fixed to its parent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<Joint>,
    /// Its collision shapes; a body without shapes goes through everything.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<BodyShape>,
}

fn upright() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl Default for Body {
    fn default() -> Self {
        Self {
            name: "body".to_owned(),
            parent: None,
            position: [0.0; 3],
            quaternion: upright(),
            mass: 0.0,
            center_of_mass: [0.0; 3],
            inertia: None,
            drag_area: None,
            joint: Vec::new(),
            shape: Vec::new(),
        }
    }
}

/// A joint. Its parameters are `name.armature`, `name.damping`, `name.quadratic_damping`, `name.stiffness`,
/// `name.cubic_stiffness`, `name.rest`, `name.friction`, `name.stiction`, `name.stribeck_velocity` and `name.limit[0..1]`, as far
/// as its kind has them, and `name.friction_backward`, `name.load_friction`, `name.plastic_time`, `name.yield`,
/// `name.gravity_compensation`, `name.cogging_sine` and `name.cogging_cosine`, `name.presliding_friction` and
/// `name.presliding_distance` if the keys are given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Its kind: the motion that it allows the body.
    pub kind: JointKind,
    /// Axis in the body's frame [-], of any length; for revolute, prismatic and universal joints.
    #[serde(default = "upwards")]
    pub axis: [f64; 3],
    /// The second axis of a universal joint, in the frame reached by turning about the first [-].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_axis: Option<[f64; 3]>,
    /// The joint's fixed point in the body's frame [m].
    #[serde(default)]
    pub anchor: [f64; 3],
    /// Inertia of a rotor seen at the joint [kg·m²] or, for a prismatic one, [kg].
    #[serde(default)]
    pub armature: f64,
    /// Viscous friction [N·m·s/rad] or [N·s/m].
    #[serde(default)]
    pub damping: f64,
    /// Damping that grows with the square of the speed, as of air and fluids [N·m·s²/rad²] or [N·s²/m²]: −`quadratic_damping` |v| v.
    #[serde(default)]
    pub quadratic_damping: f64,
    /// Stiffness of a spring [N·m/rad] or [N/m].
    #[serde(default)]
    pub stiffness: f64,
    /// Stiffness of a spring with a force of third order [N·m/rad³] or [N/m³].
    #[serde(default)]
    pub cubic_stiffness: f64,
    /// Coordinate where the springs are at rest [rad] or [m]; revolute and prismatic joints.
    #[serde(default)]
    pub rest: f64,
    /// Time in which a load that is held creeps once more by its elastic deflection [s]: the springs become Maxwell elements, with the
    /// elastic part e of the coordinate and e' = q' − e/plastic_time. A rest that follows the joint by a part β of its deflection every
    /// h₀ (SILO: h₀ = 1/240 s) has plastic_time = h₀/β.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plastic_time: Option<f64>,
    /// Elastic part beyond which alone it creeps [rad] or [m]: e' = q' − sign(e) max(|e| − yield, 0)/plastic_time; of a ball, for each
    /// axis of its rotation vector.
    #[serde(rename = "yield", skip_serializing_if = "Option::is_none")]
    pub yield_at: Option<f64>,
    /// Plastic deflection of the joint at the start [rad] or [m], one number per degree of freedom: it is at rest at rest + plastic_start.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plastic_start: Vec<f64>,
    /// Part of the weight beyond the joint that its motor carries [-]: its torque is this times the one that would hold the scene's arm still.
    /// 1 at every joint holds an arm wherever it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_compensation: Option<f64>,
    /// Torque that repeats with the angle; revolute joints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cogging: Option<Cogging>,
    /// Dry (Coulomb) friction [N·m] or [N].
    #[serde(default)]
    pub friction: f64,
    /// Dry friction against negative velocities [N·m] or [N]; `friction` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_backward: Option<f64>,
    /// Dry friction per torque of springs and motors at the joint [-], added in both directions; the torque is that at the end of the
    /// last step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_friction: Option<f64>,
    /// Friction that holds a joint at rest beyond its dry friction [N·m] or [N]; it fades with speed as exp(−(v/stribeck_velocity)²).
    #[serde(default)]
    pub stiction: f64,
    /// Speed at which stiction has faded by e [rad/s] or [m/s].
    #[serde(default = "stribeck")]
    pub stribeck_velocity: f64,
    /// Friction that builds up along the way (Dahl), beside the dry friction; joints of one or two axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub presliding: Option<Presliding>,
    /// Lowest and highest coordinate [rad] or [m]; hard stops without rebound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<[f64; 2]>,
    /// Coordinate at the start [rad] or [m]: one number, two for a universal joint; none for ball and free joints, which start as the
    /// body stands.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start: Vec<f64>,
    /// Velocity at the start, one number per degree of freedom, [rad/s] or [m/s]: a ball's in the body's axes, a free body's
    /// velocity in the world's axes and then its angular velocity in its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<f64>,
}

fn stribeck() -> f64 {
    0.1
}

fn upwards() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl Default for Joint {
    fn default() -> Self {
        Self {
            name: "joint".to_owned(),
            kind: JointKind::Revolute,
            axis: upwards(),
            second_axis: None,
            anchor: [0.0; 3],
            armature: 0.0,
            damping: 0.0,
            quadratic_damping: 0.0,
            stiffness: 0.0,
            cubic_stiffness: 0.0,
            rest: 0.0,
            plastic_time: None,
            yield_at: None,
            plastic_start: Vec::new(),
            gravity_compensation: None,
            cogging: None,
            friction: 0.0,
            friction_backward: None,
            load_friction: None,
            stiction: 0.0,
            stribeck_velocity: stribeck(),
            presliding: None,
            limits: None,
            start: Vec::new(),
            velocity: Vec::new(),
        }
    }
}

/// Torque of a motor's magnets that repeats with the angle q of its joint: sine · sin(cycles · q) + cosine · cos(cycles · q).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cogging {
    /// Cycles per turn of the joint [-], 2 or more: the least common multiple of the motor's poles and slots, times the gear ratio.
    pub cycles: u32,
    /// Amplitude of the sine [N·m].
    #[serde(default)]
    pub sine: f64,
    /// Amplitude of the cosine [N·m].
    #[serde(default)]
    pub cosine: f64,
}

/// Friction that builds up along the way (Dahl's): friction · e/distance against the motion, with the elastic part e of the coordinate,
/// e' = q' − |q'| e/distance, zero as the scene begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Presliding {
    /// What it grows to [N·m] or [N].
    pub friction: f64,
    /// Way along which it grows to that but for a part of 1/e [rad] or [m].
    pub distance: f64,
}

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Turns about an axis.
    Revolute,
    /// Slides along an axis.
    Prismatic,
    /// Turns about an axis, and then about another that turned with it.
    Universal,
    /// Turns any way about a point.
    Ball,
    /// Moves any way; only for bodies of the world.
    Free,
}

impl JointKind {
    /// Degrees of freedom.
    pub fn n_dofs(self) -> usize {
        match self {
            Self::Revolute | Self::Prismatic => 1,
            Self::Universal => 2,
            Self::Ball => 3,
            Self::Free => 6,
        }
    }

    /// Numbers of `start`.
    pub fn n_start(self) -> usize {
        match self {
            Self::Revolute | Self::Prismatic => 1,
            Self::Universal => 2,
            Self::Ball | Self::Free => 0,
        }
    }
}

/// Two bodies held together beside their joints, or a body held to the world: closes a kinematic loop. Its parameters are
/// `name.first[0..2]`, `name.second[0..2]` and, if it is given, `name.compliance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Closure {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Its kind: the relation that it holds.
    pub kind: ClosureKind,
    /// A body.
    pub body: String,
    /// The other body; the world if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// The point that is held, in the first body's frame [m].
    #[serde(default)]
    pub point: [f64; 3],
    /// The point it is held at, in the other's frame [m]; where the first one is as the scene begins, if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_point: Option<[f64; 3]>,
    /// Its compliance [m/N], and that of a weld's turn [rad/(N·m)]; as small as that of contact if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compliance: Option<f64>,
}

/// Kinds of closures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClosureKind {
    /// A point: a ball joint.
    Connect,
    /// A point and the axes, as they are to each other when the scene begins.
    Weld,
}
