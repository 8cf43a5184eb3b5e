//! One nonlinear system: residual and matrix of a stage.
//!
//! ```text
//! free rows:    r = m (v⁺ − v) σ − Σ f(q̄, v̄; θ) − p/h      [N]     (σ = 1/h; at rest a pseudo-time weight)
//! driven rows:  r = v⁺ − v_cmd                              [m/s]
//! K = ∂r/∂v⁺ = σ M − h ∂f/∂q̄ a1 − ∂f/∂v̄ b1
//! ```
//! with the impulses p of contact condensed as described in `contact`.

use super::{Scheme, StepError, Weights, Workspace};
use crate::bodies::spatial::Inertia;
use crate::contact::{JointRow, LawPoint, Touch};
use crate::geometry::solid::Carrier;
use crate::grasp::Hold;
use crate::kkt::System;
use crate::memory::Past;
use crate::model::Model;
use crate::rods::{Remembered, RodEdge, RodPast};
use crate::scene::Integrator;
use crate::terms::{Point, Vec3};
use nalgebra::Vector4;
use pliant_smoothing::ContactLaw;

/// What messages call bending and twisting of rods.
const ROD: &str = "rod (bending and twist)";
/// And grippers that grasp.
const GRASP: &str = "grasp";
/// Safe fraction of the node's mass as the step ρ of the natural residual (design: never above the mass itself).
const RHO: f64 = 0.3;

/// The unknowns of a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct Iterate {
    /// Velocities v⁺ of all nodes [m/s].
    pub v: Vec<f64>,
    /// Cone variable of each contact [N·s].
    pub w: Vec<Vector4<f64>>,
    /// Impulse of each joint friction and stop [N·m·s, N·s].
    pub s: Vec<f64>,
    /// Cone variable of each contact of solids [N·s].
    pub p: Vec<Vector4<f64>>,
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

/// What the solver knows from θ alone: which rows there are, and weights of velocities for its norms (√(Σ weight · v²/total) is a
/// speed [m/s]).
#[derive(Clone, Debug, Default)]
pub(crate) struct Measure {
    /// Mass of everything [kg].
    pub total: f64,
    /// Weight of every row of nodes and twists: a node's mass; a twist counts as if an edge's length were its lever.
    pub nodes: Vec<f64>,
    /// Friction and stops that can act at these parameters, and couplings.
    pub rows: Vec<JointRow>,
}

impl Measure {
    pub fn new(model: &Model, theta: &[f64]) -> Self {
        let masses = model.masses(theta);
        let lever2 = |edge: &RodEdge| {
            let [a, b] = edge.nodes.map(|node| masses[node]);
            0.5 * (a + b) * (theta[edge.length] * edge.fraction).powi(2)
        };
        let twists = model.rods.edges.iter().map(lever2);
        let nodes = masses.iter().flat_map(|m| [*m; 3]).chain(twists).collect();
        Self { total: model.total_mass(theta), nodes, rows: model.active_rows(theta) }
    }
}

/// The data of a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stage<'a> {
    pub model: &'a Model,
    pub theta: &'a [f64],
    /// Of every node [kg].
    pub mass: &'a [f64],
    /// Of every row of nodes and twists [kg, kg·m²].
    pub row_mass: &'a [f64],
    /// Every body's inertia about its origin.
    pub inertias: &'a [Inertia<f64>],
    /// What the solver compares velocities with: see [`Measure`].
    pub measure: &'a Measure,
    /// What motors see of the controls of the step.
    pub u: &'a [f64],
    /// What grippers that grasp pull.
    pub holds: &'a [Hold],
    /// The beginning of the (sub)step.
    pub past: Past<'a>,
    /// The same of rods' strains.
    pub rod_past: &'a RodPast,
    pub scheme: Scheme,
    pub h: f64,
    /// σ: inertia per velocity change [1/s].
    pub inertia: f64,
    pub q_ref: &'a [f64],
    /// z's part of rods at q_ref.
    pub frames: &'a [f64],
    pub v_ref: &'a [f64],
    /// Where velocities of free rows start from, if nothing better is known.
    pub v_start: &'a [f64],
    pub v_cmd: &'a [f64],
    /// Rest gap δ of the smoothing, κ = δ m g [m].
    pub rest_gap: f64,
    /// Levenberg weight added to σ in the matrix only [1/s].
    pub damping: f64,
    /// The same for the contacts of solids [-]; see [`pliant_smoothing::SplitPoint`].
    pub soften: f64,
    /// Whether contacts of solids push nothing, beside the impulses of the iterate.
    pub absent: bool,
    /// Whether everything is tried; otherwise the step can be halved.
    pub thorough: bool,
    /// Whether the root is only passed through.
    pub coarse: bool,
    /// Whether matrices are made of what resists alone, whose steps lead downhill from wherever they start.
    pub downhill: bool,
}

