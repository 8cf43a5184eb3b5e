//! The memory of a step, allocated once and reused: the Newton loop allocates nothing.

use super::bodies::BodyWorkspace;
use super::stage::Iterate;
use crate::contact::Condensed;
use crate::kkt::{KktError, Symbolic, System, SystemFactor};
use crate::model::Model;
use nalgebra::Vector4;

/// Buffers of the solver for one model, and the warm start of its contacts.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(crate) q_bar: Vec<f64>,
    pub(crate) v_bar: Vec<f64>,
    pub(crate) f: Vec<f64>,
    pub(crate) r: Vec<f64>,
    pub(crate) d: Vec<f64>,
    pub(crate) d_next: Vec<f64>,
    pub(crate) dw: Vec<Vector4<f64>>,
    pub(crate) dw_next: Vec<Vector4<f64>>,
    pub(crate) cone: Vec<Vector4<f64>>,
    pub(crate) contacts: Vec<Condensed>,
    pub(crate) dq: System,
    pub(crate) dv: System,
    pub(crate) k: System,
    pub(crate) factor: SystemFactor,
    /// Full steps that may still fail the monotonicity test.
    pub(crate) bold: usize,
    pub(crate) it: Iterate,
    /// Axial forces of the stiff terms [N], term by term: unknowns of their own during Newton's method.
    pub(crate) axial: Vec<f64>,
    pub(crate) axial_next: Vec<f64>,
    /// Largest diagonal entry of −∂f/∂q̄ without the contacts [N/m].
    pub(crate) stiffness: f64,
    /// Displacement of a step, for their prediction [m].
    pub(crate) dx: Vec<f64>,
    pub(crate) trial: Iterate,
    /// Nodes that may touch, and their blocks of ∂f/∂q̄ and ∂f/∂v̄ before contacts were added.
    pub(crate) touching: Vec<(usize, [[[f64; 3]; 3]; 2])>,
    /// The bodies' part.
    pub(crate) bodies: BodyWorkspace,
    /// Cone variables of the last converged stage; empty before the first.
    pub(crate) warm: Vec<Vector4<f64>>,
}

impl Workspace {
    /// Buffers for `model`; `theta` decides whether its matrices are symmetric.
    pub fn new(model: &Model, theta: &[f64]) -> Result<Self, KktError> {
        let (n, nv, contacts) = (model.n_nodes(), model.nv(), model.pairs.len());
        let zeros = || vec![0.0; nv];
        let cones = || vec![Vector4::zeros(); contacts];
        let axial = || vec![0.0; model.terms.iter().map(|t| t.n_axial()).sum()];
        let matrix = || System::zeros(n, model.reach, model.tree.nv());
        let symbolic = Symbolic::new(model.method(), model.symmetry(theta), n, model.reach, &model.driven, None)?;
        Ok(Self {
            q_bar: vec![0.0; model.nq()],
            v_bar: zeros(),
            f: zeros(),
            r: zeros(),
            d: zeros(),
            d_next: zeros(),
            dw: cones(),
            dw_next: cones(),
            cone: cones(),
            contacts: vec![Condensed::zero(); contacts],
            dq: matrix(),
            dv: matrix(),
            k: matrix(),
            factor: SystemFactor::new(&symbolic, model.tree.nv()),
            bold: 0,
            it: Iterate { v: zeros(), w: cones() },
            stiffness: 0.0,
            axial: axial(),
            axial_next: axial(),
            dx: zeros(),
            trial: Iterate { v: zeros(), w: cones() },
            touching: touching_nodes(model),
            bodies: BodyWorkspace::default(),
            warm: Vec::new(),
        })
    }

    /// Forgets the contacts' warm start, so that what follows depends on its inputs alone.
    pub fn forget(&mut self) {
        self.warm.clear();
    }
}

fn touching_nodes(model: &Model) -> Vec<(usize, [[[f64; 3]; 3]; 2])> {
    let mut nodes: Vec<usize> = model.pairs.iter().map(|p| p.node).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes.into_iter().map(|node| (node, [[[0.0; 3]; 3]; 2])).collect()
}
