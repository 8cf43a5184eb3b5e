//! Forces of one's own in a scene file.

use super::body::JointKind;
use pliant_math::formula::{Formula, FormulaError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most parameters of a force at a joint: what the derivatives of a joint's law have room for.
pub const MOST_AT_JOINT: usize = 8;
/// Most parameters of a force on nodes; an entry more is the length or the area that a density is per.
pub const MOST_ON_NODES: usize = 15;

/// A force of one's own, written as formulas in Python's syntax with NumPy's functions. It acts at a joint, on nodes of a rope, or on
/// nodes of a cloth, with exact derivatives by position, velocity and each of its parameters, which are `name.parameter` in θ. All
/// quantities are in SI units; a parameter has the unit that the formula gives it.
///
/// At a revolute or prismatic joint: f(q, v) [N·m] or [N] along the axis. At a ball joint: three formulas of qx, qy, qz, the rotation
/// vector [rad], and vx, vy, vz, the angular velocity [rad/s], in the body's axes. On nodes: three formulas of x, y, z [m] and vx, vy, vz
/// [m/s] in the world's axes, [N] at every node of the list `nodes`; without `nodes` they are forces per length of the whole rope [N/m] or
/// per area of the whole cloth [N/m²], which do not depend on how finely it is divided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// The joint it acts at: revolute, prismatic or ball. Either this, `rope` or `cloth`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// The rope it acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rope: Option<String>,
    /// The cloth it acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
    /// Nodes it acts on, each with the whole force; negative numbers count from the end. If left out it acts on all, as a density.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<i64>>,
    /// The formula at a joint of one axis, or one for each of the three axes.
    pub formula: Formulas,
    /// Values of the names in the formulas that are not variables: at most 8 at a joint, 15 on nodes. One that is 0 has a derivative too,
    /// and a diagnosis looks for it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, f64>,
}

/// A formula, or one for each of three axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Formulas {
    /// Along the one axis of a joint.
    One(String),
    /// Along three axes.
    Three([String; 3]),
}

impl Formulas {
    /// Their texts.
    pub fn texts(&self) -> &[String] {
        match self {
            Self::One(text) => std::slice::from_ref(text),
            Self::Three(texts) => texts,
        }
    }
}

impl Force {
    /// Variables of its formulas, positions before velocities, where it acts on nodes or at a joint of this kind; `None` at a joint of two
    /// axes and at a free one.
    pub fn variables(&self, joint: Option<JointKind>) -> Option<&'static [&'static str]> {
        match joint {
            None => Some(&["x", "y", "z", "vx", "vy", "vz"]),
            Some(JointKind::Revolute | JointKind::Prismatic) => Some(&["q", "v"]),
            Some(JointKind::Ball) => Some(&["qx", "qy", "qz", "vx", "vy", "vz"]),
            Some(JointKind::Universal | JointKind::Free) => None,
        }
    }

    /// Its formulas, of these variables and then of its parameters in the order of their names; the number of one that cannot be read with
    /// the error.
    pub fn read(&self, variables: &[&str]) -> Result<Vec<Formula>, (usize, FormulaError)> {
        let names: Vec<&str> = variables.iter().copied().chain(self.parameters.keys().map(String::as_str)).collect();
        let texts = self.formula.texts().iter().enumerate();
        texts.map(|(k, text)| Formula::parse(text, &names).map_err(|error| (k, error))).collect()
    }

    /// Most parameters that it may have.
    pub fn most_parameters(&self) -> usize {
        if self.joint.is_some() { MOST_AT_JOINT } else { MOST_ON_NODES }
    }
}
