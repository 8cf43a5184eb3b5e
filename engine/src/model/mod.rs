//! What does not change while it moves: nodes, masses, forces, grippers, shapes. Built once, shared by `Arc`.

mod build;
mod mass;

pub use build::{BuildError, ModelBuilder};
pub use mass::NodeMass;

use crate::contact::ContactPair;
use crate::geometry::Shape;
use crate::kinematics::Drive;
use crate::kkt::{Method, Symmetry};
use crate::params::Params;
use crate::scene::{Contact, Integrator, LinearSolver, Solver, Start};
use crate::terms::Term;
use std::sync::Arc;

/// A rope's place in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct RopeSpan {
    /// Name in the scene.
    pub name: String,
    /// Node numbers in the model, without ghosts, from the first end to the last.
    pub nodes: std::ops::Range<usize>,
    /// Rest edge lengths as fractions of the rope's length.
    pub fractions: Vec<f64>,
    /// Index in θ of the rope's length \[m\].
    pub length: usize,
}

/// A set of ropes with everything that acts on them.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) params: Params,
    pub(crate) ropes: Vec<RopeSpan>,
    pub(crate) masses: Vec<NodeMass>,
    pub(crate) driven: Vec<bool>,
    pub(crate) drives: Vec<Drive>,
    pub(crate) terms: Vec<Arc<dyn Term>>,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) shape_names: Vec<String>,
    pub(crate) pairs: Vec<ContactPair>,
    pub(crate) reach: usize,
    pub(crate) gravity: usize,
    pub(crate) h: f64,
    pub(crate) integrator: Integrator,
    pub(crate) contact: Contact,
    pub(crate) solver: Solver,
    pub(crate) start: Start,
    pub(crate) q0: Vec<f64>,
    pub(crate) v0: Vec<f64>,
}

impl Model {
    /// Number of nodes, ghosts included.
    pub fn n_nodes(&self) -> usize {
        self.masses.len()
    }

    /// Number of position dofs, three per node; the state x = (q, v) has twice as many.
    pub fn nq(&self) -> usize {
        3 * self.n_nodes()
    }

    /// Number of controls.
    pub fn nu(&self) -> usize {
        self.drives.iter().map(Drive::n_controls).sum()
    }

    /// Number of entries of θ.
    pub fn n_params(&self) -> usize {
        self.params.len()
    }

    /// Names, units, bounds and scene values of θ.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The ropes.
    pub fn ropes(&self) -> &[RopeSpan] {
        &self.ropes
    }

    /// The rope of that name.
    pub fn rope(&self, name: &str) -> Option<&RopeSpan> {
        self.ropes.iter().find(|r| r.name == name)
    }

    /// The grippers.
    pub fn drives(&self) -> &[Drive] {
        &self.drives
    }

    /// The forces.
    pub fn terms(&self) -> &[Arc<dyn Term>] {
        &self.terms
    }

    /// Whether each node is clamped by a gripper.
    pub fn driven(&self) -> &[bool] {
        &self.driven
    }

    /// The possible contacts.
    pub fn contact_pairs(&self) -> &[ContactPair] {
        &self.pairs
    }

    /// Step h \[s\] of the scene.
    pub fn step_length(&self) -> f64 {
        self.h
    }

    /// Rest gap of the scene's contacts \[m\].
    pub fn rest_gap(&self) -> f64 {
        self.contact.rest_gap
    }

    /// Integrator of the scene.
    pub fn integrator(&self) -> Integrator {
        self.integrator
    }

    /// The same model at another step length, for convergence studies. Controls then belong to the new steps.
    pub fn with_step(&self, h: f64) -> Self {
        Self { h, ..self.clone() }
    }

    /// The same model with another integrator, for convergence studies.
    pub fn with_integrator(&self, integrator: Integrator) -> Self {
        Self { integrator, ..self.clone() }
    }

    /// Whether the scene asks for a start at equilibrium.
    pub fn starts_at_equilibrium(&self) -> bool {
        self.start == Start::Equilibrium
    }

    /// Positions of the scene's initial shape \[m\], ghosts included.
    pub fn initial_positions(&self) -> &[f64] {
        &self.q0
    }

    /// Initial velocities [m/s].
    pub fn initial_velocities(&self) -> &[f64] {
        &self.v0
    }

    /// Mass of every node \[kg\]; ghosts have none.
    pub fn masses(&self, theta: &[f64]) -> Vec<f64> {
        self.masses.iter().map(|m| m.mass(theta)).collect()
    }

    /// Kinetic energy ½ Σ m v² \[J\].
    pub fn kinetic_energy(&self, v: &[f64], theta: &[f64]) -> f64 {
        let speed2 = |i: usize| v[3 * i..3 * i + 3].iter().map(|x| x * x).sum::<f64>();
        self.masses.iter().enumerate().map(|(i, m)| 0.5 * m.mass(theta) * speed2(i)).sum()
    }

    /// Potential energy of all terms \[J\].
    pub fn potential_energy(&self, q: &[f64], theta: &[f64]) -> f64 {
        let v = vec![0.0; q.len()];
        let at = crate::terms::Point { q, v: &v, theta };
        self.terms.iter().map(|t| t.energy(&at)).sum()
    }
}

impl Model {
    /// The factorization the scene asks for; `auto` takes the band, which a rope's chain structure makes the cheapest.
    pub(crate) fn method(&self) -> Method {
        match self.solver.linear {
            LinearSolver::Auto | LinearSolver::Band => Method::Band,
            LinearSolver::Dense => Method::Dense,
            LinearSolver::Sparse => Method::Sparse,
        }
    }

    /// Whether the matrices of a step are symmetric at these parameters: no term breaks it, and there is no contact.
    pub(crate) fn symmetry(&self, theta: &[f64]) -> Symmetry {
        let symmetric = self.pairs.is_empty() && self.terms.iter().all(|t| t.symmetric(theta));
        if symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }
}
