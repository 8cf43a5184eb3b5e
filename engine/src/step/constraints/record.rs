//! Constraints at the root of a stage, with their multipliers as unknowns, for the derivatives.
//!
//! ```text
//! r_k −= (impulse_k · λ)/h,     dF = F_λ dλ + Σ_k slope_k dv_k
//! ```
//! over the degrees of freedom k that a constraint reaches. The algebra is in [`crate::step`]'s `system`; the laws' derivatives by inputs
//! stand beside the laws.

use super::{ConstraintId, Link, body_contact, closure, edge_contact, node_contact};
use crate::bodies::Frames;
use crate::bodies::dynamics::Partials;
use crate::bodies::tangent_maps::TangentMaps;
use crate::constraints::CONSTRAINTS;
use crate::geometry::collider::Attachment;
use crate::model::Model;
use crate::step::{Stage, StageRecord};
use nalgebra::{SMatrix, SVector, Vector4, Vector6};
use pliant_math::Input;
use pliant_math::spatial::{Force, column};

/// A degree of freedom that a constraint of M multipliers acts on or depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DofPartial<const M: usize> {
    /// Its row.
    pub v: usize,
    /// Impulse on it per unit of λ; zero where it is prescribed.
    pub impulse: SVector<f64, M>,
    /// ∂F/∂q̄ along it, and what F follows of the coordinates where the stage begins.
    pub by_q: SVector<f64, M>,
    /// ∂F/∂v⁺ with positions moving along.
    pub slope: SVector<f64, M>,
}

/// A constraint of M multipliers in the system of a stage.
#[derive(Clone, Debug)]
pub(crate) struct Block<const M: usize> {
    /// Its first row and column.
    pub row: usize,
    pub dofs: Vec<DofPartial<M>>,
    /// F_λ and its inverse.
    pub f_lambda: SMatrix<f64, M, M>,
    pub inverse: SMatrix<f64, M, M>,
}

/// A constraint with a cone variable, or a loop closure.
#[derive(Clone, Debug)]
pub(crate) struct ConeRecord {
    pub id: ConstraintId,
    /// Cone variable w, or impulses [N·s].
    pub w: Vector4<f64>,
    pub block: Block<4>,
    /// ∂F/∂(v_n, μ, κ, v_t).
    pub f_vn: Vector4<f64>,
    pub f_mu: Vector4<f64>,
    pub f_kappa: Vector4<f64>,
    pub f_vt: SMatrix<f64, 4, 3>,
    /// Frames and colliders of links.
    pub attachments: [Attachment; 2],
    pub colliders: [usize; 2],
    /// Steps of the split law along the normal and across \[kg\].
    pub rho: [f64; 2],
    /// Whether its [target](Link::target) follows the gap where the stage begins.
    pub recovers: bool,
}

/// Joint friction, a limit or a coupling.
#[derive(Clone, Debug)]
pub(crate) struct JointRecord {
    /// Impulse γ [N·m·s, N·s].
    pub gamma: f64,
    pub block: Block<1>,
}

/// The constraints of a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintRecords {
    pub joints: Vec<JointRecord>,
    pub cones: Vec<ConeRecord>,
    /// Rows of the system.
    pub rows: usize,
}

impl ConstraintRecords {
    /// Behind `nv` rows of velocities.
    pub fn new(nv: usize) -> Self {
        Self { rows: nv, ..Self::default() }
    }

    /// The first of `count` new rows.
    pub fn take_rows(&mut self, count: usize) -> usize {
        self.rows += count;
        self.rows - count
    }

    /// Whether all constraints are contacts of nodes.
    pub fn of_nodes_alone(&self) -> bool {
        self.joints.is_empty() && self.cones.iter().all(|cone| matches!(cone.id, ConstraintId::Node(_)))
    }
}

/// A degree of freedom that a link reaches: row, impulse, ∂F by the composites' columns with nodes moving along as in K, and with nodes
/// displaced alone.
pub(crate) type LinkDof = (usize, Vector4<f64>, Vector4<f64>, Vector4<f64>);

/// Where constraints are recorded.
pub(crate) struct RecordAt<'a, 'b> {
    pub frames: &'a Frames<f64>,
    /// Composites with the columns of pure displacements.
    pub partials: &'a Partials,
    /// From where the stage begins to where it is evaluated; T of these maps is orthogonal.
    pub turns: &'a TangentMaps,
    /// Degrees of freedom of all links, in order, by the columns of K.
    pub by_v: &'b mut std::slice::Iter<'a, Vec<LinkDof>>,
}

