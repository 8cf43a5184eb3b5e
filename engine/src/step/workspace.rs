//! The memory of a step, allocated once and reused: the Newton loop allocates nothing.

use super::blocks::UnconstrainedBlocks;
use super::bodies::BodyWorkspace;
use super::frozen::FrozenWorkspace;
use super::stage::Iterate;
use crate::bodies::dynamics::WrenchPartial;
use crate::model::Model;
use crate::rods::{RodPoint, TransportDerivative};
use crate::step::constraints::{Constraints, JointConstraints, NodeContacts, WarmImpulses};
use crate::step::newton::{History, Secant};
use nalgebra::Matrix6;
use pliant_linalg::{KktError, Square, Symbolic, System, SystemFactor};
use pliant_math::spatial::Force;

/// Impulses and accelerations of the last stage, from which the next one starts. Part of a checkpoint, so that a replay is bitwise the
/// same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Warm {
    pub(crate) impulses: WarmImpulses,
    /// Accelerations of the bodies, extrapolated.
    pub(crate) history: History,
    /// And those of nodes and twists.
    pub(crate) nodes: History,
}

/// Forces of constraints beside those on nodes, and their entries of K beside those of nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintLoads {
    /// On bodies, about the origin of the frames, the air's among them; empty where nothing reaches a body.
    pub bodies: Vec<Force<f64>>,
    /// On degrees of freedom of joints: row, force.
    pub joints: Vec<(usize, f64)>,
    /// Row, column and entry of K's block of bodies.
    pub slopes: Vec<(usize, usize, f64)>,
    /// That block without these.
    pub unconstrained: Square,
}

impl ConstraintLoads {
    /// Nothing, on `bodies` bodies.
    pub fn clear(&mut self, bodies: usize) {
        self.bodies.clear();
        self.bodies.resize(bodies, Force::zero());
        self.joints.clear();
        self.slopes.clear();
    }
}

/// Axial forces of the stiff terms \[N\], term by term: unknowns of their own during Newton's method.
#[derive(Clone, Debug, Default)]
pub(crate) struct AxialForces {
    pub now: Vec<f64>,
    pub next: Vec<f64>,
    /// Positions they are predicted from, and the displacement of a step \[m\].
    pub q: Vec<f64>,
    pub dx: Vec<f64>,
}

/// State of Newton's method.
#[derive(Clone, Debug, Default)]
pub(crate) struct NewtonState {
    pub trial: Iterate,
    /// The pending correction, and the one by the same matrix at the trial point.
    pub d: Iterate,
    pub d_next: Iterate,
    /// Steps taken by the factored matrix.
    pub secant: Secant,
    /// Correction \[m/s\] that is left where the residual is rounding.
    pub left: f64,
    /// Full steps that may still fail the monotonicity test.
    pub nonmonotone: usize,
    /// Size of each unknown, for [`Stage::at_rounding`](crate::step::Stage).
    pub size: Vec<f64>,
    /// What the rounding of links' laws may make of every row \[N\], for the same.
    pub of_links: Vec<f64>,
    /// Whether the factored matrix is made of positive semidefinite parts alone.
    pub semidefinite: bool,
}

/// Buffers of the solver for one model, and what the next stage starts from.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// Where forces are evaluated.
    pub(crate) q_bar: Vec<f64>,
    pub(crate) v_bar: Vec<f64>,
    /// Rods at q̄, and how displacements show up there.
    pub(crate) rods: RodPoint,
    pub(crate) carry: TransportDerivative,
    /// Forces of the elements, and the residual.
    pub(crate) f: Vec<f64>,
    pub(crate) r: Vec<f64>,
    /// ∂f/∂q̄, ∂f/∂v̄, K and its factor.
    pub(crate) dq: System,
    pub(crate) dv: System,
    pub(crate) k: System,
    pub(crate) factor: SystemFactor,
    /// Largest diagonal entry of −∂f/∂q̄ without the constraints [N/m].
    pub(crate) stiffness: f64,
    /// The same of −∂f/∂v̄ [N·s/m].
    pub(crate) viscosity: f64,
    pub(crate) blocks: UnconstrainedBlocks,
    /// The iterate, and weights of a correction of each unknown in the norm.
    pub(crate) it: Iterate,
    pub(crate) weights: Vec<f64>,
    pub(crate) newton: NewtonState,
    pub(crate) axial: AxialForces,
    /// Constraints of the stage, their residuals at the last evaluation, and their forces.
    pub(crate) constraints: Constraints,
    pub(crate) residuals: Vec<f64>,
    pub(crate) loads: ConstraintLoads,
    /// Inverse inertias of the bodies where the stage begins, and joint stiffness that counts in them.
    pub(crate) mobility: Vec<Matrix6<f64>>,
    pub(crate) stiffening: Vec<f64>,
    /// How the forces of constraints on bodies change with their own bodies.
    pub(crate) wrench_partials: Vec<WrenchPartial>,
    /// The start at frozen geometry.
    pub(crate) frozen: FrozenWorkspace,
    pub(crate) bodies: BodyWorkspace,
    /// Of the last converged stage; none before the first.
    pub(crate) warm: Option<Warm>,
}

impl Workspace {
    /// Buffers for `model`; `theta` decides whether its matrices are symmetric.
    pub fn new(model: &Model, theta: &[f64]) -> Result<Self, KktError> {
        let nv = model.nv();
        let zeros = || vec![0.0; nv];
        let constraints = Constraints {
            joints: JointConstraints::new(model.active_rows(theta).len()),
            nodes: NodeContacts::new(model.pairs.len()),
            ..Constraints::default()
        };
        let iterate = || Iterate::zeros(nv, constraints.dim());
        let axial = || vec![0.0; model.terms.iter().map(|t| t.n_axial()).sum()];
        let matrix = || System::zeros(&model.layout, model.tree.nv());
        let symbolic = Symbolic::new(model.method(), model.symmetry(theta), &model.layout, &model.prescribed)?;
        Ok(Self {
            q_bar: vec![0.0; model.nq()],
            v_bar: zeros(),
            rods: RodPoint::default(),
            carry: TransportDerivative::default(),
            f: zeros(),
            r: zeros(),
            dq: matrix(),
            dv: matrix(),
            k: matrix(),
            factor: SystemFactor::new(&symbolic, model.tree.nv()),
            stiffness: 0.0,
            viscosity: 0.0,
            blocks: UnconstrainedBlocks::new(model),
            it: iterate(),
            weights: Vec::new(),
            newton: NewtonState { trial: iterate(), d: iterate(), d_next: iterate(), ..NewtonState::default() },
            axial: AxialForces { now: axial(), next: axial(), q: zeros(), dx: zeros() },
            constraints,
            residuals: Vec::new(),
            loads: ConstraintLoads::default(),
            mobility: Vec::new(),
            stiffening: Vec::new(),
            wrench_partials: Vec::new(),
            frozen: FrozenWorkspace::default(),
            bodies: BodyWorkspace::default(),
            warm: None,
        })
    }

    /// Forgets the warm start, so that the next stage depends on its inputs alone. Multipliers are those of new buffers again: rows of
    /// joints that find no warm start begin where the last stage has left them.
    pub fn forget(&mut self) {
        self.warm = None;
        self.it.lambda.fill(0.0);
    }
}
