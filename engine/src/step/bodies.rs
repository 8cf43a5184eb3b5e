//! The bodies' rows of a stage:
//! ```text
//! r = ID(q̄, v̄, ā; θ) + armature ā − Σ f(q̄, v̄, u; θ)        [N·m or N],   ā = σ (v⁺ − v)
//! K = ∂r/∂v⁺ = σ M + h a1 (∂r/∂q̄) J + b1 ∂r/∂v̄
//! ```
//! with J of [`crate::bodies::turns`]: q̄ = q ⊕ h (a0 v + a1 v⁺).

use super::{Scheme, Stage, StageRecord, Workspace};
use crate::bodies::drag::BodyDrag;
use crate::bodies::dynamics::{Displacement, Partials, inverse_dynamics};
use crate::bodies::tangent_maps::TangentMaps;
use crate::bodies::{Frames, Tree};
use crate::memory::Past;
use crate::model::{DofWeights, Model};
use crate::terms::joint::JointPoint;
use nalgebra::Matrix3;
use pliant_linalg::{NodeMatrix, Square, System};
use pliant_math::Vec3;
use pliant_math::spatial::{Force, Inertia};

/// Memory of the bodies' part of a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct BodyWorkspace {
    pub frames: Frames<f64>,
    /// Where the bodies would be at the end of the stage if nothing changed their motion, and all coordinates there.
    pub ahead: Frames<f64>,
    pub q_ahead: Vec<f64>,
    pub partials: Partials,
    forces: Vec<Force<f64>>,
    t: Vec<f64>,
    a: Vec<f64>,
    middle: TangentMaps,
    jacobians: Vec<Option<Matrix3<f64>>>,
}

/// The tangent `h (w0 v_ref + w1 v)` of the bodies' degrees of freedom.
pub(crate) fn tangent(h: f64, w: [f64; 2], v_ref: &[f64], v: &[f64], out: &mut Vec<f64>) {
    out.clear();
    out.extend(v_ref.iter().zip(v).map(|(a, b)| h * (w[0] * a + w[1] * b)));
}