impl Stage<'_> {
    /// The degrees of freedom that a link reaches, by the columns at hand.
    pub(crate) fn link_dofs(&self, link: &Link, frames: &Frames<f64>, partials: &Partials) -> Vec<LinkDof> {
        let (n, tree, linear) = (self.model.n_node_dofs(), &self.model.tree, &link.linear);
        let mut out: Vec<LinkDof> = Vec::new();
        let twice = link.attachments.iter().all(|c| matches!(c, Attachment::Body(_)));
        let mut add = |row: usize, impulse, with_v: Vector4<f64>, alone: Vector4<f64>| {
            // only two bodies can share degrees of freedom
            match out.iter_mut().filter(|_| twice).find(|d| d.0 == row) {
                Some(d) => {
                    d.1 += impulse;
                    d.2 += with_v;
                    d.3 += alone;
                }
                None => out.push((row, impulse, with_v, alone)),
            }
        };
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            match link.attachments[side] {
                Attachment::World => {}
                Attachment::Node(node) => (0..3).for_each(|a| {
                    let xi = linear.f_xi[side].column(3 + a).into_owned();
                    let v = linear.f_v.column(3 + a) * sign;
                    let impulse = linear.w_w.row(3 + a).transpose() * sign;
                    if !self.model.prescribed[node] {
                        add(3 * node + a, impulse, xi * (self.h * self.scheme.free.a1) + v, xi);
                    }
                }),
                Attachment::Body(body) => {
                    let motion = frames.bodies[body].velocity;
                    for l in tree.chain(tree.last_dof(body)) {
                        let (xi, v): (Vector6<f64>, Vector6<f64>) = partials.change(l, &motion);
                        let f = linear.f_xi[side] * xi + linear.f_v * v * sign;
                        let impulse = linear.w_w.transpose() * column(&frames.axes[l].s) * sign;
                        add(n + l, impulse, f, f);
                    }
                }
            }
        }
        out
    }

    /// Records a link.
    pub(crate) fn record_link(&self, link: &Link, w: Vector4<f64>, at: &mut RecordAt, out: &mut ConstraintRecords) {
        let (linear, by_q) = (&link.linear, self.link_dofs(link, at.frames, at.partials));
        let by_v = at.by_v.next().map_or(&[][..], Vec::as_slice);
        let mut dofs: Vec<DofPartial<4>> =
            by_v.iter().zip(by_q).map(|(v, q)| DofPartial { v: v.0, impulse: v.1, slope: v.2, by_q: q.3 }).collect();
        // v_n = (gap − target)/h, where the target may follow the coordinates at the beginning; they come in as `by_q` does
        if !link.target_by_start.is_empty() {
            let mut by_start = vec![0.0; self.model.nv()];
            link.target_by_start.iter().for_each(|(row, by)| by_start[*row] += by);
            at.turns.transport(&mut by_start[self.model.n_node_dofs()..], 1);
            dofs.iter_mut().for_each(|dof| dof.by_q -= linear.f_vn * (by_start[dof.v] / self.h));
        }
        let block = Block { row: out.take_rows(4), dofs, f_lambda: linear.f_w, inverse: linear.inverse };
        out.cones.push(ConeRecord {
            id: link.id,
            w,
            block,
            f_vn: linear.f_vn,
            f_mu: linear.f_mu,
            f_kappa: Vector4::zeros(),
            f_vt: linear.f_vt,
            attachments: link.attachments,
            colliders: link.colliders,
            rho: [link.rho_n, link.rho_t],
            recovers: link.target < 0.0,
        });
    }
}

/// Arguments of derivatives by inputs.
pub(crate) struct InputsAt<'a> {
    pub stage: &'a StageRecord,
    pub model: &'a Model,
    pub theta: &'a [f64],
    /// Coordinates where forces are evaluated.
    pub q: &'a [f64],
}

impl ConeRecord {
    /// ∂(r, F)/∂inputs: of a node's contact, or one of an edge or triangle.
    pub fn visit_node_inputs(&self, at: &InputsAt, visit: &mut dyn FnMut(usize, Input, f64)) {
        match self.id {
            ConstraintId::Node(pair) => node_contact::visit_inputs(self, pair, at, visit),
            ConstraintId::Edge(id) => edge_contact::visit_inputs(self, id, at, visit),
            ConstraintId::Bodies { .. } | ConstraintId::Closure { .. } => {}
        }
    }

    /// The same of a link between frames.
    pub fn visit_link_inputs(&self, at: &InputsAt, frames: &Frames<f64>, visit: &mut dyn FnMut(usize, Input, f64)) {
        match self.id {
            ConstraintId::Bodies { pair, features, .. } => body_contact::visit_inputs(self, pair, &features, at, frames, visit),
            ConstraintId::Closure { closure, turn } => closure::visit_inputs(self, closure, turn, at, frames, visit),
            ConstraintId::Node(_) | ConstraintId::Edge(_) => {}
        }
    }

    /// Numbers that tell the constraint's mode: see [`StageRecord::contact_modes`].
    pub fn mode(&self, at: &InputsAt) -> Vec<u8> {
        match self.id {
            ConstraintId::Node(pair) => vec![node_contact::mode(self, pair, at)],
            ConstraintId::Bodies { pair, .. } => body_contact::mode(self, pair, at),
            ConstraintId::Closure { .. } => Vec::new(),
            ConstraintId::Edge(id) => edge_contact::mode(self, id, at),
        }
    }

    /// Whether it is a contact of a node.
    pub fn is_of_node(&self) -> bool {
        matches!(self.id, ConstraintId::Node(_))
    }

    /// 0 separate, 1 stick, 2 slip (also without friction), for the cone variable at which it closes.
    pub(super) fn phase(&self, closing: f64) -> u8 {
        let load = self.w.fixed_rows::<3>(1).norm() / self.w[0];
        if self.w[0] < closing { 0 } else { 1 + u8::from(load > CONSTRAINTS.slip) }
    }

    /// Generalized forces of a wrench on the first frame and its opposite on the second.
    pub(super) fn visit_wrench(
        &self,
        model: &Model,
        frames: &Frames<f64>,
        wrench: &Force<f64>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        let (n, tree) = (model.n_node_dofs(), &model.tree);
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            match self.attachments[side] {
                Attachment::World => {}
                Attachment::Node(node) if model.prescribed[node] => {}
                Attachment::Node(node) => (0..3).for_each(|a| visit(3 * node + a, sign * wrench.f[a])),
                Attachment::Body(body) => {
                    tree.chain(tree.last_dof(body)).for_each(|l| visit(n + l, sign * frames.axes[l].s.dot(wrench)));
                }
            }
        }
    }
}
