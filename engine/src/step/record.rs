//! Records of steps for their derivatives: the factorization at the root, and the partials of the residual.

use super::{Scheme, Stage, Workspace, end_positions};
use crate::bodies::dynamics::Displacement;
use crate::bodies::tangent_maps::TangentMaps;
use crate::model::Model;
use crate::rods::{Remembered, RodPast, RodPoint, TransportDerivative};
use crate::step::constraints::{ConstraintId, ConstraintRecords, InputsAt, LinkDof, RecordAt, for_node_inputs};
use crate::terms::Point;
use nalgebra::Vector4;
use pliant_linalg::{NodeMatrix, Square, System, SystemFactor};
use pliant_math::{Input, Vec3};
use std::borrow::Cow;

/// Where a stage began.
#[derive(Clone, Debug)]
pub struct StageStart {
    /// Reference positions and velocities of the stage.
    pub q_ref: Vec<f64>,
    /// Reference velocities.
    pub v_ref: Vec<f64>,
    /// z's part of rods at q_ref.
    pub frames: Vec<f64>,
    /// Controls of the step as motors receive them.
    pub u: Vec<f64>,
    /// The bodies' coordinates at the beginning of the (sub)step; empty if there are no history variables.
    pub q_past: Vec<f64>,
    /// History variables there.
    pub z_past: Vec<f64>,
    /// The strains of rods there; empty if none has history variables.
    pub rod_past: RodPast,
    /// Time from there to the evaluation \[s\].
    pub elapsed: f64,
}

/// How changes of the stage's reference, of the tangent and of the substep's start show up at other configurations.
#[derive(Clone, Debug)]
pub struct Transport {
    /// Of bodies: of q_ref and of the tangent at q̄.
    pub middle: TangentMaps,
    /// At q⁺.
    pub end: TangentMaps,
    /// From the substep's start to q_ref; only in the second stage of sdirk2.
    pub lead: TangentMaps,
    /// Of rods' axes: at q̄, at q⁺, and as for `lead`.
    pub carry: [TransportDerivative; 3],
}

/// Matrices at the root.
#[derive(Clone, Debug)]
pub struct Jacobians {
    /// ∂f/∂q̄ [N/m], zero in prescribed rows; constraints at fixed multipliers.
    pub dq: System,
    /// ∂f/∂v̄ [N·s/m]; empty in schemes that take forces at v⁺ alone.
    pub dv: System,
    /// A = ∂r/∂v⁺, constraints at fixed multipliers: see [`StageRecord::subtract_system`].
    pub matrix: System,
    /// The factorization of K, A with the constraints condensed into it.
    pub factor: SystemFactor,
    /// Mass matrix of the bodies at q̄, armatures included.
    pub body_mass: Square,
}

/// A solved stage: the unsymmetric matrix factored at the root, and everything the residual depends on.
#[derive(Clone, Debug)]
pub struct StageRecord {
    /// Stage length h \[s\].
    pub h: f64,
    /// Weights of the scheme.
    pub scheme: Scheme,
    /// Inertia weight σ [1/s].
    pub inertia: f64,
    /// Rest gap of the smoothing \[m\].
    pub rest_gap: f64,
    /// Where it began.
    pub start: StageStart,
    /// The root v⁺ [m/s].
    pub v: Vec<f64>,
    /// Matrices there.
    pub jacobians: Jacobians,
    /// Whether forces depend on positions alone, but for those of nodes' contacts.
    pub undamped: bool,
    /// How changes of its start and end show up.
    pub transport: Transport,
    /// ∂z⁺/∂input of the materials at the end of the (sub)step, as (place, input, derivative): in its last stage, if anything remembers.
    pub memory: Vec<(usize, Input, f64)>,
    pub(crate) constraints: ConstraintRecords,
    /// −∂f/∂input of the grippers that grasp, at fixed positions of nodes, and numbers that tell their modes apart.
    pub grasps: Vec<(usize, Input, f64)>,
    pub(crate) grasp_modes: Vec<u8>,
}

