//! The model, constant during a simulation: nodes, masses, forces, grippers, shapes. Built once, shared by `Arc`.

mod bodies;
mod build;
mod chart;
mod closures;
mod cloth;
mod colliders;
mod constants;
mod couplings;
mod elements;
mod forces;
mod grasp;
mod mass;
mod materials;
mod query;
mod rods;
mod rules;
mod signals;

pub use build::{BuildError, ModelBuilder};
pub use cloth::ClothSpan;
pub use forces::{Acts, OwnForce};
pub use mass::NodeMass;
pub(crate) use materials::from_nodes;

use crate::bodies::Tree;
use crate::bodies::drag::BodyDrag;
use crate::constraints::{ColliderPair, ContactElement, ContactPair, ElementGroup, JointRow, LoopClosure};
use crate::geometry::Shape;
use crate::geometry::collider::Collider;
use crate::grasp::Grasp;
use crate::kinematics::Drive;
use crate::memory::{Layout, Past};
use crate::rods::{Following, Remembered, RodEdge, RodPast, RodPoint, Rods};
use crate::terms::Term;
use crate::terms::joint::{JointPoint, JointTerm};
use constants::MODEL;
use pliant_linalg::{Method, NodeLayout, Symmetry};
use pliant_math::State;
use pliant_math::params::Params;
use pliant_scene::{Contact, Integrator, LinearSolver, Solver, Start};
use std::sync::Arc;

/// A rope's place in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct RopeSpan {
    /// Name in the scene.
    pub name: String,
    /// Node numbers in the model, without ghosts, from the first end to the last.
    pub nodes: std::ops::Range<usize>,
    /// Rest edge lengths as fractions of the rope's length: as many as nodes if it is closed, else one less.
    pub fractions: Vec<f64>,
    /// Index in θ of the rope's length \[m\].
    pub length: usize,
}

impl RopeSpan {
    /// Nodes of edge `e`; the last edge of a closed rope ends at the first node.
    pub fn edge(&self, e: usize) -> [usize; 2] {
        [e, (e + 1) % self.nodes.len()].map(|i| self.nodes.start + i)
    }

    /// Whether its last node is joined to the first.
    pub fn is_closed(&self) -> bool {
        self.fractions.len() == self.nodes.len()
    }
}

/// Inertia of every degree of freedom of the bodies as the scene begins [kg·m² or kg]: what the solver weights velocities with, and
/// what the smoothing of joint friction and stops is made of. It does not follow θ, so no derivative runs through it.
#[derive(Clone, Debug, Default)]
pub(crate) struct DofWeights {
    /// All other degrees of freedom held.
    pub held: Vec<f64>,
    /// All others yielding.
    pub yielding: Vec<f64>,
}

/// A set of ropes, sheets and bodies with everything that acts on them.
#[derive(Clone, Debug)]
pub struct Model {
    pub(crate) params: Params,
    pub(crate) ropes: Vec<RopeSpan>,
    pub(crate) cloths: Vec<ClothSpan>,
    pub(crate) masses: Vec<NodeMass>,
    pub(crate) prescribed: Vec<bool>,
    /// Of every row of nodes and twists.
    pub(crate) prescribed_rows: Vec<bool>,
    pub(crate) rods: Rods,
    pub(crate) drives: Vec<Drive>,
    pub(crate) grasps: Vec<Grasp>,
    pub(crate) terms: Vec<Arc<dyn Term>>,
    pub(crate) tree: Tree,
    pub(crate) joint_terms: Vec<Arc<dyn JointTerm>>,
    pub(crate) body_drags: Vec<BodyDrag>,
    pub(crate) joint_rows: Vec<JointRow>,
    pub(crate) weights: DofWeights,
    pub(crate) n_actuators: usize,
    pub(crate) memory: Layout,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) shape_names: Vec<String>,
    pub(crate) pairs: Vec<ContactPair>,
    pub(crate) elements: Vec<ContactElement>,
    pub(crate) element_groups: Vec<ElementGroup>,
    pub(crate) colliders: Vec<Collider>,
    pub(crate) collider_pairs: Vec<ColliderPair>,
    pub(crate) closures: Vec<LoopClosure>,
    pub(crate) own_forces: Vec<OwnForce>,
    pub(crate) layout: Arc<NodeLayout>,
    pub(crate) gravity: usize,
    pub(crate) h: f64,
    pub(crate) integrator: Integrator,
    pub(crate) contact: Contact,
    pub(crate) solver: Solver,
    pub(crate) start: Start,
    pub(crate) q0: Vec<f64>,
    pub(crate) v0: Vec<f64>,
    /// z's part of rods at q0.
    pub(crate) frames0: Vec<f64>,
}

impl Model {
    /// Number of nodes, ghosts included.
    pub fn n_nodes(&self) -> usize {
        self.masses.len()
    }

