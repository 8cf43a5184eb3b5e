//! Motors in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A motor at a revolute or prismatic joint, one control each. Its parameters are `name.gain`, `name.stiffness`, `name.damping`,
/// `name.offset` and `name.gear`, as far as its kind has them, and `name.delta_scale`, `name.delay`, `name.lag` and
/// `name.saturation[0..1]` if the keys are given.
///
/// A command is held over each step. It goes through the controller (`delta_scale`), the delay and the lag; over a step the motor
/// receives the mean of their output, so its impulse is exact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Name of the joint it drives.
    pub joint: String,
    /// Its kind: the law from control to torque.
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
    /// Torque added to the commanded one [N·m] or [N].
    #[serde(default)]
    pub offset: f64,
    /// Turns of the motor per turn of the joint [-]; torques grow by as much.
    #[serde(default = "one")]
    pub gear: f64,
    /// Makes commands steps of a target: the control, cut to [−1, 1], times this is added to the target once per step [rad] or [m];
    /// position drives. SILO's delta controller has 0.1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_scale: Option<f64>,
    /// Time until a command reaches the motor [s]; any, also parts of a step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay: Option<f64>,
    /// Longest delay that a fit may try [s]; twice the delay if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_delay: Option<f64>,
    /// Time constant of a first-order lag behind the (delayed) command [s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag: Option<f64>,
    /// Least and largest torque of the motor, before the gear [N·m] or [N].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saturation: Option<[f64; 2]>,
    /// Command before the simulation, with which target, delay and lag begin, in the unit of the control [-]. If left out, a position
    /// drive was commanded to where the joint starts, and others nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f64>,
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
            delta_scale: None,
            delay: None,
            max_delay: None,
            lag: None,
            saturation: None,
            start: None,
            command: Command::default(),
        }
    }
}

/// Kinds of actuators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ActuatorKind {
    /// Control is a torque, in units of `gain`: gear · (gain · u + offset), with the motor's side of the gear within `saturation`.
    Torque,
    /// Control is a position of the motor [rad] or [m]: gear · (stiffness · (u − gear · q) − damping · gear · v + offset).
    Position,
    /// Control is a velocity of the motor [rad/s] or [m/s]: gear · (damping · (u − gear · v) + offset).
    Velocity,
}

impl Actuator {
    /// Longest delay a fit may try [s], if there is one.
    pub fn longest_delay(&self) -> Option<f64> {
        self.delay.map(|delay| self.max_delay.unwrap_or(2.0 * delay))
    }
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
