//! One nonlinear system: residual and matrix of a stage.
//!
//! ```text
//! free rows:    r = m (v⁺ − v) σ − Σ f(q̄, v̄; θ) − p/h      [N]     (σ = 1/h; at rest a pseudo-time weight)
//! prescribed rows:  r = v⁺ − v_cmd                              [m/s]
//! K = ∂r/∂v⁺ = σ M − h ∂f/∂q̄ a1 − ∂f/∂v̄ b1
//! ```
//! with the impulses p of contact condensed as described in `contact`.

use super::{Scheme, SolverOptions, StepError, Weights, Workspace};
use crate::bodies::operational::mobilities;
use crate::constraints::JointRow;
use crate::grasp::Hold;
use crate::memory::Past;
use crate::model::Model;
use crate::rods::{Remembered, RodEdge, RodPast};
use crate::step::constraints::{Beginning, Change, Evaluation, Loads, Slopes};
use crate::terms::Point;
use pliant_linalg::System;
use pliant_math::spatial::Inertia;
use pliant_scene::Integrator;

/// The unknowns of a stage, or a change of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Iterate {
    /// Velocities v⁺ of all rows [m/s, rad/s].
    pub v: Vec<f64>,
    /// Multipliers of the constraints, in the order of [`crate::step::constraints::Constraints::sets`] [N·s, N·m·s].
    pub lambda: Vec<f64>,
}

impl Iterate {
    /// Without constraints that are listed anew in each stage.
    pub fn zeros(nv: usize, multipliers: usize) -> Self {
        Self { v: vec![0.0; nv], lambda: vec![0.0; multipliers] }
    }

    /// `self = from + alpha · d`.
    pub fn set_step(&mut self, from: &Self, alpha: f64, d: &Self) {
        let step = |to: &mut [f64], from: &[f64], d: &[f64]| {
            to.iter_mut().zip(from).zip(d).for_each(|((to, from), d)| *to = from + alpha * d);
        };
        step(&mut self.v, &from.v, &d.v);
        self.lambda.resize(from.lambda.len(), 0.0);
        step(&mut self.lambda, &from.lambda, &d.lambda);
    }

    /// `self += d`.
    pub fn add(&mut self, d: &Self) {
        self.v.iter_mut().zip(&d.v).for_each(|(v, d)| *v += d);
        self.lambda.iter_mut().zip(&d.lambda).for_each(|(w, d)| *w += d);
    }
}

/// Which axial forces the geometric stiffness is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axial {
    /// Those of the iterate: the true derivative.
    Exact,
    /// Those that Newton's method carries along.
    Predicted,
    /// Of those what pulls, and of bending what resists: see [`Term::add_stable_jacobian`](crate::terms::Term::add_stable_jacobian).
    Stable,
}

/// Masses and inertias at θ, and weights of velocities for the solver's norms (√(Σ weight · v²/total) is a speed [m/s]).
#[derive(Clone, Debug, Default)]
pub(crate) struct Masses {
    /// Of every node \[kg\].
    pub nodes: Vec<f64>,
    /// Of every row of nodes and twists [kg, kg·m²].
    pub rows: Vec<f64>,
    /// Every body's inertia about its origin.
    pub bodies: Vec<Inertia<f64>>,
    /// Mass of everything \[kg\].
    pub total: f64,
    /// Weight of every row of nodes and twists: a node's mass; a twist counts as if an edge's length were its lever.
    pub weights: Vec<f64>,
}

impl Masses {
    pub fn new(model: &Model, theta: &[f64]) -> Self {
        let nodes = model.masses(theta);
        let lever2 = |edge: &RodEdge| {
            let [a, b] = edge.nodes.map(|node| nodes[node]);
            0.5 * (a + b) * (theta[edge.length] * edge.fraction).powi(2)
        };
        let twists = model.rods.edges.iter().map(lever2);
        let weights = nodes.iter().flat_map(|m| [*m; 3]).chain(twists).collect();
        let (rows, bodies, total) = (model.row_masses(theta), model.inertias(theta), model.total_mass(theta));
        Self { rows, bodies, total, weights, nodes }
    }
}