    /// Number of rows of nodes, three each, and of the twists of rods' edges, which follow; the bodies' degrees of freedom are behind.
    pub fn n_node_dofs(&self) -> usize {
        3 * self.n_nodes() + self.rods.n_twists()
    }

    /// The rods that twist.
    pub fn rods(&self) -> &Rods {
        &self.rods
    }

    /// Number of coordinates: three per node, one per twist, then those of the joints (four for a ball).
    pub fn nq(&self) -> usize {
        self.n_node_dofs() + self.tree.nq()
    }

    /// Number of velocities: three per node, one per twist, then one per degree of freedom (three for a ball).
    pub fn nv(&self) -> usize {
        self.n_node_dofs() + self.tree.nv()
    }

    /// Numbers of a state as one vector, x = (q, v, z).
    pub fn nx(&self) -> usize {
        self.nq() + self.nv() + self.nz()
    }

    /// Numbers of a change of state, δx = (δq, δv, δz): the size of tangents, cotangents and the Jacobian A. A change of a ball's
    /// quaternion is a turn in its body's axes; one of a twist, a turn of the material beside what moving the edge's nodes does to it,
    /// and the reference axes in z have none of their own.
    pub fn ndx(&self) -> usize {
        2 * self.nv() + self.ndz()
    }

    /// Number of controls: those of grippers, then one per actuator.
    pub fn nu(&self) -> usize {
        self.drives.iter().map(Drive::n_controls).sum::<usize>() + self.n_actuators
    }

    /// Whether anything but grippers is controlled.
    pub fn has_actuators(&self) -> bool {
        self.n_actuators > 0
    }

    /// Whether a step does not depend on the velocities before it: quasi-static steps drop momentum.
    pub fn forgets_velocities(&self) -> bool {
        self.integrator == Integrator::QuasiStatic
    }