impl Stage<'_> {
    fn has_bodies(&self) -> bool {
        !self.model.tree.bodies().is_empty()
    }

    /// Bodies that the air acts on.
    pub(super) fn drags(&self) -> impl Iterator<Item = &BodyDrag> {
        self.model.body_drags.iter().filter(|drag| drag.acts(self.theta))
    }

    /// q̄ and v̄ of the bodies.
    pub(super) fn place_bodies(&self, v: &[f64], ws: &mut Workspace) {
        if !self.has_bodies() {
            return;
        }
        let (n, tree, w) = (self.model.n_node_dofs(), &self.model.tree, &self.scheme.free);
        tangent(self.h, [w.a0, w.a1], &self.v_ref[n..], &v[n..], &mut ws.bodies.t);
        tree.add(self.scheme.middle, &self.q_ref[n..], &ws.bodies.t, &mut ws.q_bar[n..]);
        for ((v_bar, v_ref), v) in ws.v_bar[n..].iter_mut().zip(&self.v_ref[n..]).zip(&v[n..]) {
            *v_bar = w.b0 * v_ref + w.b1 * v;
        }
    }

    /// Frames where the stage begins, at rest accelerations.
    pub(super) fn frames_at_start(&self, ws: &mut Workspace) {
        let (n, tree) = (self.model.n_node_dofs(), &self.model.tree);
        let body = &mut ws.bodies;
        body.frames.origin = tree.origin(&self.q_ref[n..]);
        body.a.clear();
        body.a.resize(tree.nv(), 0.0);
        body.frames.evaluate_values(tree, &self.q_ref[n..], &self.v_ref[n..], &body.a, &Vec3::zeros());
    }

    /// Where everything would be at the end of the stage if nothing changed its motion; prescribed nodes at their command.
    pub(super) fn frames_ahead(&self, ws: &mut Workspace) {
        let (n, tree, body) = (self.model.n_node_dofs(), &self.model.tree, &mut ws.bodies);
        body.q_ahead.clear();
        body.q_ahead.extend_from_slice(self.q_ref);
        for (k, &prescribed) in self.model.prescribed_rows.iter().enumerate() {
            body.q_ahead[k] += self.h * if prescribed { self.v_cmd[k] } else { self.v_ref[k] };
        }
        tangent(self.h, [1.0, 0.0], &self.v_ref[n..], &self.v_ref[n..], &mut body.t);
        tree.add(self.scheme.end, &self.q_ref[n..], &body.t, &mut body.q_ahead[n..]);
        body.ahead.origin = body.frames.origin;
        body.a.clear();
        body.a.resize(tree.nv(), 0.0);
        body.ahead.evaluate_values(tree, &body.q_ahead[n..], &self.v_ref[n..], &body.a, &Vec3::zeros());
    }

    /// Adds what armatures, damping and stiffness of the joints are beside inertia to the row-major matrix `out` of the degrees of
    /// freedom: armature + h ∂f/∂v + h² ∂f/∂q, where the stage begins.
    pub(super) fn joint_stiffening(&self, n: usize, out: &mut [f64]) {
        let tree = &self.model.tree;
        let against = Displacement { cm: 0.0, cv: -self.h, cq: -self.h * self.h };
        let (q, v) = (&self.q_ref[n..], &self.v_ref[n..]);
        let at = JointPoint { tree, q, v, u: self.u, theta: self.theta, past: self.past };
        self.model.joint_terms.iter().for_each(|term| term.add_change(&at, against, &[], out, tree.nv()));
        for (l, dof) in tree.dofs().iter().enumerate() {
            out[l * tree.nv() + l] += self.theta[tree.joints()[dof.joint].armature];
        }
    }

    /// Frames and accelerations at q̄, v̄ of `ws`.
    pub(super) fn evaluate_frames(&self, v: &[f64], ws: &mut Workspace, partials: bool) {
        let n = self.model.n_node_dofs();
        let body = &mut ws.bodies;
        body.a.clear();
        body.a.extend(v[n..].iter().zip(&self.v_ref[n..]).map(|(v, old)| self.inertia * (v - old)));
        body.frames.origin = self.model.tree.origin(&self.q_ref[n..]);
        let g = self.model.gravity_vector(self.theta);
        let (tree, q, v) = (&self.model.tree, &ws.q_bar[n..], &ws.v_bar[n..]);
        if partials {
            body.frames.evaluate(tree, q, v, &body.a, &g);
        } else {
            body.frames.evaluate_values(tree, q, v, &body.a, &g);
        }
    }

    pub(super) fn joint_point<'a>(&'a self, q_bar: &'a [f64], v_bar: &'a [f64]) -> JointPoint<'a> {
        let n = self.model.n_node_dofs();
        JointPoint { tree: &self.model.tree, q: &q_bar[n..], v: &v_bar[n..], u: self.u, theta: self.theta, past: self.past }
    }

    /// The bodies' rows of the residual, with the frames at q̄, v̄ and the wrenches of contacts in place.
    pub(super) fn body_residual(&self, ws: &mut Workspace) {
        if !self.has_bodies() {
            return;
        }
        let n = self.model.n_node_dofs();
        let body = &mut ws.bodies;
        inverse_dynamics(&self.model.tree, &body.frames, &self.masses.bodies, &ws.loads.bodies, &mut body.forces, &mut ws.r[n..]);
        self.subtract_joint_forces(ws);
    }

    /// Completes the rows of inertia in `ws.r` by armatures and joint forces.
    fn subtract_joint_forces(&self, ws: &mut Workspace) {
        let n = self.model.n_node_dofs();
        let f = &mut ws.f[n..];
        f.fill(0.0);
        let at = self.joint_point(&ws.q_bar, &ws.v_bar);
        self.model.joint_terms.iter().for_each(|term| term.add_force(&at, f));
        for (l, dof) in self.model.tree.dofs().iter().enumerate() {
            let armature = self.theta[self.model.tree.joints()[dof.joint].armature];
            ws.r[n + l] += armature * ws.bodies.a[l] - f[l];
        }
    }

    /// The bodies' rows of the residual, their block of K and the blocks that couple them to nodes, with the frames at q̄, v̄ and the
    /// contacts linearized.
    pub(super) fn linearize_bodies(&self, ws: &mut Workspace) {
        if !self.has_bodies() {
            return;
        }
        let n = self.model.n_node_dofs();
        self.gather_partials(true, ws);
        let (tree, body) = (&self.model.tree, &mut ws.bodies);
        body.partials.tau(tree, &body.frames, &mut ws.r[n..]);
        body.middle.evaluate(tree, self.scheme.middle, &body.t);
        body.middle.jacobians(tree.joints().len(), &mut body.jacobians);
        self.subtract_joint_forces(ws);
        let mut k = std::mem::replace(&mut ws.k, System::empty());
        self.change_by_velocities(true, ws, &mut k);
        ws.k = k;
    }

    /// Composites at the frames in place; constraints with their multipliers following (`condensed`) or fixed.
    pub(super) fn gather_partials(&self, condensed: bool, ws: &mut Workspace) {
        let (body, changes) = (&mut ws.bodies, &mut ws.wrench_partials);
        changes.clear();
        ws.constraints.links().for_each(|link| link.add_partials(self.h, condensed, changes));
        changes.extend(self.drags().map(|drag| drag.partial(self.theta, &body.frames.bodies[drag.body])));
        body.partials.gather(&self.model.tree, &body.frames, &self.masses.bodies, &ws.loads.bodies, changes);
    }

    /// Overwrites the bodies' block and the coupling of `k` by the change of the residual with v⁺, for what was gathered.
    pub(super) fn change_by_velocities(&self, condensed: bool, ws: &mut Workspace, k: &mut System) {
        let w = &self.scheme.free;
        let by = Displacement { cm: self.inertia + self.options.damping, cv: w.b1, cq: self.h * w.a1 };
        let turns = std::mem::take(&mut ws.bodies.jacobians);
        self.add_body_change(by, &turns, ws, k.bodies.data_mut());
        self.add_crossings(ws.constraints.links(), by, condensed, (&ws.bodies.frames, &ws.bodies.partials), k);
        ws.bodies.jacobians = turns;
    }

    /// Overwrites `out` by the change of the residual for the displacement `by`.
    pub(super) fn add_body_change(&self, by: Displacement, turns: &[Option<Matrix3<f64>>], ws: &mut Workspace, out: &mut [f64]) {
        let tree = &self.model.tree;
        let stride = tree.nv();
        out.fill(0.0);
        ws.bodies.partials.add(tree, &ws.bodies.frames, by, turns, out, stride);
        for (l, dof) in tree.dofs().iter().enumerate() {
            out[l * stride + l] += by.cm * self.theta[tree.joints()[dof.joint].armature];
        }
        let against = Displacement { cm: -by.cm, cv: -by.cv, cq: -by.cq };
        let at = self.joint_point(&ws.q_bar, &ws.v_bar);
        self.model.joint_terms.iter().for_each(|term| term.add_change(&at, against, turns, out, stride));
    }

    /// −∂r/∂q̄ and −∂r/∂v̄ into the bodies' blocks of `ws.dq` and `ws.dv`, for what was gathered (contacts at fixed cone variables);
    /// returns ∂r/∂ā, the mass matrix.
    pub(super) fn body_partials(&self, ws: &mut Workspace) -> Square {
        let (tree, n) = (&self.model.tree, self.model.tree.nv());
        let mut mass = Square::zeros(n);
        if !self.has_bodies() {
            return mass;
        }
        ws.bodies.partials.add_mass(tree, &ws.bodies.frames, mass.data_mut(), n);
        for (l, dof) in tree.dofs().iter().enumerate() {
            mass.add(l, l, self.theta[tree.joints()[dof.joint].armature]);
        }
        let (mut dq, mut dv) = (std::mem::take(&mut ws.dq.bodies), std::mem::take(&mut ws.dv.bodies));
        let by = Displacement { cm: 0.0, cv: 0.0, cq: -1.0 };
        self.add_body_change(by, &[], ws, dq.data_mut());
        let mut crossed = System { nodes: NodeMatrix::empty(), bodies: dq, coupling: std::mem::take(&mut ws.dq.coupling) };
        self.add_crossings(ws.constraints.links(), by, false, (&ws.bodies.frames, &ws.bodies.partials), &mut crossed);
        (dq, ws.dq.coupling) = (crossed.bodies, crossed.coupling);
        if self.scheme.free.b0 != 0.0 {
            self.add_body_change(Displacement { cm: 0.0, cv: -1.0, cq: 0.0 }, &[], ws, dv.data_mut());
        }
        (ws.dq.bodies, ws.dv.bodies) = (dq, dv);
        mass
    }

    /// Turns from q_ref to q̄ and to q⁺ at the root `v`.
    pub(super) fn turns(&self, v: &[f64]) -> (TangentMaps, TangentMaps) {
        let (mut middle, mut end) = (TangentMaps::default(), TangentMaps::default());
        if self.model.tree.has_balls() {
            let (n, w) = (self.model.n_node_dofs(), &self.scheme.free);
            let mut t = Vec::new();
            tangent(self.h, [w.a0, w.a1], &self.v_ref[n..], &v[n..], &mut t);
            middle.evaluate(&self.model.tree, self.scheme.middle, &t);
            tangent(self.h, [w.d0, w.d1], &self.v_ref[n..], &v[n..], &mut t);
            end.evaluate(&self.model.tree, self.scheme.end, &t);
        }
        (middle, end)
    }
}

