//! Bodies, joints and actuators in a scene file.

use super::shape::BodyShape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rigid body and the joints that carry it. Its parameters are `name.mass`, `name.center_of_mass[0..2]` and `name.spread[0..5]`.
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
    /// Its joints, one after the other; none if it is fixed to its parent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<Joint>,
    /// What it touches others with; a body without shapes goes through everything.
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
            joint: Vec::new(),
            shape: Vec::new(),
        }
    }
}

/// A joint. Its parameters are `name.armature`, `name.damping`, `name.stiffness`, `name.cubic_stiffness`, `name.rest`,
/// `name.friction`, `name.stiction`, `name.stribeck_velocity` and `name.limit[0..1]`, as far as its kind has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// What it lets the body do.
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
    /// Stiffness of a spring [N·m/rad] or [N/m].
    #[serde(default)]
    pub stiffness: f64,
    /// Stiffness of a spring with a force of third order [N·m/rad³] or [N/m³].
    #[serde(default)]
    pub cubic_stiffness: f64,
    /// Coordinate where the springs are at rest [rad] or [m]; revolute and prismatic joints.
    #[serde(default)]
    pub rest: f64,
    /// Dry (Coulomb) friction [N·m] or [N].
    #[serde(default)]
    pub friction: f64,
    /// What holds a joint at rest beyond its dry friction [N·m] or [N]; it fades with speed as exp(−(v/stribeck_velocity)²).
    #[serde(default)]
    pub stiction: f64,
    /// Speed at which stiction has faded by e [rad/s] or [m/s].
    #[serde(default = "stribeck")]
    pub stribeck_velocity: f64,
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
            stiffness: 0.0,
            cubic_stiffness: 0.0,
            rest: 0.0,
            friction: 0.0,
            stiction: 0.0,
            stribeck_velocity: stribeck(),
            limits: None,
            start: Vec::new(),
            velocity: Vec::new(),
        }
    }
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

/// A motor at a revolute or prismatic joint, one control each. Its parameters are `name.gain`, `name.stiffness`, `name.damping`,
/// `name.offset` and `name.gear`, as far as its kind has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Name of the joint it drives.
    pub joint: String,
    /// What it makes of its control.
    pub kind: ActuatorKind,
    /// Torque per unit of control [N·m] or [N]; torque drives.
    #[serde(default = "one")]
    pub gain: f64,
    /// Stiffness of the servo [N·m/rad] or [N/m]; position drives.
    #[serde(default)]
    pub stiffness: f64,
    /// Damping of the servo [N·m·s/rad] or [N·s/m]; position and velocity drives.
    #[serde(default)]
    pub damping: f64,
    /// Torque added to what is commanded [N·m] or [N].
    #[serde(default)]
    pub offset: f64,
    /// Turns of the motor per turn of the joint [-]; torques grow by as much.
    #[serde(default = "one")]
    pub gear: f64,
    /// Control in `simulate` and `gradcheck`; logs override it.
    #[serde(default)]
    pub command: Command,
}

fn one() -> f64 {
    1.0
}

impl Default for Actuator {
    fn default() -> Self {
        Self {
            name: "motor".to_owned(),
            joint: "joint".to_owned(),
            kind: ActuatorKind::Torque,
            gain: 1.0,
            stiffness: 0.0,
            damping: 0.0,
            offset: 0.0,
            gear: 1.0,
            command: Command::default(),
        }
    }
}

/// Kinds of actuators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ActuatorKind {
    /// Control is a torque, in units of `gain`: gear · (gain · u + offset).
    Torque,
    /// Control is a position of the motor [rad] or [m]: gear · (stiffness · (u − gear · q) − damping · gear · v + offset).
    Position,
    /// Control is a velocity of the motor [rad/s] or [m/s]: gear · (damping · (u − gear · v) + offset).
    Velocity,
}

/// A control over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Command {
    /// Constant.
    Hold {
        /// Value.
        #[serde(default)]
        value: f64,
    },
    /// mean + amplitude · sin(2π frequency t + phase).
    Sine {
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Amplitude.
        amplitude: f64,
        /// Frequency [Hz].
        frequency: f64,
        /// Phase at t = 0 [rad].
        #[serde(default)]
        phase: f64,
    },
}

impl Default for Command {
    fn default() -> Self {
        Self::Hold { value: 0.0 }
    }
}

impl Command {
    /// Value at time `t` [s].
    pub fn at(&self, t: f64) -> f64 {
        match self {
            Self::Hold { value } => *value,
            Self::Sine { mean, amplitude, frequency, phase } => {
                mean + amplitude * (std::f64::consts::TAU * frequency * t + phase).sin()
            }
        }
    }
}
