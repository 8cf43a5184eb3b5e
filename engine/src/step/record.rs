//! What a step leaves behind for its derivatives: the factorization at the root, and the partials of the residual.

use super::contact_rows::RowRecord;
use super::spot_rows::SpotRecord;
use super::stage::weighed;
use super::{Scheme, Stage, Workspace, end_positions};
use crate::bodies::turns::Turns;
use crate::contact::{Condensed, Touch};
use crate::kinematics::Input;
use crate::kkt::{Square, System, SystemFactor};
use crate::model::Model;
use crate::rods::{Carry, Remembered, RodPast, RodPoint};
use crate::terms::{Point, Vec3};
use nalgebra::Vector4;

/// Tangential over normal impulse, |γ_t|/(μ γ_n), above which a contact counts as slipping.
const SLIP: f64 = 0.999;

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
    /// Reference positions and velocities of the stage.
    pub q_ref: Vec<f64>,
    /// Reference velocities.
    pub v_ref: Vec<f64>,
    /// The root v⁺ [m/s].
    pub v: Vec<f64>,
    /// Cone variables at the root [N·s].
    pub w: Vec<Vector4<f64>>,
    /// ∂f/∂q̄ [N/m] at the root, zero in driven rows; contacts at fixed w.
    pub dq: System,
    /// ∂f/∂v̄ [N·s/m]; empty in schemes that take forces at v⁺ alone.
    pub dv: System,
    /// A = ∂r/∂v⁺ at the root, contacts at fixed w: see [`contact_rows`](StageRecord::subtract_system).
    pub matrix: System,
    /// Whether forces depend on positions alone and nothing touches: then K = σ M − h a1 ∂f/∂q̄ in free rows, and is symmetric.
    pub elastic: bool,
    /// The same of forces, where contacts of nodes may touch: what depends on velocities is theirs alone.
    pub undamped: bool,
    /// The factorization of K, A with the contacts condensed into it.
    pub factor: SystemFactor,
    /// Mass matrix of the bodies at q̄, armatures included.
    pub body_mass: Square,
    /// What motors saw of the controls of the step.
    pub u: Vec<f64>,
    /// The bodies' coordinates at the beginning of the (sub)step; empty if nothing remembers.
    pub q_past: Vec<f64>,
    /// Internal variables there.
    pub z_past: Vec<f64>,
    /// The strains of rods there; empty if none remembers.
    pub rod_past: RodPast,
    /// Time from there to the evaluation \[s\].
    pub elapsed: f64,
    /// ∂z⁺/∂input of the materials at the end of the (sub)step, as (place, input, derivative): in its last stage, if anything remembers.
    pub memory: Vec<(usize, Input, f64)>,
    /// How changes of q_ref and of the tangent show up at q̄, at q⁺, and (second stage of sdirk2) at q_ref.
    pub middle: Turns,
    /// At q⁺.
    pub end: Turns,
    /// From the substep's start to q_ref; only in the second stage of sdirk2.
    pub lead: Turns,
    /// z's part of rods at q_ref.
    pub frames: Vec<f64>,
    /// How changes of q_ref, of the tangent and of the substep's start show up in rods' axes: at q̄, at q⁺, and as for `lead`.
    pub carry: [Carry; 3],
    pub(crate) contacts: Vec<Condensed>,
    /// Node of each contact.
    pub(crate) contact_nodes: Vec<usize>,
    /// Impulses of joint friction, stops and couplings at the root [N·m·s, N·s].
    pub s: Vec<f64>,
    /// −∂f/∂input of the grippers that grasp, at fixed positions of nodes, and numbers that tell apart what they do.
    pub grasps: Vec<(usize, Input, f64)>,
    pub(crate) grasp_modes: Vec<u8>,
    pub(crate) rows: Vec<RowRecord>,
    pub(crate) spots: Vec<SpotRecord>,
}