impl StageRecord {
    /// On which branches of their laws joint forces were.
    pub(super) fn joint_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let mut out = Vec::new();
        if !model.joint_terms.is_empty() {
            let (n, (q, v)) = (model.n_node_dofs(), self.evaluation_point(model));
            let past = Past { q: &self.start.q_past, z: &self.start.z_past, elapsed: self.start.elapsed };
            let at = JointPoint { tree: &model.tree, q: &q[n..], v: &v[n..], u: &self.start.u, theta, past };
            model.joint_terms.iter().for_each(|term| term.modes(&at, &mut out));
        }
        out
    }
}

/// q⁺ of the bodies.
pub(crate) fn end_positions(tree: &Tree, scheme: &Scheme, h: f64, q_ref: &[f64], v_ref: &[f64], v: &[f64], out: &mut [f64]) {
    let mut t = Vec::new();
    tangent(h, [scheme.free.d0, scheme.free.d1], v_ref, v, &mut t);
    tree.add(scheme.end, q_ref, &t, out);
}

impl Model {
    /// g [m/s²].
    pub fn gravity_vector(&self, theta: &[f64]) -> Vec3<f64> {
        let k = self.gravity;
        crate::terms::gravity_vector(theta[k], [theta[k + 1], theta[k + 2]])
    }