/// The problem of a stage, and how it is solved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stage<'a> {
    pub model: &'a Model,
    pub theta: &'a [f64],
    pub masses: &'a Masses,
    /// Friction and limits of joints that can act at these parameters, and couplings.
    pub joint_rows: &'a [JointRow],
    /// Controls of the step as motors receive them.
    pub u: &'a [f64],
    /// Springs of grippers that grasp.
    pub holds: &'a [Hold],
    /// History variables and coordinates at the beginning of the (sub)step.
    pub past: Past<'a>,
    /// Strains of rods there.
    pub rod_past: &'a RodPast,
    pub scheme: Scheme,
    pub h: f64,
    /// σ: inertia per velocity change [1/s].
    pub inertia: f64,
    pub q_ref: &'a [f64],
    /// z's part of rods at q_ref.
    pub frames: &'a [f64],
    pub v_ref: &'a [f64],
    /// Velocities of free rows to start from, if nothing better is known.
    pub v_start: &'a [f64],
    pub v_cmd: &'a [f64],
    pub options: SolverOptions,
}

impl Stage<'_> {
    /// The same problem, solved otherwise.
    pub fn with(&self, change: impl FnOnce(&mut SolverOptions)) -> Self {
        let mut other = *self;
        change(&mut other.options);
        other
    }

    /// History variables of rod sections.
    pub(super) fn remembered(&self) -> Remembered<'_> {
        Remembered { past: self.rod_past, z: self.past.z, elapsed: self.past.elapsed }
    }

    /// Whether there are cone variables that need a value to start from; couplings are linear in theirs.
    pub(crate) fn has_cones(&self) -> bool {
        !self.model.pairs.is_empty() || self.joint_rows.iter().any(|row| row.coupling().is_none())
    }

    /// Whether constraints are listed anew in each stage.
    pub(crate) fn lists_constraints(&self) -> bool {
        !(self.model.collider_pairs.is_empty() && self.model.closures.is_empty() && self.model.element_groups.is_empty())
    }

    /// Whether there may be constraints.
    pub(crate) fn has_contact(&self) -> bool {
        !self.model.pairs.is_empty() || !self.joint_rows.is_empty() || self.lists_constraints()
    }

    pub(super) fn place(&self, v: &[f64], ws: &mut Workspace) {
        let (all, h) = (self.model.prescribed_rows.len(), self.h);
        let at = |w: &Weights, before: f64, v: f64| (h * (w.a0 * before + w.a1 * v), w.b0 * before + w.b1 * v);
        // as if all were free: without a branch in the loop
        let free = self.scheme.free;
        let before = self.q_ref[..all].iter().zip(&self.v_ref[..all]).zip(&v[..all]);
        for (to, ((q, before), v)) in ws.q_bar[..all].iter_mut().zip(&mut ws.v_bar[..all]).zip(before) {
            let (way, v) = at(&free, *before, *v);
            (*to.0, *to.1) = (q + way, v);
        }
        if self.scheme.prescribed != free {
            for (k, _) in self.model.prescribed_rows.iter().enumerate().filter(|(_, prescribed)| **prescribed) {
                let (way, v) = at(&self.scheme.prescribed, self.v_ref[k], v[k]);
                (ws.q_bar[k], ws.v_bar[k]) = (self.q_ref[k] + way, v);
            }
        }
        self.model.rods.evaluate(self.q_ref, self.frames, &ws.q_bar, &mut ws.rods);
        self.place_bodies(v, ws);
    }

    fn inertia_minus_force(&self, v: &[f64], ws: &mut Workspace) {
        for (k, &prescribed) in self.model.prescribed_rows.iter().enumerate() {
            ws.r[k] = if prescribed {
                v[k] - self.v_cmd[k]
            } else {
                self.masses.rows[k] * self.inertia * (v[k] - self.v_ref[k]) - ws.f[k]
            };
        }
    }

    /// Residual at `it` into `ws.r` \[N\] and of the constraints into `ws.residuals`. With the constraints linearized before, `ws.r` is the
    /// condensed right-hand side for those matrices.
    pub(crate) fn residual(&self, it: &Iterate, ws: &mut Workspace) -> Result<(), StepError> {
        self.place(&it.v, ws);
        ws.f.fill(0.0);
        let at = Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta };
        for term in &self.model.terms {
            term.add_force(&at, &mut ws.f);
        }
        self.model.rods.add_force(&ws.rods, &ws.v_bar, self.theta, self.remembered(), &mut ws.f);
        self.holds.iter().for_each(|hold| hold.add_force(&at, &mut ws.f));
        self.evaluate_frames(&it.v, ws, false);
        self.constrain(it, ws, None)?;
        self.inertia_minus_force(&it.v, ws);
        self.body_residual(ws);
        self.subtract_joint_loads(ws);
        Ok(())
    }

    /// Evaluates all constraints at `it`, linearizing them where matrices are made: their residuals, and their forces where they act.
    fn constrain(&self, it: &Iterate, ws: &mut Workspace, linearize: Option<Axial>) -> Result<(), StepError> {
        ws.residuals.resize(it.lambda.len(), 0.0);
        let loaded = ws.constraints.has_links() || self.drags().next().is_some();
        ws.loads.clear(if loaded { self.model.tree.bodies().len() } else { 0 });
        for drag in self.drags() {
            ws.loads.bodies[drag.body] += drag.wrench(self.theta, &ws.bodies.frames.bodies[drag.body]);
        }
        let at_root = matches!(linearize, Some(Axial::Exact));
        let at = Evaluation { q: &ws.q_bar, v: &it.v, frames: &ws.bodies.frames, blocks: &ws.blocks, at_root };
        let (mut lambda, mut residuals) = (it.lambda.as_slice(), ws.residuals.as_mut_slice());
        let mut loads = Loads { nodes: &mut ws.f, bodies: &mut ws.loads.bodies, joints: &mut ws.loads.joints };
        let mut slopes = Slopes { dq: &mut ws.dq.nodes, dv: &mut ws.dv.nodes, joints: &mut ws.loads.slopes };
        for set in ws.constraints.sets_mut() {
            if lambda.is_empty() {
                break;
            }
            let dim = set.dim();
            let (own, others) = lambda.split_at(dim);
            let (out, rest) = std::mem::take(&mut residuals).split_at_mut(dim);
            match (dim, linearize) {
                (0, _) => {}
                (_, Some(_)) => set.linearize(self, &at, own, out, &mut loads, &mut slopes)?,
                (_, None) => set.residual(self, &at, own, out, &mut loads)?,
            }
            (lambda, residuals) = (others, rest);
        }
        Ok(())
    }

    /// Sets multipliers that push nothing.
    fn settle(&self, it: &mut Iterate, ws: &mut Workspace) -> Result<(), StepError> {
        let at = Evaluation { q: &ws.q_bar, v: &it.v, frames: &ws.bodies.frames, blocks: &ws.blocks, at_root: true };
        let mut result = Ok(());
        ws.constraints.for_parts(&mut it.lambda, |set, own| {
            if result.is_ok() {
                result = set.settle(self, &at, own);
            }
        });
        result
    }

    fn subtract_joint_loads(&self, ws: &mut Workspace) {
        ws.loads.joints.iter().for_each(|(row, force)| ws.r[*row] -= force);
    }

    /// Lists the constraints of this stage, and starts those that are new.
    pub(crate) fn find_constraints(&self, ws: &mut Workspace) {
        if self.lists_constraints() {
            self.list_constraints(ws);
        }
        let n = ws.it.v.len();
        let warm = ws.warm.as_ref().map(|warm| &warm.impulses);
        ws.constraints.for_parts(&mut ws.it.lambda, |set, own| set.start(self, warm, own));
        ws.weights.resize(n + ws.it.lambda.len(), 0.0);
        let (of_nodes, of_dofs) = ws.weights[..n].split_at_mut(self.masses.weights.len());
        of_nodes.copy_from_slice(&self.masses.weights);
        of_dofs.copy_from_slice(&self.model.weights.held);
        ws.constraints.for_parts(&mut ws.weights[n..], |set, own| set.weights(self, own));
    }

    /// Lists those that are listed anew in each stage.
    fn list_constraints(&self, ws: &mut Workspace) {
        self.frames_at_start(ws);
        if ws.constraints.bodies.find_near(self, &ws.bodies.frames) {
            self.frames_ahead(ws);
        }
        let mut at = Beginning { frames: &ws.bodies.frames, ahead: &ws.bodies.ahead, q_ahead: &ws.bodies.q_ahead, mobility: &[] };
        ws.constraints.sets_mut().into_iter().for_each(|set| set.find(self, &at));
        if ws.constraints.has_links() {
            let tree = &self.model.tree;
            ws.stiffening.clear();
            ws.stiffening.resize(tree.nv() * tree.nv(), 0.0);
            self.joint_stiffening(self.model.n_node_dofs(), &mut ws.stiffening);
            mobilities(tree, &ws.bodies.frames, &self.masses.bodies, &ws.stiffening, &mut ws.mobility);
            at.mobility = &ws.mobility;
            ws.constraints.sets_mut().into_iter().for_each(|set| set.scale(self, &at));
        }
        ws.blocks.list(self, &ws.constraints);
        ws.it.lambda.resize(ws.constraints.dim(), 0.0);
    }

    /// The change of all multipliers into `d.lambda` that goes with the change `d.v` of velocities, for the residuals at hand; the columns
    /// of the bodies' composites must be those of K.
    pub(crate) fn correct_multipliers(&self, ws: &Workspace, d: &mut Iterate) {
        let linked = ws.constraints.has_links();
        let bodies =
            if linked { ws.bodies.partials.carry(&self.model.tree, &d.v[self.model.n_node_dofs()..]) } else { Vec::new() };
        let change = Change { d: &d.v, bodies: &bodies, frames: &ws.bodies.frames };
        d.lambda.resize(ws.residuals.len(), 0.0);
        let mut residuals = ws.residuals.as_slice();
        ws.constraints.for_parts(&mut d.lambda, |set, own| {
            let (f, rest) = residuals.split_at(own.len());
            set.correct(self, &change, f, own);
            residuals = rest;
        });
    }

    /// Residual, Jacobians `ws.dq`, `ws.dv` (contacts condensed into them) and the matrix `ws.k` at `ws.it`, which is the root.
    pub(crate) fn linearize(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Exact, ws)
    }

    /// As [`Stage::linearize`], with the axial forces of `ws.axial.now` in the geometric stiffness.
    pub(crate) fn linearize_mixed(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Predicted, ws)
    }

    /// As [`Stage::linearize_mixed`], with what resists alone of the forces that may buckle.
    pub(crate) fn linearize_semidefinite(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Stable, ws)
    }

    fn linearize_with(&self, axial: Axial, ws: &mut Workspace) -> Result<(), StepError> {
        let mut it = std::mem::take(&mut ws.it);
        let result = self.linearize_at(&mut it, axial, ws);
        ws.it = it;
        result
    }

    /// Axial forces to start from: those at q_ref, where implicit Euler evaluated them last; in other schemes of terms that may buckle
    /// alone, for there they swing with every stage.
    pub(crate) fn start_axial(&self, ws: &mut Workspace) {
        ws.axial.now.fill(0.0);
        let (at, mut first) = (Point { q: self.q_ref, v: self.v_ref, theta: self.theta }, 0);
        for term in &self.model.terms {
            let n = term.n_axial();
            if n > 0 && (term.buckles() || self.model.integrator == Integrator::Euler) {
                ws.axial.dx.fill(0.0);
                term.predict_axial(&at, &ws.axial.dx, &mut ws.axial.now[first..first + n]);
            }
            first += n;
        }
    }

    /// Takes the axial forces over to where the step `alpha · d` leads from the velocities `v`: part `alpha` of the way from what they
    /// are to their first-order prediction at the whole step.
    pub(crate) fn predict_axial(&self, alpha: f64, v: &[f64], d: &[f64], ws: &mut Workspace) {
        if ws.axial.now.is_empty() {
            return;
        }
        // where `v` leads: the residual has moved on
        for (k, &prescribed) in self.model.prescribed_rows.iter().enumerate() {
            let w = if prescribed { &self.scheme.prescribed } else { &self.scheme.free };
            ws.axial.q[k] = self.q_ref[k] + self.h * (w.a0 * self.v_ref[k] + w.a1 * v[k]);
            ws.axial.dx[k] = self.h * self.scheme.free.a1 * d[k];
        }
        let at = Point { q: &ws.axial.q, v: &ws.v_bar, theta: self.theta };
        ws.axial.next.fill(0.0);
        let mut first = 0;
        for term in &self.model.terms {
            let n = term.n_axial();
            term.predict_axial(&at, &ws.axial.dx, &mut ws.axial.next[first..first + n]);
            first += n;
        }
        for (axial, next) in ws.axial.now.iter_mut().zip(&ws.axial.next) {
            *axial += alpha * (next - *axial);
        }
    }

    fn linearize_at(&self, it: &mut Iterate, axial: Axial, ws: &mut Workspace) -> Result<(), StepError> {
        self.place(&it.v, ws);
        ws.f.fill(0.0);
        ws.dq.nodes.clear();
        ws.dv.nodes.clear();
        let at = Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta };
        let mut first = 0;
        for term in &self.model.terms {
            let n = term.n_axial();
            match axial {
                Axial::Exact => term.add_jacobian(&at, &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes),
                Axial::Predicted => {
                    term.add_mixed_jacobian(&at, &ws.axial.now[first..first + n], &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes)
                }
                Axial::Stable => {
                    term.add_stable_jacobian(&at, &ws.axial.now[first..first + n], &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes)
                }
            }
            first += n;
        }
        let (rods, before) = (&self.model.rods, self.remembered());
        let whole = !self.options.descent;
        rods.add_jacobian(&ws.rods, &ws.v_bar, self.theta, before, whole, &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes);
        for hold in self.holds {
            hold.add_force(&at, &mut ws.f);
            hold.visit_jacobian(|row, column, value| ws.dq.nodes.add(row, column, value));
        }
        if self.has_contact() {
            let largest = |of: &System| -of.nodes.least_diagonal(3 * self.masses.nodes.len());
            (ws.stiffness, ws.viscosity) = (largest(&ws.dq), largest(&ws.dv));
        }
        ws.blocks.store(&ws.dq.nodes, &ws.dv.nodes);
        self.evaluate_frames(&it.v, ws, true);
        if axial == Axial::Exact {
            self.settle(it, ws)?;
        }
        self.constrain(it, ws, Some(axial))?;
        self.inertia_minus_force(&it.v, ws);
        for (row, _) in self.model.prescribed_rows.iter().enumerate().filter(|(_, d)| **d) {
            ws.dq.nodes.clear_row(row);
            ws.dv.nodes.clear_row(row);
        }
        self.assemble(ws);
        self.linearize_bodies(ws);
        self.subtract_joint_loads(ws);
        ws.loads.unconstrained.clone_from(&ws.k.bodies);
        ws.loads.slopes.iter().for_each(|(row, column, slope)| ws.k.bodies.add(*row, *column, *slope));
        Ok(())
    }

    /// K = σ M − h a1 ∂f/∂q̄ − b1 ∂f/∂v̄, identity in prescribed rows.
    fn assemble(&self, ws: &mut Workspace) {
        let uniform = self.scheme.free.a1 == self.scheme.prescribed.a1 && self.scheme.free.b1 == self.scheme.prescribed.b1;
        let (cq, cv) = (self.h * self.scheme.free.a1, self.scheme.free.b1);
        ws.k.nodes.set_sum(cq, &ws.dq.nodes, cv, &ws.dv.nodes);
        if !uniform {
            self.rescale_prescribed_columns(ws);
        }
        for (k, &prescribed) in self.model.prescribed_rows.iter().enumerate() {
            ws.k.nodes.add(k, k, if prescribed { 1.0 } else { self.masses.rows[k] * (self.inertia + self.options.damping) });
        }
        self.carry_axes(ws);
    }

    /// Adds the effect of an edge's nodes on its axes on their way to q̄, times the slopes of the forces by these.
    fn carry_axes(&self, ws: &mut Workspace) {
        let rods = &self.model.rods;
        if rods.edges.is_empty() || self.options.descent {
            return;
        }
        ws.carry.evaluate(rods, self.q_ref, &ws.q_bar);
        // on their own where contacts have stiffened a block: in the sum would be left what they leave
        ws.blocks.take_out(&mut ws.k.nodes);
        let (k, dq) = (&mut ws.k.nodes, &ws.dq.nodes);
        let places = rods.carried_places(dq);
        ws.carry.visit_after(|edge, nodes, psi| {
            let of_node =
                |node: usize| self.h * if self.model.prescribed[node] { self.scheme.prescribed.a1 } else { self.scheme.free.a1 };
            let psi = [psi * of_node(nodes[0]), psi * -of_node(nodes[1])];
            k.add_carried(dq, &places[edge], psi.map(Into::into));
        });
        ws.blocks.put_back(&mut ws.k.nodes);
    }

    fn rescale_prescribed_columns(&self, ws: &mut Workspace) {
        let (cq, cv) = (self.h * self.scheme.prescribed.a1, self.scheme.prescribed.b1);
        for (column, _) in self.model.prescribed_rows.iter().enumerate().filter(|(_, d)| **d) {
            ws.k.nodes.set_sum_in_column(column, cq, &ws.dq.nodes, cv, &ws.dv.nodes);
        }
    }

    /// ∂f/∂q̄, ∂f/∂v̄ (empty unless it [matters](Scheme::looks_back)) and A after [`Stage::linearize`], constraints at fixed multipliers.
    pub(crate) fn at_fixed_impulses(&self, ws: &mut Workspace) -> (System, System, System) {
        let (mut dq, mut a) = (ws.dq.clone(), ws.k.clone());
        let mut dv = if self.scheme.looks_back() { ws.dv.clone() } else { System::empty() };
        ws.blocks.fix(self, &ws.constraints, [&mut dq.nodes, &mut dv.nodes, &mut a.nodes]);
        if ws.constraints.has_links() {
            self.change_by_velocities(false, ws, &mut a);
        } else {
            a.bodies.clone_from(&ws.loads.unconstrained);
        }
        ws.constraints.parts(&ws.it.lambda).for_each(|(set, own)| set.add_fixed(self, own, &mut dq, &mut a));
        (dq, dv, a)
    }
}