impl StageRecord {
    /// Factors at the root in `ws.it` and copies what derivatives need.
    pub(crate) fn take(stage: &Stage, ws: &mut Workspace) -> Result<Self, super::StepError> {
        stage.linearize(ws)?;
        ws.factor.refactor(&ws.k).map_err(|source| super::StepError::Singular { step: 0, source })?;
        let spots = stage.spot_records(ws);
        if !ws.spots.spots.is_empty() {
            stage.gather_partials(false, ws);
        }
        let body_mass = stage.body_partials(ws);
        let (middle, end) = stage.turns(&ws.it.v);
        let nothing_touches = stage.model.tree.nv() == 0 && stage.measure.rows.is_empty() && ws.spots.spots.is_empty();
        let elastic = nothing_touches && ws.factor.is_symmetric() && ws.dv.nodes.is_zero();
        let (dq, dv, matrix) = stage.at_fixed_impulses(ws);
        let only_nodes_touch = stage.model.tree.nv() == 0 && stage.measure.rows.is_empty() && ws.spots.spots.is_empty();
        for (node, [_, of_velocities, _]) in &ws.touching {
            ws.dv.nodes.set_block(*node, *node, of_velocities);
        }
        let undamped = only_nodes_touch && ws.dv.nodes.is_zero();
        Ok(Self {
            h: stage.h,
            scheme: stage.scheme,
            inertia: stage.inertia,
            rest_gap: stage.rest_gap,
            q_ref: stage.q_ref.to_vec(),
            v_ref: stage.v_ref.to_vec(),
            v: ws.it.v.clone(),
            w: ws.it.w.clone(),
            dq,
            dv,
            matrix,
            elastic,
            undamped,
            factor: ws.factor.clone(),
            body_mass,
            u: stage.u.to_vec(),
            q_past: stage.past.q.to_vec(),
            z_past: stage.past.z.to_vec(),
            rod_past: stage.rod_past.clone(),
            elapsed: stage.past.elapsed,
            memory: Vec::new(),
            middle,
            end,
            lead: Turns::default(),
            frames: stage.frames.to_vec(),
            carry: [std::mem::take(&mut ws.carry), Carry::default(), Carry::default()],
            contacts: ws.contacts.clone(),
            contact_nodes: stage.model.pairs.iter().map(|p| p.node).collect(),
            s: ws.it.s.clone(),
            rows: stage.row_records(&ws.rows),
            grasps: Vec::new(),
            grasp_modes: Vec::new(),
            spots,
        })
    }

    /// Positions at the end of the stage \[m\].
    pub fn q_end(&self, model: &Model) -> Vec<f64> {
        let mut q = self.q_ref.clone();
        let n = model.n_node_dofs();
        end_positions(&model.tree, &self.scheme, self.h, &self.q_ref[n..], &self.v_ref[n..], &self.v[n..], &mut q[n..]);
        for (k, &is_driven) in model.driven_rows.iter().enumerate() {
            let w = if is_driven { &self.scheme.driven } else { &self.scheme.free };
            q[k] += self.h * (w.d0 * self.v_ref[k] + w.d1 * self.v[k]);
        }
        q
    }