    /// The bodies and joints; their coordinates follow those of the nodes.
    pub fn tree(&self) -> &Tree {
        &self.tree
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

    /// Those of them that grasp.
    pub fn grasps(&self) -> &[Grasp] {
        &self.grasps
    }

    /// The forces.
    pub fn terms(&self) -> &[Arc<dyn Term>] {
        &self.terms
    }

    /// Whether each node is clamped by a gripper.
    pub fn prescribed(&self) -> &[bool] {
        &self.prescribed
    }

    /// The possible contacts.
    pub fn contact_pairs(&self) -> &[ContactPair] {
        &self.pairs
    }

    /// Edges and triangles that touch fixed shapes.
    pub fn elements(&self) -> &[ContactElement] {
        &self.elements
    }

    /// Which shapes they may touch.
    pub fn element_groups(&self) -> &[ElementGroup] {
        &self.element_groups
    }

    /// Shapes of bodies, shapes they may touch, and nodes that may touch them.
    pub fn colliders(&self) -> &[Collider] {
        &self.colliders
    }

    /// Which of them may touch.
    pub fn collider_pairs(&self) -> &[ColliderPair] {
        &self.collider_pairs
    }

    /// Bodies held together.
    pub fn closures(&self) -> &[LoopClosure] {
        &self.closures
    }

    /// Friction and stops at joints, and joints that follow others.
    pub fn joint_rows(&self) -> &[JointRow] {
        &self.joint_rows
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

    /// The same model at another step length, for convergence studies. Controls then belong to the new steps, and a delay line has as
    /// many numbers as the new steps need.
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

    /// Inertia of every row of nodes and twists [kg, kg·m²].
    pub fn row_masses(&self, theta: &[f64]) -> Vec<f64> {
        let nodes = self.masses.iter().flat_map(|m| [m.mass(theta); 3]);
        nodes.chain(self.rods.edges.iter().map(|edge| edge.moment(theta))).collect()
    }

    /// Whether each row of nodes and twists is prescribed by a gripper.
    pub fn prescribed_rows(&self) -> &[bool] {
        &self.prescribed_rows
    }

    /// z's part of rods at positions `q` \[m\], reference axes carried there from where the scene begins.
    pub fn frames_at(&self, q: &[f64]) -> Vec<f64> {
        let mut frames = self.frames0.clone();
        self.rods.carry_frames(&self.q0, q, &mut frames);
        frames
    }

    /// Turns the edges of rods that nothing holds so that twist is even between those that grippers hold, as in a straight section at
    /// rest: a start where only positions are known. Returns by how much each follows the held ones.
    pub fn spread_twists(&self, q: &mut [f64], frames: &[f64]) -> Following {
        self.rods.spread_twists(&self.prescribed_rows, q, frames)
    }

    /// Takes whole turns out of the twist between neighbouring edges that grippers hold, so that at most half a turn is left.
    pub fn take_out_turns(&self, x: &mut State) {
        self.rods.take_out_turns(&self.prescribed_rows, &mut x.q, &x.z[self.ndz()..]);
    }

    /// Kinetic energy of nodes, bodies and armatures \[J\].
    pub fn kinetic_energy(&self, q: &[f64], v: &[f64], theta: &[f64]) -> f64 {
        let speed2 = |i: usize| v[3 * i..3 * i + 3].iter().map(|x| x * x).sum::<f64>();
        let nodes: f64 = self.masses.iter().enumerate().map(|(i, m)| 0.5 * m.mass(theta) * speed2(i)).sum();
        let spin = |(k, edge): (usize, &RodEdge)| 0.5 * edge.moment(theta) * v[self.rods.row(k)].powi(2);
        nodes
            + self.rods.edges.iter().enumerate().map(spin).sum::<f64>()
            + self.tree.kinetic_energy(&q[self.n_node_dofs()..], &v[self.n_node_dofs()..], &self.inertias(theta), theta)
    }

    /// Potential energy of all terms and of the bodies' weight \[J\], at internal variables z.
    pub fn potential_energy(&self, q: &[f64], z: &[f64], theta: &[f64]) -> f64 {
        let v = vec![0.0; self.nv()];
        let at = crate::terms::Point { q, v: &v, theta };
        let n = self.n_node_dofs();
        let u = vec![0.0; self.nu()];
        let past = Past { q: &q[n..], z, elapsed: 0.0 };
        let joints = JointPoint { tree: &self.tree, q: &q[n..], v: &v[n..], u: &u, theta, past };
        let mut rods = RodPoint::default();
        self.rods.evaluate(q, &z[self.ndz()..], q, &mut rods);
        self.terms.iter().map(|t| t.energy(&at)).sum::<f64>()
            + self.rods.energy(&rods, theta, Remembered { past: &RodPast::default(), z, elapsed: 0.0 })
            + self.joint_terms.iter().map(|t| t.energy(&joints)).sum::<f64>()
            + self.tree.weight_energy(&q[n..], &self.inertias(theta), &self.gravity_vector(theta))
    }
}

impl Model {
    /// The factorization the scene asks for; `auto` takes the band where it is narrow, as a rope's chain structure makes it.
    pub(crate) fn method(&self) -> Method {
        match self.solver.linear {
            LinearSolver::Auto if self.layout.is_sparse() => Method::Sparse,
            LinearSolver::Auto | LinearSolver::Band => Method::Band,
            LinearSolver::Dense => Method::Dense,
            LinearSolver::Sparse => Method::Sparse,
        }
    }

    /// Whether there are forces that may push on along a displacement: see [`Term::buckles`](crate::terms::Term::buckles).
    pub(crate) fn buckles(&self) -> bool {
        self.terms.iter().any(|term| term.buckles())
    }

    /// Room for what terms write.
    pub(crate) fn make_layout(&self) -> NodeLayout {
        let mut stencils = Vec::new();
        self.terms.iter().for_each(|term| term.visit_stencils(&mut |nodes| stencils.push(nodes.to_vec())));
        self.rods.visit_stencils(&mut |nodes| stencils.push(nodes.to_vec()));
        let n = self.n_nodes();
        let twists: Vec<usize> = self.rods.edges.iter().map(|edge| edge.nodes[0]).collect();
        let order = self.slot_order();
        let order = order.as_deref();
        let banded = || NodeLayout::banded(n, &twists, order, &stencils);
        let wide = |layout: &NodeLayout| layout.half_width() > MODEL.widest_band;
        let layout = match self.solver.linear {
            LinearSolver::Band | LinearSolver::Dense => banded(),
            LinearSolver::Auto if !banded().as_ref().is_ok_and(wide) => banded(),
            LinearSolver::Auto | LinearSolver::Sparse => NodeLayout::sparse(n, &twists, order, &stencils),
        };
        // terms were refused when added if they act on nodes that are not there
        layout.unwrap_or_else(|error| unreachable!("{error}"))
    }

    /// Nodes slot by slot if a rope is closed: folded, so that its ends meet and the band stays narrow.
    fn slot_order(&self) -> Option<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.n_nodes()).collect();
        let closed = || self.ropes.iter().filter(|rope| rope.is_closed());
        for rope in closed() {
            let n = rope.nodes.len();
            for (k, slot) in order[rope.nodes.clone()].iter_mut().enumerate() {
                *slot = rope.nodes.start + if k % 2 == 0 { k / 2 } else { n - 1 - k / 2 };
            }
        }
        closed().next().is_some().then_some(order)
    }

    /// Whether the matrices of a step are symmetric at these parameters: no term breaks it, and there is no contact.
    pub(crate) fn symmetry(&self, theta: &[f64]) -> Symmetry {
        // axes carried along an edge's way make ∂f/∂q̄ depend on where the way began
        let symmetric = self.rods.edges.is_empty()
            && self.pairs.is_empty()
            && self.collider_pairs.is_empty()
            && self.element_groups.is_empty()
            && self.terms.iter().all(|t| t.symmetric(theta));
        if symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }
}
