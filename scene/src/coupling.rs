//! Joints that follow others in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A joint that follows another by a polynomial, or is held: gears, belts, screws, fingers that close together. With the coordinates
/// q₁ of the joint that leads and q₂ of the one that follows,
/// q₂ = c₀ + c₁ d + c₂ d² + c₃ d³ + c₄ d⁴, d = q₁ − reference. Its parameters are `name.coefficient[k]`, `name.reference` if
/// a joint leads, and `name.compliance` if it is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// The joint that follows; revolute or prismatic.
    pub joint: String,
    /// The joint that leads, revolute or prismatic; if left out, the other one is held at the first coefficient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// c₀, c₁, … c₄: one to five numbers, in rad or m of the joint that follows per power of rad or m of the one that leads.
    pub coefficients: Vec<f64>,
    /// Coordinate of the leading joint where its powers are zero [rad] or [m].
    #[serde(default)]
    pub reference: f64,
    /// Compliance of the following joint [rad/(N·m)] or [m/N]; as small as that of a stop if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compliance: Option<f64>,
}
