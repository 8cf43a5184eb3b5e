//! Grippers in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A clamp that drives nodes of a rope or of a sheet of cloth, or a point that grasps the nearest point within reach. Its parameters are
/// `name.offset[0..2]`; of one that grasps also `name.stiffness`, `radius`, `steepness`, `closing_time`, `smoothing`, `tail`, `tail_reach`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gripper {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Name of the rope it holds or may grasp. Either this or `cloth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rope: Option<String>,
    /// Name of the sheet of cloth it holds, by nodes, or may grasp. Either this or `rope`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
    /// The part of it that the gripper holds.
    #[serde(flatten)]
    pub clamp: Clamp,
    /// Driven by positions or by velocities.
    #[serde(default)]
    pub mode: Mode,
    /// Constant shift of the commanded positions [m].
    #[serde(default)]
    pub offset: [f64; 3],
    /// Turn of the material axes it holds of a rope that twists, about the rope's direction, from where its controls (or, of clamped
    /// nodes, the scene's beginning) have them [rad].
    #[serde(default)]
    pub roll: f64,
    /// By how much that turn grows with the direction of the edge it holds: a·(t − t₀), t₀ the unit direction as the scene begins [rad].
    #[serde(default)]
    pub roll_by_direction: [f64; 3],
    /// By how much it grows with the place of the edge's first node: b·(x − x₀), x₀ its place as the scene begins [rad/m].
    #[serde(default)]
    pub roll_by_position: [f64; 3],
    /// Rate at which it turns the held part of a rope with a twist about the rope's direction, in `simulate` and `gradcheck` [rad/s].
    #[serde(default)]
    pub spin: f64,
    /// Motion in `simulate` and `gradcheck`; logs override it.
    #[serde(default)]
    pub motion: Motion,
}

impl Default for Gripper {
    fn default() -> Self {
        Self {
            name: "hand".to_owned(),
            rope: Some("rope".to_owned()),
            cloth: None,
            clamp: Clamp::Nodes(vec![0]),
            mode: Mode::default(),
            offset: [0.0; 3],
            roll: 0.0,
            roll_by_direction: [0.0; 3],
            roll_by_position: [0.0; 3],
            spin: 0.0,
            motion: Motion::default(),
        }
    }
}

/// Part of a rope or sheet that a gripper holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Clamp {
    /// These nodes; negative numbers count from the end.
    Nodes(Vec<i64>),
    /// The end edge: position and direction.
    End(End),
    /// The point nearest to it when it closes, if that is within reach.
    Grasp(Grasp),
}

/// A gripper's point that seizes the nearest point of its rope or sheet when it closes near it, and holds that by a spring. Its
/// controls are a position [m] or a velocity [m/s], and the closing c [-]: the spring is stiffness / (1 + exp(−steepness (c − 1/2))), and
/// below c = 1/2 the gripper lets go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Grasp {
    /// Where its point begins [m].
    pub at: [f64; 3],
    /// Farthest distance of its point from the rope's centreline or the sheet at which it seizes [m].
    pub radius: f64,
    /// Stiffness of the spring, fully closed [N/m].
    pub stiffness: f64,
    /// Steepness of the closing around c = 1/2 [-].
    pub steepness: f64,
    /// Time constant with which the seized point is drawn to the gripper's [s]; 0 for at once.
    pub closing_time: f64,
    /// Width of the reach in smoothed steps, for surrogate gradients [m].
    pub smoothing: f64,
    /// Part of the spring that smoothed steps feel at a distance [-], from 0 to 1.
    pub tail: f64,
    /// Distance at which that part has fallen to one half [m]; the radius if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tail_reach: Option<f64>,
    /// The closing c [-] in `simulate` and `gradcheck`, as [time [s], c], straight lines between; closed if left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub closing: Vec<[f64; 2]>,
}

impl Grasp {
    /// Distance at which the smoothed pull's tail has fallen to one half [m].
    pub fn far(&self) -> f64 {
        self.tail_reach.unwrap_or(self.radius)
    }

    /// The closing at time t [s].
    pub fn closing_at(&self, t: f64) -> f64 {
        let Some(last) = self.closing.last() else { return 1.0 };
        let after = self.closing.iter().position(|[time, _]| *time > t);
        match after {
            None => last[1],
            Some(0) => self.closing[0][1],
            Some(k) => {
                let ([t0, c0], [t1, c1]) = (self.closing[k - 1], self.closing[k]);
                c0 + (c1 - c0) * (t - t0) / (t1 - t0)
            }
        }
    }
}

impl Default for Grasp {
    fn default() -> Self {
        Self {
            at: [0.0; 3],
            radius: 0.01,
            stiffness: 1000.0,
            steepness: 15.0,
            closing_time: 0.05,
            smoothing: 1e-3,
            tail: 1e-3,
            tail_reach: None,
            closing: Vec::new(),
        }
    }
}

impl Clamp {
    /// Numbers of the nodes it holds, without the ghost of an end edge; as the scene counts them.
    pub fn numbers(&self) -> Vec<i64> {
        match self {
            Self::Nodes(nodes) => nodes.clone(),
            Self::End(End::First) => vec![0],
            Self::End(End::Last) => vec![-1],
            Self::Grasp(_) => Vec::new(),
        }
    }
}

/// Ends of a rope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// Node 0.
    First,
    /// The last node.
    Last,
}

/// Commands that drive a gripper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// By the positions at the end of each step [m].
    #[default]
    Prescribed,
    /// By the velocities during each step [m/s], [rad/s].
    Velocity,
}

/// Motion of a gripper, starting where the rope is, or its own point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Motion {
    /// At rest.
    #[default]
    Hold,
    /// At constant velocity.
    Line {
        /// Velocity [m/s].
        velocity: [f64; 3],
    },
    /// amplitude · (sin(2π frequency t + phase) − sin(phase)).
    Sine {
        /// Amplitude [m].
        amplitude: [f64; 3],
        /// Frequency [Hz].
        frequency: f64,
        /// Phase at t = 0 [rad].
        #[serde(default)]
        phase: f64,
    },
    /// From point to point, at rest in each of them: 3 s² − 2 s³ of the way at the part s of the time between two.
    Path {
        /// Displacements as [time [s], x, y, z [m]]; before the first and after the last it rests there.
        points: Vec<[f64; 4]>,
    },
}
