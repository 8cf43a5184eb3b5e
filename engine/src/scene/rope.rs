//! Ropes in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rope, cable or rod: nodes joined by edges. Its parameters are `name.length`, `name.bend_stiffness`, …
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Number of nodes, with equal edges between them; at most 10⁶ in a scene. Either this or `edge_fractions`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<usize>,
    /// Rest length of each edge as a part of `length` [-], scaled to sum 1. Either this or `nodes`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edge_fractions: Option<Vec<f64>>,
    /// Rest length [m].
    pub length: f64,
    /// Mass per length ρA [kg/m].
    pub linear_density: f64,
    /// Stretch stiffness EA [N].
    pub stretch_stiffness: f64,
    /// Stretch damping c_s [N·s].
    #[serde(default)]
    pub stretch_damping: f64,
    /// Bending stiffness EI [N·m²].
    #[serde(default)]
    pub bend_stiffness: f64,
    /// Bending damping c_b [N·m²·s].
    #[serde(default)]
    pub bend_damping: f64,
    /// Linear air drag per length [kg/(m·s)].
    #[serde(default)]
    pub drag_linear: f64,
    /// Quadratic air drag per length [kg/m²].
    #[serde(default)]
    pub drag_quadratic: f64,
    /// Mass added at the last node [kg].
    #[serde(default)]
    pub tip_mass: f64,
    /// Radius [m]; used by contact.
    #[serde(default)]
    pub radius: f64,
    /// Masses added at nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub node_mass: Vec<NodeMass>,
    /// Where its nodes are at the beginning.
    pub initial: Initial,
    /// Whether `initial` is the start, or the guess of an equilibrium.
    #[serde(default)]
    pub start: Start,
    /// Initial velocity of every node [m/s].
    #[serde(default)]
    pub velocity: [f64; 3],
}

impl Default for Rope {
    fn default() -> Self {
        Self {
            name: "rope".to_owned(),
            nodes: Some(13),
            edge_fractions: None,
            length: 1.0,
            linear_density: 0.05,
            stretch_stiffness: 1.0e4,
            stretch_damping: 0.0,
            bend_stiffness: 1.0e-3,
            bend_damping: 0.0,
            drag_linear: 0.0,
            drag_quadratic: 0.0,
            tip_mass: 0.0,
            radius: 0.003,
            node_mass: Vec::new(),
            initial: Initial::default(),
            start: Start::default(),
            velocity: [0.0; 3],
        }
    }
}

impl Rope {
    /// Number of nodes, without ghosts; 0 if the scene gives neither `nodes` nor `edge_fractions`.
    pub fn n_nodes(&self) -> usize {
        self.edge_fractions.as_ref().map_or(self.nodes.unwrap_or(0), |f| f.len() + 1)
    }

    /// The node of that number, negative ones counted from the end; `None` if there is no such node.
    pub fn node(&self, number: i64) -> Option<usize> {
        let n = self.n_nodes();
        let index = if number < 0 { number.checked_add(i64::try_from(n).ok()?)? } else { number };
        usize::try_from(index).ok().filter(|index| *index < n)
    }

    /// Rest length of each edge as a part of the rope's length; they sum to 1.
    pub fn fractions(&self) -> Vec<f64> {
        match &self.edge_fractions {
            Some(given) => {
                let sum: f64 = given.iter().sum();
                given.iter().map(|f| f / sum).collect()
            }
            None => {
                let edges = self.n_nodes().saturating_sub(1);
                vec![1.0 / edges as f64; edges]
            }
        }
    }
}

/// A mass added at a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeMass {
    /// Node number; negative numbers count from the end.
    pub node: i64,
    /// Added mass [kg].
    pub mass: f64,
}

/// Where a rope's nodes are at the beginning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "lowercase", deny_unknown_fields)]
pub enum Initial {
    /// On a line, at rest length.
    Straight {
        /// Position of the first node [m].
        from: [f64; 3],
        /// Direction from the first node to the last (of any length).
        direction: [f64; 3],
    },
    /// Between two points, hanging through by a parabola along gravity.
    Between {
        /// Position of the first node [m].
        from: [f64; 3],
        /// Position of the last node [m].
        to: [f64; 3],
        /// Depth of the parabola's middle below the chord [m]; without it, as deep as the rest length asks for.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sag: Option<f64>,
    },
    /// Node by node.
    Points {
        /// Position of each node [m].
        points: Vec<[f64; 3]>,
    },
}

impl Default for Initial {
    fn default() -> Self {
        Self::Straight { from: [0.0; 3], direction: [1.0, 0.0, 0.0] }
    }
}

/// How a rope starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At the initial positions.
    #[default]
    AsGiven,
    /// At the equilibrium found from the initial positions, with the grippers' first inputs.
    Equilibrium,
}
