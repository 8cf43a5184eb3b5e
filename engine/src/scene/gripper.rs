//! Grippers in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A clamp that drives nodes of a rope or of a sheet of cloth. Its parameters are `name.offset[0..2]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gripper {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Name of the rope it holds. Either this or `cloth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rope: Option<String>,
    /// Name of the sheet of cloth it holds, by nodes. Either this or `rope`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
    /// What of it the gripper holds.
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
    /// Rate at which it turns what it holds of a rope that twists about the rope's direction, in `simulate` and `gradcheck` [rad/s].
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

/// What a gripper holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Clamp {
    /// These nodes; negative numbers count from the end.
    Nodes(Vec<i64>),
    /// The end edge: position and direction.
    End(End),
}

impl Clamp {
    /// Numbers of the nodes it holds, without the ghost of an end edge; as the scene counts them.
    pub fn numbers(&self) -> Vec<i64> {
        match self {
            Self::Nodes(nodes) => nodes.clone(),
            Self::End(End::First) => vec![0],
            Self::End(End::Last) => vec![-1],
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

/// How a gripper is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// By the positions at the end of each step [m].
    #[default]
    Prescribed,
    /// By the velocities during each step [m/s], [rad/s].
    Velocity,
}

/// Motion of a gripper, starting where the rope is.
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
}