/// The acceleration [m/s²] by which the sharpness of a node's contact is told from its mass, and its derivative by gravity. Without gravity,
/// where nothing rests, that of solids' contacts: a law without any smoothing has no derivative.
pub(super) fn weighed(gravity: f64) -> (f64, f64) {
    if gravity > 0.0 { (gravity, 1.0) } else { (WEIGHTLESS, 0.0) }
}

const WEIGHTLESS: f64 = 10.0;

impl Stage<'_> {
    /// The law's numbers at contact `c`.
    pub(crate) fn law_point(&self, c: usize) -> LawPoint {
        let pair = &self.model.pairs[c];
        let mass = self.mass[pair.node];
        LawPoint {
            law: match self.model.contact.law {
                crate::scene::Law::Coulomb => ContactLaw::Coulomb,
                crate::scene::Law::Anitescu => ContactLaw::Anitescu,
            },
            mu: self.theta[pair.friction],
            kappa: self.rest_gap * mass * weighed(self.theta[self.model.gravity]).0,
            rho: RHO * mass,
        }
    }

    /// What rods' sections remember.
    fn remembered(&self) -> Remembered<'_> {
        Remembered { past: self.rod_past, z: self.past.z, elapsed: self.past.elapsed }
    }

    /// Whether there are cone variables that need a value to start from; couplings are linear in theirs.
    pub(crate) fn has_cones(&self) -> bool {
        !self.model.pairs.is_empty() || self.measure.rows.iter().any(|row| row.coupling().is_none())
    }

    pub(crate) fn has_contact(&self) -> bool {
        !(self.model.pairs.is_empty()
            && self.measure.rows.is_empty()
            && self.model.solid_pairs.is_empty()
            && self.model.ties.is_empty()
            && self.model.facet_groups.is_empty())
    }

    pub(super) fn place(&self, v: &[f64], ws: &mut Workspace) {
        let (all, h) = (self.model.driven_rows.len(), self.h);
        let at = |w: &Weights, before: f64, v: f64| (h * (w.a0 * before + w.a1 * v), w.b0 * before + w.b1 * v);
        // as if all were free: without a branch in the loop
        let free = self.scheme.free;
        let before = self.q_ref[..all].iter().zip(&self.v_ref[..all]).zip(&v[..all]);
        for (to, ((q, before), v)) in ws.q_bar[..all].iter_mut().zip(&mut ws.v_bar[..all]).zip(before) {
            let (way, v) = at(&free, *before, *v);
            (*to.0, *to.1) = (q + way, v);
        }
        if self.scheme.driven != free {
            for (k, _) in self.model.driven_rows.iter().enumerate().filter(|(_, driven)| **driven) {
                let (way, v) = at(&self.scheme.driven, self.v_ref[k], v[k]);
                (ws.q_bar[k], ws.v_bar[k]) = (self.q_ref[k] + way, v);
            }
        }
        self.model.rods.evaluate(self.q_ref, self.frames, &ws.q_bar, &mut ws.rods);
        self.place_bodies(v, ws);
    }

    /// Contact `c` at q⁺, which is q̄ for the schemes that allow contact.
    fn touch(&self, c: usize, q: &[f64], v: &[f64]) -> Result<(Touch, Vec3<f64>), StepError> {
        let pair = &self.model.pairs[c];
        let at = |x: &[f64]| Vec3::new(x[3 * pair.node], x[3 * pair.node + 1], x[3 * pair.node + 2]);
        let v = at(v);
        let touch = Touch::new(&self.model.shapes[pair.shape], at(q), v, self.h, self.theta[pair.radius], self.theta);
        let touch = touch.map_err(|source| StepError::Geometry {
            step: 0,
            node: pair.node,
            shape: self.model.shape_names[pair.shape].clone(),
            source,
        })?;
        Ok((touch, v))
    }

    fn inertia_minus_force(&self, v: &[f64], ws: &mut Workspace) {
        for (k, &driven) in self.model.driven_rows.iter().enumerate() {
            ws.r[k] =
                if driven { v[k] - self.v_cmd[k] } else { self.row_mass[k] * self.inertia * (v[k] - self.v_ref[k]) - ws.f[k] };
        }
    }

    /// Residual at `it` into `ws.r` [N] and of the contacts into `ws.cone` [N·s]. With `ws.contacts` linearized before,
    /// `ws.r` is the condensed right-hand side for those matrices.
    pub(crate) fn residual(&self, it: &Iterate, ws: &mut Workspace) -> Result<(), StepError> {
        self.place(&it.v, ws);
        ws.f.fill(0.0);
        let at = Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta };
        for term in &self.model.terms {
            term.add_force(&at, &mut ws.f);
        }
        self.model.rods.add_force(&ws.rods, &ws.v_bar, self.theta, self.remembered(), &mut ws.f);
        self.holds.iter().for_each(|hold| hold.add_force(&at, &mut ws.f));
        for c in 0..self.model.pairs.len() {
            let (touch, _) = self.touch(c, &ws.q_bar, &it.v)?;
            let at = self.law_point(c);
            let cone = pliant_smoothing::residual(at.law, at.mu, at.kappa, at.rho, touch.v_n, touch.v_t.into(), it.w[c].into());
            ws.cone[c] = Vector4::from(cone);
            let impulse = crate::contact::impulse(touch.normal, at.mu, &it.w[c]);
            self.add_contact_force(c, impulse, ws);
        }
        self.evaluate_frames(&it.v, ws, false);
        self.add_spots(&it.p, &it.v, ws)?;
        self.inertia_minus_force(&it.v, ws);
        self.body_residual(ws);
        self.add_rows(&it.s, &it.v, ws);
        Ok(())
    }

    /// The condensed force of contact `c`: `(p − gain F)/h`.
    fn add_contact_force(&self, c: usize, impulse: Vec3<f64>, ws: &mut Workspace) {
        let node = self.model.pairs[c].node;
        let force = (impulse - ws.contacts[c].gain * ws.cone[c]) / self.h;
        for a in 0..3 {
            ws.f[3 * node + a] += force[a];
        }
    }

    /// Residual, Jacobians `ws.dq`, `ws.dv` (contacts condensed into them) and the matrix `ws.k` at `ws.it`.
    pub(crate) fn linearize(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Exact, ws)
    }

    /// As [`Stage::linearize`], with the axial forces of `ws.axial` in the geometric stiffness.
    pub(crate) fn linearize_mixed(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Predicted, ws)
    }

    /// As [`Stage::linearize_mixed`], with what resists alone of the forces that may buckle.
    pub(crate) fn linearize_stable(&self, ws: &mut Workspace) -> Result<(), StepError> {
        self.linearize_with(Axial::Stable, ws)
    }

    fn linearize_with(&self, axial: Axial, ws: &mut Workspace) -> Result<(), StepError> {
        let it = std::mem::take(&mut ws.it);
        let result = self.linearize_at(&it, axial, ws);
        ws.it = it;
        result
    }

    /// Axial forces to start from: those at q_ref, where implicit Euler evaluated them last; in other schemes of terms that may buckle
    /// alone, for there they swing with every stage.
    pub(crate) fn start_axial(&self, ws: &mut Workspace) {
        ws.axial.fill(0.0);
        let (at, mut first) = (Point { q: self.q_ref, v: self.v_ref, theta: self.theta }, 0);
        for term in &self.model.terms {
            let n = term.n_axial();
            if n > 0 && (term.buckles() || self.model.integrator == Integrator::Euler) {
                ws.dx.fill(0.0);
                term.predict_axial(&at, &ws.dx, &mut ws.axial[first..first + n]);
            }
            first += n;
        }
    }

    /// Takes the axial forces over to where the step `alpha · d` leads from the velocities `v`: part `alpha` of the way from what they
    /// are to their first-order prediction at the whole step.
    pub(crate) fn predict_axial(&self, alpha: f64, v: &[f64], d: &[f64], ws: &mut Workspace) {
        if ws.axial.is_empty() {
            return;
        }
        // where `v` leads: the residual has moved on
        for (k, &driven) in self.model.driven_rows.iter().enumerate() {
            let w = if driven { &self.scheme.driven } else { &self.scheme.free };
            ws.q_axial[k] = self.q_ref[k] + self.h * (w.a0 * self.v_ref[k] + w.a1 * v[k]);
            ws.dx[k] = self.h * self.scheme.free.a1 * d[k];
        }
        let at = Point { q: &ws.q_axial, v: &ws.v_bar, theta: self.theta };
        ws.axial_next.fill(0.0);
        let mut first = 0;
        for term in &self.model.terms {
            let n = term.n_axial();
            term.predict_axial(&at, &ws.dx, &mut ws.axial_next[first..first + n]);
            first += n;
        }
        for (axial, next) in ws.axial.iter_mut().zip(&ws.axial_next) {
            *axial += alpha * (next - *axial);
        }
    }

    fn linearize_at(&self, it: &Iterate, axial: Axial, ws: &mut Workspace) -> Result<(), StepError> {
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
                    term.add_mixed_jacobian(&at, &ws.axial[first..first + n], &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes)
                }
                Axial::Stable => {
                    term.add_stable_jacobian(&at, &ws.axial[first..first + n], &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes)
                }
            }
            first += n;
        }
        let (rods, before) = (&self.model.rods, self.remembered());
        let whole = !self.downhill;
        rods.add_jacobian(&ws.rods, &ws.v_bar, self.theta, before, whole, &mut ws.f, &mut ws.dq.nodes, &mut ws.dv.nodes);
        for hold in self.holds {
            hold.add_force(&at, &mut ws.f);
            hold.visit_jacobian(|row, column, value| ws.dq.nodes.add(row, column, value));
        }
        if self.has_contact() {
            let largest = |of: &System| -of.nodes.least_diagonal(3 * self.mass.len());
            (ws.stiffness, ws.viscosity) = (largest(&ws.dq), largest(&ws.dv));
        }
        for (node, blocks) in &mut ws.touching {
            *blocks = [ws.dq.nodes.block(*node, *node), ws.dv.nodes.block(*node, *node), [[0.0; 3]; 3]];
        }
        for ([i, j], blocks) in &mut ws.between {
            *blocks = [ws.dq.nodes.block(*i, *j), ws.dv.nodes.block(*i, *j), [[0.0; 3]; 3]];
        }
        for c in 0..self.model.pairs.len() {
            self.linearize_contact(c, it, ws)?;
        }
        self.evaluate_frames(&it.v, ws, true);
        self.linearize_spots(&it.p, &it.v, ws)?;
        self.inertia_minus_force(&it.v, ws);
        for (row, _) in self.model.driven_rows.iter().enumerate().filter(|(_, d)| **d) {
            ws.dq.nodes.clear_row(row);
            ws.dv.nodes.clear_row(row);
        }
        self.assemble(ws);
        self.linearize_bodies(ws);
        self.linearize_rows(&it.s, &it.v, ws);
        Ok(())
    }

    fn linearize_contact(&self, c: usize, it: &Iterate, ws: &mut Workspace) -> Result<(), StepError> {
        let (touch, v) = self.touch(c, &ws.q_bar, &it.v)?;
        let (law, node) = (self.law_point(c), self.model.pairs[c].node);
        if !ws.contacts[c].linearize(law, &touch, v, self.h, &it.w[c]) {
            return Err(StepError::NotFinite {
                step: 0,
                term: self.model.shape_names[self.model.pairs[c].shape].clone(),
                place: self.model.row_name(3 * node),
                value: it.w[c].norm(),
            });
        }
        let condensed = &ws.contacts[c];
        let rows = |m: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]]);
        ws.dq.nodes.add_block(node, node, 1.0 / self.h, &rows(&condensed.dp_dq));
        ws.dv.nodes.add_block(node, node, 1.0 / self.h, &rows(&condensed.dp_dv));
        let impulse = condensed.impulse;
        ws.cone[c] = condensed.residual;
        self.add_contact_force(c, impulse, ws);
        Ok(())
    }

    /// K = σ M − h a1 ∂f/∂q̄ − b1 ∂f/∂v̄, identity in driven rows.
    fn assemble(&self, ws: &mut Workspace) {
        let uniform = self.scheme.free.a1 == self.scheme.driven.a1 && self.scheme.free.b1 == self.scheme.driven.b1;
        let (cq, cv) = (self.h * self.scheme.free.a1, self.scheme.free.b1);
        ws.k.nodes.set_sum(cq, &ws.dq.nodes, cv, &ws.dv.nodes);
        if !uniform {
            self.rescale_driven_columns(ws);
        }
        for (k, &driven) in self.model.driven_rows.iter().enumerate() {
            ws.k.nodes.add(k, k, if driven { 1.0 } else { self.row_mass[k] * (self.inertia + self.damping) });
        }
        self.carry_axes(ws);
    }

    /// What moving an edge's nodes does to its axes on their way to q̄, times what these do to the forces.
    fn carry_axes(&self, ws: &mut Workspace) {
        let rods = &self.model.rods;
        if rods.edges.is_empty() || self.downhill {
            return;
        }
        ws.carry.evaluate(rods, self.q_ref, &ws.q_bar);
        // on their own where contacts have stiffened a block: in the sum would be left what they leave
        let touching = ws.touching.iter_mut().map(|(node, blocks)| ([*node; 2], blocks));
        for ([i, j], [.., whole]) in touching.chain(ws.between.iter_mut().map(|(nodes, blocks)| (*nodes, blocks))) {
            *whole = ws.k.nodes.block(i, j);
            ws.k.nodes.set_block(i, j, &[[0.0; 3]; 3]);
        }
        let (k, dq) = (&mut ws.k.nodes, &ws.dq.nodes);
        let places = rods.carried_places(dq);
        ws.carry.visit_after(|edge, nodes, psi| {
            let of_node =
                |node: usize| self.h * if self.model.driven[node] { self.scheme.driven.a1 } else { self.scheme.free.a1 };
            let psi = [psi * of_node(nodes[0]), psi * -of_node(nodes[1])];
            k.add_carried(dq, &places[edge], psi.map(Into::into));
        });
        let touching = ws.touching.iter_mut().map(|(node, blocks)| ([*node; 2], blocks));
        for ([i, j], [.., carried]) in touching.chain(ws.between.iter_mut().map(|(nodes, blocks)| (*nodes, blocks))) {
            let whole = std::mem::replace(carried, ws.k.nodes.block(i, j));
            ws.k.nodes.add_block(i, j, 1.0, &whole);
        }
    }

    fn rescale_driven_columns(&self, ws: &mut Workspace) {
        let (cq, cv) = (self.h * self.scheme.driven.a1, self.scheme.driven.b1);
        for (column, _) in self.model.driven_rows.iter().enumerate().filter(|(_, d)| **d) {
            ws.k.nodes.set_sum_in_column(column, cq, &ws.dq.nodes, cv, &ws.dv.nodes);
        }
    }

    /// ∂f/∂q̄, ∂f/∂v̄ (empty unless it [matters](Scheme::looks_back)) and A after [`Stage::linearize`], contacts at fixed cone variables.
    pub(crate) fn at_fixed_impulses(&self, ws: &mut Workspace) -> (System, System, System) {
        let (mut dq, mut a) = (ws.dq.clone(), ws.k.clone());
        let mut dv = if self.scheme.looks_back() { ws.dv.clone() } else { System::empty() };
        let (cq, cv) = (self.h * self.scheme.free.a1, self.scheme.free.b1);
        for (node, [block_q, block_v, carried]) in &ws.touching {
            let mut block_q = *block_q;
            for (pair, contact) in self.model.pairs.iter().zip(&ws.contacts).filter(|(pair, _)| pair.node == *node) {
                debug_assert!(!self.model.driven[pair.node]);
                for (r, row) in block_q.iter_mut().enumerate() {
                    row.iter_mut().enumerate().for_each(|(c, x)| *x += contact.dp_dq_fixed[(r, c)] / self.h);
                }
            }
            for (spot, linear) in ws.spots.spots.iter().zip(&ws.spots.linear) {
                for side in (0..2).filter(|s| spot.carriers[*s] == Carrier::Node(*node)) {
                    let (scale, m) = (if side == 0 { 1.0 / self.h } else { -1.0 / self.h }, linear.w_xi[side]);
                    for (r, row) in block_q.iter_mut().enumerate() {
                        row.iter_mut().enumerate().for_each(|(c, x)| *x += scale * m[(3 + r, 3 + c)]);
                    }
                }
            }
            let inertia = self.mass[*node] * (self.inertia + self.damping);
            let block = std::array::from_fn(|r| {
                std::array::from_fn(|c| {
                    let own = if r == c { inertia } else { 0.0 };
                    own - (cq * block_q[r][c] + cv * block_v[r][c]) + carried[r][c]
                })
            });
            dq.nodes.set_block(*node, *node, &block_q);
            if dv.dim() > 0 {
                dv.nodes.set_block(*node, *node, block_v);
            }
            a.nodes.set_block(*node, *node, &block);
        }
        for ([i, j], [block_q, block_v, carried]) in &ws.between {
            let block =
                std::array::from_fn(|r| std::array::from_fn(|c| carried[r][c] - (cq * block_q[r][c] + cv * block_v[r][c])));
            dq.nodes.set_block(*i, *j, block_q);
            if dv.dim() > 0 {
                dv.nodes.set_block(*i, *j, block_v);
            }
            a.nodes.set_block(*i, *j, &block);
        }
        self.facets_at_fixed_impulses(ws, &mut dq, &mut a);
        self.rows_at_fixed_impulses(ws, &mut dq, &mut a);
        (dq, dv, a)
    }

    /// The term with the largest force in a row, and the first non-finite force with its row, if any: for error messages.
    pub(crate) fn blame(&self, it: &Iterate, row: usize, ws: &mut Workspace) -> (String, Option<(String, usize, f64)>) {
        self.place(&it.v, ws);
        if row >= self.model.n_node_dofs() {
            return self.blame_joint(row - self.model.n_node_dofs(), ws);
        }
        let mut largest = ("inertia".to_owned(), 0.0);
        for term in &self.model.terms {
            ws.f.fill(0.0);
            term.add_force(&Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta }, &mut ws.f);
            if let Some(k) = ws.f.iter().position(|f| !f.is_finite()) {
                return (term.name().to_owned(), Some((term.name().to_owned(), k, ws.f[k])));
            }
            if ws.f[row].abs() > largest.1 {
                largest = (term.name().to_owned(), ws.f[row].abs());
            }
        }
        ws.f.fill(0.0);
        self.model.rods.add_force(&ws.rods, &ws.v_bar, self.theta, self.remembered(), &mut ws.f);
        if let Some(k) = ws.f.iter().position(|f| !f.is_finite()) {
            return (ROD.to_owned(), Some((ROD.to_owned(), k, ws.f[k])));
        }
        if ws.f[row].abs() > largest.1 {
            largest = (ROD.to_owned(), ws.f[row].abs());
        }
        ws.f.fill(0.0);
        let at = Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta };
        self.holds.iter().for_each(|hold| hold.add_force(&at, &mut ws.f));
        if ws.f[row].abs() > largest.1 {
            largest = (GRASP.to_owned(), ws.f[row].abs());
        }
        (largest.0, None)
    }
}
