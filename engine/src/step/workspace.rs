//! The memory of a step, allocated once and reused: the Newton loop allocates nothing.

use super::bodies::BodyWorkspace;
use super::facets::Blocks;
use super::frozen::FrozenWorkspace;
use super::spots::SpotWorkspace;
use super::stage::Iterate;
use crate::contact::{Condensed, RowLinear, SpotKey, node_of};
use crate::kkt::{KktError, Symbolic, System, SystemFactor};
use crate::model::Model;
use crate::newton::{History, Secant};
use crate::rods::{Carry, RodPoint};
use nalgebra::Vector4;

/// What to start from: impulses and accelerations of the last stage. Part of a checkpoint, so that a replay is bitwise the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Warm {
    /// Cone variables of contacts [N·s].
    pub(crate) cones: Vec<Vector4<f64>>,
    /// Impulses of joint friction, stops and couplings [N·m·s, N·s].
    pub(crate) rows: Vec<f64>,
    /// Cone variables of contacts of solids [N·s], in the order of their keys.
    pub(crate) spots: Vec<(SpotKey, Vector4<f64>)>,
    /// What the next accelerations of the bodies may be.
    pub(crate) history: History,
    /// And those of nodes and twists.
    pub(crate) nodes: History,
}

/// Buffers of the solver for one model, and the warm start of its contacts.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(crate) q_bar: Vec<f64>,
    pub(crate) v_bar: Vec<f64>,
    /// Rods at q̄, and how displacements show up there.
    pub(crate) rods: RodPoint,
    pub(crate) carry: Carry,
    pub(crate) f: Vec<f64>,
    pub(crate) r: Vec<f64>,
    pub(crate) d: Vec<f64>,
    pub(crate) d_next: Vec<f64>,
    /// Steps taken by the factored matrix.
    pub(crate) secant: Secant,
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
    /// Whether the factored matrix is made of what resists alone.
    pub(crate) stable: bool,
    pub(crate) it: Iterate,
    /// Axial forces of the stiff terms [N], term by term: unknowns of their own during Newton's method.
    pub(crate) axial: Vec<f64>,
    pub(crate) axial_next: Vec<f64>,
    /// Where they are predicted from.
    pub(crate) q_axial: Vec<f64>,
    /// Largest diagonal entry of −∂f/∂q̄ without the contacts [N/m].
    pub(crate) stiffness: f64,
    /// The same of −∂f/∂v̄ [N·s/m].
    pub(crate) viscosity: f64,
    /// Displacement of a step, for their prediction [m].
    pub(crate) dx: Vec<f64>,
    pub(crate) trial: Iterate,
    /// Nodes that may touch, and their blocks of ∂f/∂q̄ and ∂f/∂v̄ before contacts were added, and of K by what rods' axes carry.
    pub(crate) touching: Vec<(usize, Blocks)>,
    /// The same of pairs of different nodes that a contact of a facet joins, of which the first is free.
    pub(crate) between: Vec<([usize; 2], Blocks)>,
    /// Friction and stops at joints, linearized, and their residuals at the iterate.
    pub(crate) rows: Vec<RowLinear>,
    pub(crate) row_residuals: Vec<f64>,
    /// Diagonal entries of K at the rows' degrees of freedom before they were added.
    pub(crate) row_diagonals: Vec<f64>,
    pub(crate) ds: Vec<f64>,
    pub(crate) ds_next: Vec<f64>,
    /// Contacts of solids.
    pub(crate) spots: SpotWorkspace,
    /// Their start at frozen geometry.
    pub(crate) frozen: FrozenWorkspace,
    /// The bodies' part.
    pub(crate) bodies: BodyWorkspace,
    /// Impulses of the last converged stage; none before the first.
    pub(crate) warm: Option<Warm>,
}

impl Workspace {
    /// Buffers for `model`; `theta` decides whether its matrices are symmetric.
    pub fn new(model: &Model, theta: &[f64]) -> Result<Self, KktError> {
        let (nv, contacts) = (model.nv(), model.pairs.len());
        let zeros = || vec![0.0; nv];
        let cones = || vec![Vector4::zeros(); contacts];
        let n_rows = model.active_rows(theta).len();
        let rows = || vec![0.0; n_rows];
        let axial = || vec![0.0; model.terms.iter().map(|t| t.n_axial()).sum()];
        let matrix = || System::zeros(&model.layout, model.tree.nv());
        let symbolic = Symbolic::new(model.method(), model.symmetry(theta), &model.layout, &model.driven)?;
        Ok(Self {
            q_bar: vec![0.0; model.nq()],
            v_bar: zeros(),
            rods: RodPoint::default(),
            carry: Carry::default(),
            f: zeros(),
            r: zeros(),
            d: zeros(),
            d_next: zeros(),
            secant: Secant::default(),
            dw: cones(),
            dw_next: cones(),
            cone: cones(),
            contacts: vec![Condensed::zero(); contacts],
            dq: matrix(),
            dv: matrix(),
            k: matrix(),
            factor: SystemFactor::new(&symbolic, model.tree.nv()),
            bold: 0,
            stable: false,
            it: Iterate { v: zeros(), w: cones(), s: rows(), p: Vec::new() },
            stiffness: 0.0,
            viscosity: 0.0,
            axial: axial(),
            axial_next: axial(),
            q_axial: zeros(),
            dx: zeros(),
            trial: Iterate { v: zeros(), w: cones(), s: rows(), p: Vec::new() },
            touching: touching_nodes(model),
            between: Vec::new(),
            spots: SpotWorkspace::default(),
            frozen: FrozenWorkspace::default(),
            bodies: BodyWorkspace::default(),
            rows: vec![RowLinear::default(); n_rows],
            row_residuals: rows(),
            row_diagonals: rows(),
            ds: rows(),
            ds_next: rows(),
            warm: None,
        })
    }

    /// Forgets the contacts' warm start, so that what follows depends on its inputs alone.
    pub fn forget(&mut self) {
        self.warm = None;
    }
}

fn touching_nodes(model: &Model) -> Vec<(usize, Blocks)> {
    let of_facets = model.facets.iter().flat_map(|f| &f.nodes).copied().filter(|node| !model.driven[*node]);
    let balls = model.solids.iter().filter_map(|s| node_of(s.carrier));
    let mut nodes: Vec<usize> = model.pairs.iter().map(|p| p.node).chain(balls).chain(of_facets).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes.into_iter().map(|node| (node, Blocks::default())).collect()
}