impl StageRecord {
    /// Factors at the root in `ws.it` and copies what derivatives need.
    pub(crate) fn take(stage: &Stage, ws: &mut Workspace) -> Result<Self, super::StepError> {
        stage.linearize(ws)?;
        ws.factor.refactor(&ws.k).map_err(|source| super::StepError::Singular { step: 0, source })?;
        let (middle, end) = stage.turns(&ws.it.v);
        let constraints = Self::constraints(stage, &middle, ws);
        if ws.constraints.any_listed() {
            stage.gather_partials(false, ws);
        }
        let body_mass = stage.body_partials(ws);
        let only_nodes_touch = stage.model.tree.nv() == 0 && stage.joint_rows.is_empty() && !ws.constraints.any_listed();
        let (dq, dv, matrix) = stage.at_fixed_impulses(ws);
        ws.blocks.restore_rates(&mut ws.dv.nodes);
        let undamped = only_nodes_touch && ws.dv.nodes.is_zero();
        let start = StageStart {
            q_ref: stage.q_ref.to_vec(),
            v_ref: stage.v_ref.to_vec(),
            frames: stage.frames.to_vec(),
            u: stage.u.to_vec(),
            q_past: stage.past.q.to_vec(),
            z_past: stage.past.z.to_vec(),
            rod_past: stage.rod_past.clone(),
            elapsed: stage.past.elapsed,
        };
        let carry = [std::mem::take(&mut ws.carry), TransportDerivative::default(), TransportDerivative::default()];
        Ok(Self {
            h: stage.h,
            scheme: stage.scheme,
            inertia: stage.inertia,
            rest_gap: stage.options.rest_gap,
            start,
            v: ws.it.v.clone(),
            jacobians: Jacobians { dq, dv, matrix, factor: ws.factor.clone(), body_mass },
            undamped,
            transport: Transport { middle, end, lead: TangentMaps::default(), carry },
            memory: Vec::new(),
            constraints,
            grasps: Vec::new(),
            grasp_modes: Vec::new(),
        })
    }

    /// The constraints, linearized at the root.
    fn constraints(stage: &Stage, turns: &TangentMaps, ws: &mut Workspace) -> ConstraintRecords {
        let mut out = ConstraintRecords::new(ws.it.v.len());
        let by_v: Vec<Vec<LinkDof>> = {
            let body = &ws.bodies;
            ws.constraints.links().map(|link| stage.link_dofs(link, &body.frames, &body.partials)).collect()
        };
        if !by_v.is_empty() {
            let by = Displacement { cm: 0.0, cv: 0.0, cq: 1.0 };
            ws.bodies.partials.fill_columns(&stage.model.tree, &ws.bodies.frames, by, &[]);
        }
        let mut at = RecordAt { frames: &ws.bodies.frames, partials: &ws.bodies.partials, turns, by_v: &mut by_v.iter() };
        ws.constraints.parts(&ws.it.lambda).for_each(|(set, own)| set.record(stage, &mut at, own, &mut out));
        out
    }

    /// Positions at the end of the stage \[m\].
    pub fn q_end(&self, model: &Model) -> Vec<f64> {
        let mut q = self.start.q_ref.clone();
        let n = model.n_node_dofs();
        end_positions(
            &model.tree,
            &self.scheme,
            self.h,
            &self.start.q_ref[n..],
            &self.start.v_ref[n..],
            &self.v[n..],
            &mut q[n..],
        );
        for (k, &is_prescribed) in model.prescribed_rows.iter().enumerate() {
            let w = if is_prescribed { &self.scheme.prescribed } else { &self.scheme.free };
            q[k] += self.h * (w.d0 * self.start.v_ref[k] + w.d1 * self.v[k]);
        }
        q
    }

