//! Task files: cost and constraints of a plan, declared.
//!
//! ```toml
//! schema_version = 1
//! scene = "lift.toml"                    # beside the task's file
//! steps = 200                            # of a plan; a controller looks `horizon` steps ahead
//! horizon = 20
//! [[cost]]
//! kind = "nodes"                         # weight · Σ |p − goal|² over the nodes
//! object = "rope"
//! line = { from = [0, 0, 0.05], to = [0.3, 0, 0.05] }   # or goal = [[x, y, z], …], a point per node
//! [[cost]]
//! kind = "inputs"                        # weight · Σ u²
//! inputs = ["left.velocity.x", "left.velocity.y", "left.velocity.z"]
//! weight = 0.1
//! [[limit]]
//! kind = "inputs"
//! inputs = ["left.velocity.x", "left.velocity.y", "left.velocity.z"]
//! lower = -0.2
//! upper = 0.2
//! [sensing]                              # what a controller reads; without it, it knows the state
//! delay = 2                              # steps
//! sensor = [{ kind = "nodes", object = "rope", noise = 0.001 }]
//! ```
//! Costs are summed over the steps' ends k = 1 … N (inputs: k = 0 … N − 1), or taken at the end alone (`when = "end"`).

mod evaluate;
mod resolve;

pub use resolve::TaskProblem;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A task file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Version of the format: 1.
    pub schema_version: u32,
    /// File of the scene, beside the task's.
    #[serde(default)]
    pub scene: String,
    /// Steps of a plan.
    pub steps: usize,
    /// Steps that a controller looks ahead; the whole plan if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<usize>,
    /// Costs.
    #[serde(default)]
    pub cost: Vec<Cost>,
    /// Limits.
    #[serde(default)]
    pub limit: Vec<Limit>,
    /// Sensors of a controller; it knows the state if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensing: Option<Sensing>,
}

/// Sensors of a controller, which estimates the state from their readings; whether a grasping gripper holds something is always read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensing {
    /// Steps from a state to the decision that knows its reading.
    #[serde(default)]
    pub delay: usize,
    /// Radius of the ball about the scene's start in which the free nodes begin [m].
    #[serde(default)]
    pub initial: f64,
    /// Sensors.
    pub sensor: Vec<Sensor>,
}

/// A sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Sensor {
    /// Positions of nodes of a rope or a cloth.
    Nodes {
        /// The rope or cloth.
        object: String,
        /// Its nodes, all if left out; negative numbers count from the end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        nodes: Option<Vec<i64>>,
        /// Standard deviation of each coordinate's noise [m].
        noise: f64,
    },
    /// The position of a gripper that grasps.
    Gripper {
        /// The gripper.
        gripper: String,
        /// Standard deviation of each coordinate's noise [m].
        noise: f64,
    },
    /// The coordinate of a joint that has one.
    Joint {
        /// The joint.
        joint: String,
        /// Standard deviation of its noise [rad or m].
        noise: f64,
    },
}

/// When a cost counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// At the end of every step.
    #[default]
    Always,
    /// At the end of the last step.
    End,
}

/// A straight line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Goal of the first node [m].
    pub from: [f64; 3],
    /// Goal of the last node [m].
    pub to: [f64; 3],
}

fn one() -> f64 {
    1.0
}

fn all_axes() -> [f64; 3] {
    [1.0; 3]
}