    /// Every body's inertia about its origin.
    pub fn inertias(&self, theta: &[f64]) -> Vec<Inertia<f64>> {
        self.tree.bodies().iter().map(|b| b.inertia.map_or_else(Inertia::zero, |i| i.evaluate(theta))).collect()
    }

    /// Computes [`DofWeights`] at the scene's parameters and initial configuration.
    pub(crate) fn dof_weights(&self) -> DofWeights {
        let n = self.tree.nv();
        let m = self.mass_matrix(&self.q0, self.params.values());
        let held: Vec<f64> = (0..n).map(|i| m[i * n + i]).collect();
        let mut yielding = held.clone();
        // trees that hang on the world do not feel each other's inertia
        for dofs in self.tree_dofs() {
            let block = nalgebra::DMatrix::from_fn(dofs.len(), dofs.len(), |i, j| m[dofs[i] * n + dofs[j]]);
            if let Some(factor) = block.cholesky() {
                dofs.iter().zip(factor.inverse().diagonal().iter()).for_each(|(&dof, x)| yielding[dof] = 1.0 / x);
            }
        }
        DofWeights { yielding, held }
    }

    /// Degrees of freedom of every tree that hangs on the world.
    fn tree_dofs(&self) -> Vec<Vec<usize>> {
        let mut roots: Vec<usize> = Vec::new();
        let mut dofs: Vec<Vec<usize>> = Vec::new();
        for (b, body) in self.tree.bodies().iter().enumerate() {
            roots.push(body.parent.map_or(b, |parent| roots[parent]));
            dofs.push(Vec::new());
            for joint in &self.tree.joints()[body.joints.clone()] {
                dofs[roots[b]].extend(joint.v..joint.v + joint.kind.n_dofs());
            }
        }
        dofs.retain(|dofs| !dofs.is_empty());
        dofs
    }

    /// Total mass of nodes and bodies \[kg\], armatures of turning joints counted as at a metre's distance.
    pub(crate) fn total_mass(&self, theta: &[f64]) -> f64 {
        let nodes: f64 = self.masses.iter().map(|m| m.mass(theta)).sum();
        let bodies: f64 = self.inertias(theta).iter().map(|i| i.m).sum();
        nodes + bodies + self.tree.joints().iter().map(|j| theta[j.armature]).sum::<f64>()
    }
}