    /// ∂f/∂q̄ of nodes and twists where edges carry rods' axes along with displacements of their nodes: ∂f/∂q̄ (1 + ψ_b) [N/m].
    pub fn carried_positions(&self, model: &Model) -> Cow<'_, NodeMatrix> {
        let (dq, carry) = (&self.jacobians.dq.nodes, &self.transport.carry[0]);
        if carry.is_empty() {
            return Cow::Borrowed(dq);
        }
        let (mut out, places) = (dq.clone(), model.rods.carried_places(dq));
        carry.visit_after(|edge, _, psi| out.add_carried(dq, &places[edge], [-psi, psi].map(Into::into)));
        Cow::Owned(out)
    }

    /// 0 separate, 1 stick, 2 slip, for every contact pair at the root; then for every joint friction 1 stick, 2 or 3 slip this way or
    /// that (plus 4 under a negative load), for every stop 0 open, 1 closed, and for every coupling 0; for every motor with limits 0 within, 1 and 2 beyond
    /// one. Then, for every contact of colliders that is near, numbers that tell it apart, and 0, 1 or 2 as for pairs; and for every
    /// gripper that grasps, two that tell what it does; and for every joint of a plastic rod the phases of its flow, of one with
    /// friction whether it loads or unloads.
    pub fn contact_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let (q, _) = self.evaluation_point(model);
        let at = InputsAt { stage: self, model, theta, q: &q };
        let mode = |of_nodes: bool| {
            let cones = self.constraints.cones.iter().filter(move |cone| cone.is_of_node() == of_nodes);
            cones.flat_map(|cone| cone.mode(&at))
        };
        let joints = self.row_modes(&at).into_iter().chain(self.joint_modes(model, theta));
        let others = mode(false).chain(self.grasp_modes.iter().copied());
        mode(true).chain(joints).chain(others).chain(self.flow_modes(model, theta)).collect()
    }

    /// Phases of what flows in rods' sections, where the force is evaluated and, if that is elsewhere, at the end.
    fn flow_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let (rods, mut out) = (&model.rods, Vec::new());
        if !rods.remember() {
            return out;
        }
        let mut at = RodPoint::default();
        rods.evaluate(&self.start.q_ref, &self.start.frames, &self.evaluation_point(model).0, &mut at);
        rods.modes(&at, theta, self.remembered(), &mut out);
        if self.scheme.free.a1 != self.scheme.free.d1 {
            rods.evaluate(&self.start.q_ref, &self.start.frames, &self.q_end(model), &mut at);
            rods.modes(&at, theta, Remembered { elapsed: self.h, ..self.remembered() }, &mut out);
        }
        out
    }

    /// Calls `visit(row, input, ∂(r, F)_row/∂input)` for every structural nonzero of the system's derivative with respect to parameters,
    /// what motors see (`U`), internal variables (`Z`) and coordinates (`Q`) at the beginning of the (sub)step, commanded velocities; rows as in [`StageRecord::subtract_system`].
    pub fn visit_inputs(&self, model: &Model, theta: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let (q_bar, v_bar) = self.evaluation_point(model);
        self.visit_bodies(model, theta, &q_bar, &v_bar, visit);
        self.grasps.iter().for_each(|&(row, input, value)| visit(row, input, value));
        self.visit_rows(&InputsAt { stage: self, model, theta, q: &q_bar }, visit);
        self.visit_rod_past(model, theta, &q_bar, visit);
        self.visit_nodes(model, theta, &q_bar, &v_bar, visit);
    }

    /// As [`StageRecord::visit_inputs`], contracted: calls `pull(input, Σ_row λ_row ∂(r, F)_row/∂input)`, an input's sum in one call or several.
    pub fn pull_inputs(&self, model: &Model, theta: &[f64], lambda: &[f64], pull: &mut dyn FnMut(Input, f64)) {
        let (q_bar, v_bar) = self.evaluation_point(model);
        self.pull_bodies(model, theta, [&q_bar, &v_bar], lambda, pull);
        self.grasps.iter().for_each(|&(row, input, value)| pull(input, value * lambda[row]));
        let at = InputsAt { stage: self, model, theta, q: &q_bar };
        self.visit_rows(&at, &mut |row, input, value| pull(input, value * lambda[row]));
        self.visit_rod_past(model, theta, &q_bar, &mut |row, input, value| pull(input, value * lambda[row]));
        self.pull_nodes(model, theta, [&q_bar, &v_bar], lambda, pull);
    }

    /// As [`StageRecord::visit_inputs`] where no parameter is asked for: visits all inputs that are none, and few that are.
    pub fn visit_signals(&self, model: &Model, theta: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let (q_bar, v_bar) = self.evaluation_point(model);
        self.visit_joints(model, theta, [&q_bar, &v_bar], false, visit);
        self.grasps.iter().for_each(|&(row, input, value)| visit(row, input, value));
        if model.nz() > 0 {
            self.visit_rows(&InputsAt { stage: self, model, theta, q: &q_bar }, visit);
        }
        self.visit_rod_past(model, theta, &q_bar, visit);
    }

    /// As `visit_nodes`, contracted.
    fn pull_nodes(
        &self,
        model: &Model,
        theta: &[f64],
        [q_bar, v_bar]: [&[f64]; 2],
        lambda: &[f64],
        pull: &mut dyn FnMut(Input, f64),
    ) {
        let at = Point { q: q_bar, v: v_bar, theta };
        let mut sums = vec![0.0; theta.len()];
        let n = self.v.len();
        let weights: Vec<f64> = lambda[..n]
            .iter()
            .enumerate()
            .map(|(row, x)| if model.prescribed_rows.get(row).is_some_and(|prescribed| *prescribed) { 0.0 } else { -x })
            .collect();
        model.terms.iter().for_each(|term| term.pull_theta(&at, &weights, &mut sums));
        self.visit_rods(model, theta, q_bar, v_bar, &mut |row, param, value| sums[param] += value * lambda[row]);
        for (node, mass) in model.masses.iter().enumerate().filter(|(i, _)| !model.prescribed[*i]) {
            let product: f64 = (3 * node..3 * node + 3).map(|row| lambda[row] * (self.v[row] - self.start.v_ref[row])).sum();
            mass.visit(theta, &mut |param, dm| sums[param] += dm * self.inertia * product);
        }
        let inputs = InputsAt { stage: self, model, theta, q: q_bar };
        for cone in &self.constraints.cones {
            let ConstraintId::Node(pair) = cone.id else { continue };
            let (node, row) = (model.pairs[pair].node, cone.block.row);
            let of_node = Vec3::from_column_slice(&lambda[3 * node..3 * node + 3]) * (-1.0 / self.h);
            let of_cone = Vector4::from_column_slice(&lambda[row..row + 4]);
            for_node_inputs(cone, pair, &inputs, &mut |param, dp, df| sums[param] += of_node.dot(&dp) + of_cone.dot(&df));
        }
        for cone in self.constraints.cones.iter().filter(|cone| !cone.is_of_node()) {
            cone.visit_node_inputs(&inputs, &mut |row, input, value| pull(input, value * lambda[row]));
        }
        sums.iter().enumerate().filter(|(_, sum)| **sum != 0.0).for_each(|(param, sum)| pull(Input::Theta(param), *sum));
    }

    fn visit_nodes(&self, model: &Model, theta: &[f64], q_bar: &[f64], v_bar: &[f64], to: &mut dyn FnMut(usize, Input, f64)) {
        let visit = &mut |row: usize, param: usize, value: f64| to(row, Input::Theta(param), value);
        let at = Point { q: q_bar, v: v_bar, theta };
        for term in &model.terms {
            term.visit_theta(&at, &mut |row, param, df| {
                if !model.prescribed_rows[row] {
                    visit(row, param, -df);
                }
            });
        }
        self.visit_rods(model, theta, q_bar, v_bar, visit);
        for (node, mass) in model.masses.iter().enumerate().filter(|(i, _)| !model.prescribed[*i]) {
            mass.visit(theta, &mut |param, dm| {
                for row in 3 * node..3 * node + 3 {
                    visit(row, param, dm * self.inertia * (self.v[row] - self.start.v_ref[row]));
                }
            });
        }
        let at = InputsAt { stage: self, model, theta, q: q_bar };
        self.constraints.cones.iter().for_each(|cone| cone.visit_node_inputs(&at, to));
    }

    fn visit_rods(&self, model: &Model, theta: &[f64], q_bar: &[f64], v_bar: &[f64], visit: &mut dyn FnMut(usize, usize, f64)) {
        let rods = &model.rods;
        let mut at = RodPoint::default();
        rods.evaluate(&self.start.q_ref, &self.start.frames, q_bar, &mut at);
        rods.visit_theta(&at, v_bar, theta, self.remembered(), &mut |row, param, df| {
            if !model.prescribed_rows[row] {
                visit(row, param, -df);
            }
        });
        for (k, edge) in rods.edges.iter().enumerate().filter(|(k, _)| !model.prescribed_rows[rods.row(*k)]) {
            let row = rods.row(k);
            edge.visit(theta, &mut |param, dm| visit(row, param, dm * self.inertia * (self.v[row] - self.start.v_ref[row])));
        }
    }

    /// History variables of rod sections as the (sub)step began.
    fn remembered(&self) -> Remembered<'_> {
        Remembered { past: &self.start.rod_past, z: &self.start.z_past, elapsed: self.start.elapsed }
    }

    /// ∂r/∂(z, q at the beginning) of what rods' sections remember.
    fn visit_rod_past(&self, model: &Model, theta: &[f64], q_bar: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let rods = &model.rods;
        if !rods.remember() {
            return;
        }
        let mut at = RodPoint::default();
        rods.evaluate(&self.start.q_ref, &self.start.frames, q_bar, &mut at);
        rods.visit_past(&at, theta, self.remembered(), &mut |row, input, df| {
            if !model.prescribed_rows[row] {
                visit(row, input, -df);
            }
        });
    }

    /// Where the forces were evaluated.
    pub fn evaluation_point(&self, model: &Model) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (self.start.q_ref.clone(), self.v.clone());
        let (n, w) = (model.n_node_dofs(), &self.scheme.free);
        let mut t = Vec::new();
        super::bodies::tangent(self.h, [w.a0, w.a1], &self.start.v_ref[n..], &self.v[n..], &mut t);
        model.tree.add(self.scheme.middle, &self.start.q_ref[n..], &t, &mut q[n..]);
        (n..v.len()).for_each(|k| v[k] = w.b0 * self.start.v_ref[k] + w.b1 * self.v[k]);
        for (k, &is_prescribed) in model.prescribed_rows.iter().enumerate() {
            let w = if is_prescribed { &self.scheme.prescribed } else { &self.scheme.free };
            q[k] += self.h * (w.a0 * self.start.v_ref[k] + w.a1 * self.v[k]);
            v[k] = w.b0 * self.start.v_ref[k] + w.b1 * self.v[k];
        }
        (q, v)
    }

    /// `∂v_cmd` does not belong to a stage: it is shared by all stages of a step. See [`Input`].
    #[doc(hidden)]
    pub fn command_inputs(model: &Model, state: [&[f64]; 2], u: &[f64], theta: &[f64], h: f64) -> Vec<(usize, Input, f64)> {
        let mut out = Vec::new();
        for drive in &model.drives {
            drive.visit(state, u, theta, h, &mut |row, input, value| out.push((row, input, value)));
        }
        out
    }
}