/// A cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Cost {
    /// weight · Σ |a ∘ (p − goal)|² over nodes of a rope or a cloth [m²].
    Nodes {
        /// The rope or cloth.
        object: String,
        /// Its nodes, all if left out; negative numbers count from the end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        nodes: Option<Vec<i64>>,
        /// Where they are to be, one point per node [m]; or `line`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        goal: Option<Vec<[f64; 3]>>,
        /// Where they are to be, at equal distances on a line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        line: Option<Line>,
        /// Weight [1/m²].
        #[serde(default = "one")]
        weight: f64,
        /// Factors a of the coordinates: [0, 0, 1] is a height alone.
        #[serde(default = "all_axes")]
        axes: [f64; 3],
        /// When it counts.
        #[serde(default)]
        when: When,
    },
    /// weight · (|p_i − p_j| − distance)² of two nodes of a rope or a cloth [m²].
    Distance {
        /// The rope or cloth.
        object: String,
        /// Its two nodes; negative numbers count from the end.
        nodes: [i64; 2],
        /// Their distance [m].
        distance: f64,
        /// Weight [1/m²].
        #[serde(default = "one")]
        weight: f64,
        /// When it counts.
        #[serde(default)]
        when: When,
    },
    /// weight · (q − goal)² of a joint of one coordinate.
    Joint {
        /// The joint.
        joint: String,
        /// Its coordinate [rad or m].
        goal: f64,
        /// Weight [1/rad² or 1/m²].
        #[serde(default = "one")]
        weight: f64,
        /// When it counts.
        #[serde(default)]
        when: When,
    },
    /// weight · q̇² of a joint of one coordinate.
    JointSpeed {
        /// The joint.
        joint: String,
        /// Weight [s²/rad² or s²/m²].
        #[serde(default = "one")]
        weight: f64,
        /// When it counts.
        #[serde(default)]
        when: When,
    },
    /// weight · |a ∘ (p − goal)|² of a point of a body [m²].
    Body {
        /// The body.
        body: String,
        /// The point, in the body's axes [m].
        #[serde(default)]
        point: [f64; 3],
        /// Where it is to be [m].
        goal: [f64; 3],
        /// Weight [1/m²].
        #[serde(default = "one")]
        weight: f64,
        /// Factors a of the coordinates.
        #[serde(default = "all_axes")]
        axes: [f64; 3],
        /// When it counts.
        #[serde(default)]
        when: When,
    },
    /// weight · Σ (u − target)².
    Inputs {
        /// Names of inputs.
        inputs: Vec<String>,
        /// Where they are to be, in their units.
        #[serde(default)]
        target: f64,
        /// Weight, one over the square of their unit.
        #[serde(default = "one")]
        weight: f64,
    },
    /// weight · max(0, d − inside)², d from a grasping gripper that holds nothing to the nearest point of what it may seize [m²].
    Reach {
        /// The gripper.
        gripper: String,
        /// Distance from which on nothing is gained [m].
        inside: f64,
        /// Weight [1/m²].
        weight: f64,
    },
}

fn price() -> f64 {
    1e3
}

/// Something that must hold; but for inputs, at a price per metre or radian of its violation (exact where the price is above the limit's
/// multiplier), so that every problem has a solution and reports what it violates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Limit {
    /// lower ≤ u ≤ upper. These hold always.
    Inputs {
        /// Names of inputs.
        inputs: Vec<String>,
        /// Lowest value, in their units.
        lower: f64,
        /// Highest value, in their units.
        upper: f64,
    },
    /// Nodes stay outside a sphere or a capsule.
    Outside {
        /// The rope or cloth.
        object: String,
        /// Its nodes, all if left out; negative numbers count from the end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        nodes: Option<Vec<i64>>,
        /// One end of its axis [m].
        a: [f64; 3],
        /// The other end [m]; a sphere if left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        b: Option<[f64; 3]>,
        /// Distance from the axis that is kept [m].
        radius: f64,
        /// Price of a violation [1/m].
        #[serde(default = "price")]
        price: f64,
    },
    /// Nodes stay above a plane: normal · p ≥ offset.
    Above {
        /// The rope or cloth.
        object: String,
        /// Its nodes, all if left out; negative numbers count from the end.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        nodes: Option<Vec<i64>>,
        /// Normal, a unit vector [-].
        normal: [f64; 3],
        /// Offset [m].
        offset: f64,
        /// Price of a violation [1/m].
        #[serde(default = "price")]
        price: f64,
    },
    /// lower ≤ q ≤ upper of a joint of one coordinate.
    Joint {
        /// The joint.
        joint: String,
        /// Lowest coordinate [rad or m].
        lower: f64,
        /// Highest coordinate [rad or m].
        upper: f64,
        /// Price of a violation [1/rad or 1/m].
        #[serde(default = "price")]
        price: f64,
    },
}