    /// 0 separate, 1 stick, 2 slip, for every contact pair at the root; then for every joint friction 1 stick, 2 or 3 slip this way or
    /// that (plus 4 under a negative load), for every stop 0 open, 1 closed, and for every coupling 0; for every motor with limits 0 within, 1 and 2 beyond
    /// one. Then, for every contact of solids that is near, numbers that tell it apart, and 0, 1 or 2 as for pairs; and for every
    /// gripper that grasps, two that tell what it does; and for every joint of a plastic rod the phases of its flow, of one with
    /// friction whether it loads or unloads.
    pub fn contact_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let g = theta[model.gravity];
        let mode = |(pair, w): (&crate::contact::ContactPair, &Vector4<f64>)| {
            let mass = model.masses[pair.node].mass(theta);
            let centre = (self.rest_gap * mass * g * mass).sqrt();
            let load = (w[1] * w[1] + w[2] * w[2] + w[3] * w[3]).sqrt() / w[0];
            if w[0] < centre { 0 } else { 1 + u8::from(load > SLIP) }
        };
        let joints = self.row_modes(model, theta).into_iter().chain(self.joint_modes(model, theta));
        let spots = self.spot_modes(model, theta).into_iter().chain(self.grasp_modes.iter().copied());
        let flows = self.flow_modes(model, theta);
        model.pairs.iter().zip(&self.w).map(mode).chain(joints).chain(spots).chain(flows).collect()
    }

    /// Phases of what flows in rods' sections, where the force is evaluated and, if that is elsewhere, at the end.
    fn flow_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let (rods, mut out) = (&model.rods, Vec::new());
        if !rods.remember() {
            return out;
        }
        let mut at = RodPoint::default();
        rods.evaluate(&self.q_ref, &self.frames, &self.evaluation_point(model).0, &mut at);
        rods.modes(&at, theta, self.remembered(), &mut out);
        if self.scheme.free.a1 != self.scheme.free.d1 {
            rods.evaluate(&self.q_ref, &self.frames, &self.q_end(model), &mut at);
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
        self.visit_rows(model, theta, &q_bar, visit);
        self.visit_rod_past(model, theta, &q_bar, visit);
        self.visit_nodes(model, theta, &q_bar, &v_bar, &mut |row, param, value| visit(row, Input::Theta(param), value));
    }

    /// As [`StageRecord::visit_inputs`], contracted: calls `pull(input, Σ_row λ_row ∂(r, F)_row/∂input)`, an input's sum in one call or several.
    pub fn pull_inputs(&self, model: &Model, theta: &[f64], lambda: &[f64], pull: &mut dyn FnMut(Input, f64)) {
        let (q_bar, v_bar) = self.evaluation_point(model);
        self.pull_bodies(model, theta, [&q_bar, &v_bar], lambda, pull);
        self.grasps.iter().for_each(|&(row, input, value)| pull(input, value * lambda[row]));
        self.visit_rows(model, theta, &q_bar, &mut |row, input, value| pull(input, value * lambda[row]));
        self.visit_rod_past(model, theta, &q_bar, &mut |row, input, value| pull(input, value * lambda[row]));
        self.pull_nodes(model, theta, [&q_bar, &v_bar], lambda, pull);
    }

    /// As [`StageRecord::visit_inputs`] where no parameter is asked for: visits all inputs that are none, and few that are.
    pub fn visit_signals(&self, model: &Model, theta: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let (q_bar, v_bar) = self.evaluation_point(model);
        self.visit_joints(model, theta, [&q_bar, &v_bar], false, visit);
        self.grasps.iter().for_each(|&(row, input, value)| visit(row, input, value));
        if model.nz() > 0 {
            self.visit_rows(model, theta, &q_bar, visit);
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
            .map(|(row, x)| if model.driven_rows.get(row).is_some_and(|driven| *driven) { 0.0 } else { -x })
            .collect();
        model.terms.iter().for_each(|term| term.pull_theta(&at, &weights, &mut sums));
        self.visit_rods(model, theta, q_bar, v_bar, &mut |row, param, value| sums[param] += value * lambda[row]);
        for (node, mass) in model.masses.iter().enumerate().filter(|(i, _)| !model.driven[*i]) {
            let product: f64 = (3 * node..3 * node + 3).map(|row| lambda[row] * (self.v[row] - self.v_ref[row])).sum();
            mass.visit(theta, &mut |param, dm| sums[param] += dm * self.inertia * product);
        }
        for c in 0..self.contacts.len() {
            let (node, row) = (model.pairs[c].node, n + 4 * c);
            let of_node = Vec3::from_column_slice(&lambda[3 * node..3 * node + 3]) * (-1.0 / self.h);
            let of_cone = Vector4::from_column_slice(&lambda[row..row + 4]);
            self.for_contact_inputs(c, model, q_bar, theta, &mut |param, dp, df| {
                sums[param] += of_node.dot(&dp) + of_cone.dot(&df)
            });
        }
        sums.iter().enumerate().filter(|(_, sum)| **sum != 0.0).for_each(|(param, sum)| pull(Input::Theta(param), *sum));
    }

    fn visit_nodes(&self, model: &Model, theta: &[f64], q_bar: &[f64], v_bar: &[f64], visit: &mut dyn FnMut(usize, usize, f64)) {
        let at = Point { q: q_bar, v: v_bar, theta };
        for term in &model.terms {
            term.visit_theta(&at, &mut |row, param, df| {
                if !model.driven_rows[row] {
                    visit(row, param, -df);
                }
            });
        }
        self.visit_rods(model, theta, q_bar, v_bar, visit);
        for (node, mass) in model.masses.iter().enumerate().filter(|(i, _)| !model.driven[*i]) {
            mass.visit(theta, &mut |param, dm| {
                for row in 3 * node..3 * node + 3 {
                    visit(row, param, dm * self.inertia * (self.v[row] - self.v_ref[row]));
                }
            });
        }
        for c in 0..self.contacts.len() {
            self.visit_contact(c, model, q_bar, theta, visit);
        }
    }

    fn visit_rods(&self, model: &Model, theta: &[f64], q_bar: &[f64], v_bar: &[f64], visit: &mut dyn FnMut(usize, usize, f64)) {
        let rods = &model.rods;
        let mut at = RodPoint::default();
        rods.evaluate(&self.q_ref, &self.frames, q_bar, &mut at);
        rods.visit_theta(&at, v_bar, theta, self.remembered(), &mut |row, param, df| {
            if !model.driven_rows[row] {
                visit(row, param, -df);
            }
        });
        for (k, edge) in rods.edges.iter().enumerate().filter(|(k, _)| !model.driven_rows[rods.row(*k)]) {
            let row = rods.row(k);
            edge.visit(theta, &mut |param, dm| visit(row, param, dm * self.inertia * (self.v[row] - self.v_ref[row])));
        }
    }

    /// What rods' sections remembered.
    fn remembered(&self) -> Remembered<'_> {
        Remembered { past: &self.rod_past, z: &self.z_past, elapsed: self.elapsed }
    }

    /// ∂r/∂(z, q at the beginning) of what rods' sections remember.
    fn visit_rod_past(&self, model: &Model, theta: &[f64], q_bar: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let rods = &model.rods;
        if !rods.remember() {
            return;
        }
        let mut at = RodPoint::default();
        rods.evaluate(&self.q_ref, &self.frames, q_bar, &mut at);
        rods.visit_past(&at, theta, self.remembered(), &mut |row, input, df| {
            if !model.driven_rows[row] {
                visit(row, input, -df);
            }
        });
    }

    /// Where the forces were evaluated.
    pub fn evaluation_point(&self, model: &Model) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (self.q_ref.clone(), self.v.clone());
        let (n, w) = (model.n_node_dofs(), &self.scheme.free);
        let mut t = Vec::new();
        super::bodies::tangent(self.h, [w.a0, w.a1], &self.v_ref[n..], &self.v[n..], &mut t);
        model.tree.add(self.scheme.middle, &self.q_ref[n..], &t, &mut q[n..]);
        (n..v.len()).for_each(|k| v[k] = w.b0 * self.v_ref[k] + w.b1 * self.v[k]);
        for (k, &is_driven) in model.driven_rows.iter().enumerate() {
            let w = if is_driven { &self.scheme.driven } else { &self.scheme.free };
            q[k] += self.h * (w.a0 * self.v_ref[k] + w.a1 * self.v[k]);
            v[k] = w.b0 * self.v_ref[k] + w.b1 * self.v[k];
        }
        (q, v)
    }

    fn visit_contact(&self, c: usize, model: &Model, q: &[f64], theta: &[f64], visit: &mut dyn FnMut(usize, usize, f64)) {
        let (node, row) = (model.pairs[c].node, self.v.len() + 4 * c);
        self.for_contact_inputs(c, model, q, theta, &mut |param, dp, df| {
            for a in 0..3 {
                visit(3 * node + a, param, -dp[a] / self.h);
            }
            for a in 0..4 {
                visit(row + a, param, df[a]);
            }
        });
    }

    /// The impulse of a contact depends on θ through gap and normal (shape, radius), friction, and κ = δ m g: calls
    /// `emit(parameter, ∂p/∂θ at fixed w, ∂F/∂θ)`.
    fn for_contact_inputs(
        &self,
        c: usize,
        model: &Model,
        q: &[f64],
        theta: &[f64],
        emit: &mut dyn FnMut(usize, Vec3<f64>, Vector4<f64>),
    ) {
        let pair = &model.pairs[c];
        let contact = &self.contacts[c];
        let node_vector = |x: &[f64]| Vec3::new(x[3 * pair.node], x[3 * pair.node + 1], x[3 * pair.node + 2]);
        let (x, v, w) = (node_vector(q), node_vector(&self.v), &self.w[c]);
        let shape = &model.shapes[pair.shape];
        let Ok(touch) = Touch::new(shape, x, v, self.h, theta[pair.radius], theta) else { return };
        // the geometry was evaluated above without error, so it is here
        let _ = shape.visit_theta(&x, pair.radius, theta, &mut |param, dgap, dn| {
            let dv_t = -(dn * touch.normal.dot(&v)) - touch.normal * dn.dot(&v);
            emit(param, dn * w[0], contact.df_dvn * (dgap / self.h) + contact.df_dvt * dv_t);
        });
        emit(pair.friction, Vec3::new(w[1], w[2], w[3]), contact.df_dmu);
        let (mass, (g, slope)) = (model.masses[pair.node].mass(theta), weighed(theta[model.gravity]));
        let by_kappa = contact.df_dkappa * self.rest_gap;
        emit(model.gravity, Vec3::zeros(), by_kappa * (mass * slope));
        model.masses[pair.node].visit(theta, &mut |param, dm| emit(param, Vec3::zeros(), by_kappa * (dm * g)));
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
