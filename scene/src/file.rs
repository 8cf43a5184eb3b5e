//! The scene file: its top level, and its tables that are not objects.

use super::actuator::Actuator;
use super::body::{Body, Closure};
use super::cloth::Cloth;
use super::coupling::Coupling;
use super::force::Force;
use super::gripper::{Clamp, End, Gripper};
use super::rope::Rope;
use super::shape::{Block, Capsule, ContactRule, Cylinder, Plane, Sphere};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The schema version this crate reads and writes.
pub const SCHEMA_VERSION: u32 = 1;

/// A scene: one TOML file. All quantities are in SI units (m, kg, s, N, rad); unknown keys are refused.
///
/// `X` is the type of the `experiment` key, which the engine does not look into.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene<X = Nothing> {
    /// Version of this format; 1.
    pub schema_version: u32,
    /// Step, duration, integrator.
    pub time: Time,
    /// Gravity.
    #[serde(default)]
    pub gravity: Gravity,
    /// The air around everything.
    #[serde(default)]
    pub air: Air,
    /// Ropes, cables, rods.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rope: Vec<Rope>,
    /// Sheets of cloth, paper or rubber.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cloth: Vec<Cloth>,
    /// Rigid bodies and their joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<Body>,
    /// Motors at joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub actuator: Vec<Actuator>,
    /// Bodies held together beside their joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub closure: Vec<Closure>,
    /// Joints that follow others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coupling: Vec<Coupling>,
    /// Forces of one's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<Force>,
    /// Clamps that drive nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gripper: Vec<Gripper>,
    /// Fixed half-spaces.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plane: Vec<Plane>,
    /// Fixed balls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sphere: Vec<Sphere>,
    /// Fixed capsules (a cylinder with round ends).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub capsule: Vec<Capsule>,
    /// Fixed cuboids.
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    pub block: Vec<Block>,
    /// Fixed cylinders.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cylinder: Vec<Cylinder>,
    /// Contact law.
    #[serde(default)]
    pub contact: Contact,
    /// Newton and linear algebra.
    #[serde(default)]
    pub solver: Solver,
    /// Measurements and sensors; read by `fit` and `diagnose` only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<X>,
}

/// The `experiment` of a scene that is only simulated: any table is accepted and ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Nothing {}

impl Scene {
    /// Whether a gripper clamps that end edge of a rope.
    pub fn clamps_end(&self, rope: &Rope, end: End) -> bool {
        self.gripper.iter().any(|g| g.rope.as_deref() == Some(rope.name.as_str()) && g.clamp == Clamp::End(end))
    }

    /// Number of fixed shapes.
    pub fn n_shapes(&self) -> usize {
        self.plane.len() + self.sphere.len() + self.capsule.len() + self.block.len() + self.cylinder.len()
    }
}

impl<X> Scene<X> {
    /// The same scene with another experiment, or none.
    pub fn with_experiment<Y>(&self, experiment: Option<Y>) -> Scene<Y> {
        Scene {
            schema_version: self.schema_version,
            time: self.time.clone(),
            gravity: self.gravity.clone(),
            air: self.air.clone(),
            rope: self.rope.clone(),
            cloth: self.cloth.clone(),
            body: self.body.clone(),
            actuator: self.actuator.clone(),
            closure: self.closure.clone(),
            coupling: self.coupling.clone(),
            force: self.force.clone(),
            gripper: self.gripper.clone(),
            plane: self.plane.clone(),
            sphere: self.sphere.clone(),
            capsule: self.capsule.clone(),
            block: self.block.clone(),
            cylinder: self.cylinder.clone(),
            contact: self.contact.clone(),
            solver: self.solver.clone(),
            experiment,
        }
    }
}

/// A scene without objects, for struct literals (`..Scene::default()`).
impl<X> Default for Scene<X> {
    fn default() -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            time: Time::default(),
            gravity: Gravity::default(),
            air: Air::default(),
            rope: Vec::new(),
            cloth: Vec::new(),
            body: Vec::new(),
            actuator: Vec::new(),
            closure: Vec::new(),
            coupling: Vec::new(),
            force: Vec::new(),
            gripper: Vec::new(),
            plane: Vec::new(),
            sphere: Vec::new(),
            capsule: Vec::new(),
            block: Vec::new(),
            cylinder: Vec::new(),
            contact: Contact::default(),
            solver: Solver::default(),
            experiment: None,
        }
    }
}

/// Step, duration and integrator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Step h [s], from 1e-9 to below 1.
    pub step: f64,
    /// Simulated time [s], for `simulate` and `gradcheck`; at most 10⁷ steps.
    #[serde(default = "one")]
    pub duration: f64,
    /// Integrator, the same in every step; under `sdirk2` a step in which ropes or sheets hit a shape is taken as two steps of `euler`.
    #[serde(default)]
    pub integrator: Integrator,
}

fn one() -> f64 {
    1.0
}

impl Time {
    /// Number of steps in the duration, rounded.
    pub fn n_steps(&self) -> usize {
        (self.duration / self.step).round() as usize
    }
}

impl Default for Time {
    fn default() -> Self {
        Self { step: 0.01, duration: 1.0, integrator: Integrator::default() }
    }
}

/// Integrators of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Integrator {
    /// Implicit Euler: first order, robust, damps hω²/2 per second; with contact.
    Euler,
    /// Implicit midpoint: second order, keeps energy; without contact.
    #[default]
    Midpoint,
    /// Two implicit Euler stages, γ = 1 − 1/√2: second order with contact.
    Sdirk2,
    /// Implicit Euler from rest: the last step's momentum is dropped, and M/h² only regularizes; with contact.
    #[serde(rename = "quasi_static")]
    QuasiStatic,
}

/// Gravity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Gravity {
    /// Magnitude [m/s²].
    pub magnitude: f64,
    /// Rotations of the downward direction about x, then about y [rad].
    pub tilt: [f64; 2],
}

impl Gravity {
    /// Unit vector of gravity: Ry(tilt\[1\]) Rx(tilt\[0\]) (0, 0, −1).
    pub fn direction(&self) -> [f64; 3] {
        let ((sin_x, cos_x), (sin_y, cos_y)) = (self.tilt[0].sin_cos(), self.tilt[1].sin_cos());
        [-cos_x * sin_y, sin_x, -cos_x * cos_y]
    }
}

impl Default for Gravity {
    fn default() -> Self {
        Self { magnitude: 9.81, tilt: [0.0; 2] }
    }
}

/// The air around everything.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Air {
    /// Velocity of the air [m/s].
    pub wind: [f64; 3],
    /// Density of the air, or of the liquid that bodies move through [kg/m³]; 0 has no drag on bodies, air at sea level has 1.2.
    pub density: f64,
    /// Its viscosity [Pa·s], for the drag on bodies that grows with the speed itself; air has 1.8e-5, water 1e-3.
    pub viscosity: f64,
}

/// Contact law and its smoothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// Law of friction.
    pub law: Law,
    /// Gap at which a resting node hovers [m]; κ = rest_gap · mass · gravity. (A body hovers at about that.)
    pub rest_gap: f64,
    /// Rules for pairs of objects.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pair: Vec<ContactRule>,
}

impl Default for Contact {
    fn default() -> Self {
        Self { law: Law::default(), rest_gap: 1e-9, pair: Vec::new() }
    }
}

/// Laws of frictional contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// Coulomb friction (de Saxcé).
    #[default]
    Coulomb,
    /// The convex relaxation; sliding rides on a gap μ h |v|.
    Anitescu,
}

/// Newton's method and its linear algebra.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// Factorization.
    pub linear: LinearSolver,
    /// Residual at which a step is accepted, as a part of the velocity scale [-].
    pub tolerance: f64,
    /// Newton iterations before a step is retried.
    pub max_iterations: usize,
    /// Most halvings of a failed step.
    pub max_halvings: usize,
}

impl Default for Solver {
    fn default() -> Self {
        Self { linear: LinearSolver::default(), tolerance: 1e-12, max_iterations: 40, max_halvings: 12 }
    }
}

/// Factorizations of the step's matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LinearSolver {
    /// Chosen by size and structure.
    #[default]
    Auto,
    /// Block band LU.
    Band,
    /// Dense LU.
    Dense,
    /// Sparse LU.
    Sparse,
}
