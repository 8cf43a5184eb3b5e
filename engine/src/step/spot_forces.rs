//! Wrenches of the contacts of solids and of ties, and what they add to the matrix of a stage.
//!
//! A spot's wrench W(w)/h acts on the first solid and the opposite on the second. Newton eliminates w, which leaves wrenches that depend
//! on the displacements and velocities of both sides; what depends on the own side goes with the composites of
//! [`crate::bodies::dynamics`], what depends on the other side and on nodes is added here.

use super::{Stage, StepError, Workspace};
use crate::bodies::dynamics::{Displacement, WrenchPartial, moved_along};
use crate::bodies::spatial::{Force, column};
use crate::contact::{Sliding, SpotKey, SpotLinear, SpotState, meeting_changes, node_of, spot_wrench};
use crate::geometry::solid::{Carrier, Meeting, Spot, meet};
use crate::kkt::System;
use nalgebra::{Matrix6, Vector4, Vector6};

impl Stage<'_> {
    pub(super) fn meeting(
        &self,
        features: &Spot,
        spot: &SpotState,
        q: &[f64],
        ws: &Workspace,
    ) -> Result<Meeting<f64>, StepError> {
        let [a, b] = spot.solids.map(|s| {
            let solid = &self.model.solids[s];
            solid.posed(&self.pose(solid.carrier, q, ws), |k| self.theta[k])
        });
        meet(features, &a, &b).map_err(|distance| self.no_normal(spot, distance))
    }

    fn no_normal(&self, spot: &SpotState, distance: f64) -> StepError {
        let [first, second] = spot.solids.map(|s| self.model.solids[s].name.clone());
        StepError::NoNormal { step: 0, first, second, distance }
    }

    pub(super) fn sliding(&self, spot: &SpotState, meeting: &Meeting<f64>, v: &[f64], ws: &Workspace) -> Sliding {
        let [a, b] = spot.carriers.map(|c| self.velocity(c, v, ws));
        Sliding::new(meeting, a - b)
    }

    /// Adds forces to `ws.f` (nodes) and `ws.spots.wrenches` (bodies), with the frames at the iterate in place and for the matrices
    /// linearized before.
    pub(super) fn add_spots(&self, p: &[Vector4<f64>], v: &[f64], ws: &mut Workspace) -> Result<(), StepError> {
        self.clear_wrenches(ws);
        for (k, p) in p.iter().enumerate() {
            let spot = ws.spots.spots[k];
            if let Some(at) = spot.key.facet() {
                self.add_facet(k, at, p, v, ws)?;
                continue;
            }
            let inverse = ws.spots.linear[k].inverse;
            let (f, wrench) = match spot.key {
                SpotKey::Contact { pair, spot: features, .. } => {
                    let meeting = self.meeting(&features, &spot, &ws.q_bar, ws)?;
                    let sliding = self.sliding(&spot, &meeting, v, ws);
                    let law = self.spot_law(pair, &spot);
                    let f = law.residual(meeting.gap / self.h, &sliding.v_t, p);
                    (f, spot_wrench(&meeting, law.at.mu, &(p - inverse * f)))
                }
                SpotKey::Tie { tie, turn } => {
                    let rows = self.tie_rows(tie, turn, &spot, &ws.q_bar, ws);
                    let f = rows.residual(&self.tie_law(tie, &spot), self.h, p);
                    (f, rows.wrench(&(p - inverse * f)))
                }
                SpotKey::Facet { .. } => continue,
            };
            ws.spots.f[k] = f;
            self.push(&spot, wrench, ws);
        }
        Ok(())
    }

    fn clear_wrenches(&self, ws: &mut Workspace) {
        ws.spots.wrenches.clear();
        if !ws.spots.spots.is_empty() {
            ws.spots.wrenches.resize(self.model.tree.bodies().len(), Force::zero());
        }
    }

    /// The impulse `wrench` on the first solid of a spot, and its opposite on the second, as forces.
    fn push(&self, spot: &SpotState, wrench: Force<f64>, ws: &mut Workspace) {
        for (side, sign) in [(0, 1.0 / self.h), (1, -1.0 / self.h)] {
            match spot.carriers[side] {
                Carrier::World => {}
                Carrier::Body(body) => ws.spots.wrenches[body] += wrench * sign,
                Carrier::Node(node) => (0..3).for_each(|a| ws.f[3 * node + a] += sign * wrench.f[a]),
            }
        }
    }

    /// As [`Stage::add_spots`], linearizing each: into `ws.spots.linear`, and the nodes' blocks of `ws.dq`, `ws.dv`.
    pub(super) fn linearize_spots(&self, p: &[Vector4<f64>], v: &[f64], ws: &mut Workspace) -> Result<(), StepError> {
        self.clear_wrenches(ws);
        ws.spots.linear.clear();
        ws.spots.facets.clear();
        for (k, p) in p.iter().enumerate() {
            let spot = ws.spots.spots[k];
            if let Some(at) = spot.key.facet() {
                let (linear, rounding) = self.linearize_facet(k, at, p, v, ws)?;
                ws.spots.f[k] = linear.f;
                ws.spots.rounding[k] = rounding;
                ws.spots.linear.push(linear);
                continue;
            }
            let (linear, wrench, rounding) = match spot.key {
                SpotKey::Contact { pair, spot: features, .. } => {
                    self.linearize_contact_of_solids(pair, &features, &spot, p, v, ws)?
                }
                SpotKey::Tie { tie, turn } => {
                    let rows = self.tie_rows(tie, turn, &spot, &ws.q_bar, ws);
                    let law = self.tie_law(tie, &spot);
                    let linear = rows.linearize(&law, self.h, p);
                    let size = rows.point.map_or(1.0, |x| x.norm()) / self.h;
                    let rounding = 4.0 * f64::EPSILON * law.rho * size * linear.inverse[(1, 1)];
                    let wrench = rows.wrench(&(p - linear.inverse * linear.f));
                    (linear, wrench, rounding)
                }
                SpotKey::Facet { .. } => continue,
            };
            self.push(&spot, wrench, ws);
            for (side, node) in spot.carriers.iter().enumerate().filter_map(|(side, c)| Some((side, node_of(*c)?))) {
                let sign = if side == 0 { 1.0 } else { -1.0 };
                let rows = |m: Matrix6<f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[(3 + r, 3 + c)]));
                ws.dq.nodes.add_block(node, node, sign / self.h, &rows(linear.by_displacement(side, true)));
                ws.dv.nodes.add_block(node, node, sign / self.h, &rows(linear.by_velocity(side, true)));
            }
            ws.spots.f[k] = linear.f;
            ws.spots.rounding[k] = rounding;
            ws.spots.linear.push(linear);
        }
        Ok(())
    }

    /// A contact linearized, its condensed wrench, and the rounding of its w.
    fn linearize_contact_of_solids(
        &self,
        pair: usize,
        features: &Spot,
        spot: &SpotState,
        w: &Vector4<f64>,
        v: &[f64],
        ws: &Workspace,
    ) -> Result<(SpotLinear, Force<f64>, f64), StepError> {
        let solids = spot.solids.map(|s| &self.model.solids[s]);
        let poses = spot.carriers.map(|c| self.pose(c, &ws.q_bar, ws));
        let (meeting, changes) = meeting_changes(features, solids, [&poses[0], &poses[1]], self.theta)
            .map_err(|distance| self.no_normal(spot, distance))?;
        let sliding = self.sliding(spot, &meeting, v, ws);
        let law = self.spot_law(pair, spot);
        let linear = SpotLinear::new(spot.carriers.map(|c| c != Carrier::World), &law, &meeting, &changes, &sliding, self.h, w)
            .ok_or_else(|| {
            let [first, second] = solids.map(|s| s.name.clone());
            StepError::ContactNotFinite { step: 0, first, second, value: w.norm() }
        })?;
        let wrench = spot_wrench(&meeting, law.at.mu, &(w - linear.inverse * linear.f));
        let rounding = linear.rounding(w, &law, &sliding.v_t);
        Ok((linear, wrench, rounding))
    }

    /// How the forces on bodies change with their own bodies, for [`crate::bodies::dynamics::Partials::gather`].
    pub(super) fn spot_changes(&self, condensed: bool, ws: &mut Workspace) {
        let mut changes = std::mem::take(&mut ws.spots.changes);
        changes.clear();
        for (spot, linear) in ws.spots.spots.iter().zip(&ws.spots.linear) {
            for side in 0..2 {
                let Carrier::Body(body) = spot.carriers[side] else { continue };
                let scale = if side == 0 { 1.0 / self.h } else { -1.0 / self.h };
                changes.push(WrenchPartial {
                    body,
                    displaced: linear.by_displacement(side, condensed) * scale,
                    moving: linear.by_velocity(side, condensed) * scale,
                });
            }
        }
        ws.spots.changes = changes;
    }

    /// Adds to `out` what each side's wrench does when the other side is displaced by `by`; the composites' columns must be those of
    /// `by`.
    pub(super) fn add_crossings(&self, by: Displacement, condensed: bool, ws: &Workspace, out: &mut System) {
        let mut nodes: Vec<usize> = Vec::new();
        for spot in &ws.spots.spots {
            match (spot.carriers[0], spot.carriers[1]) {
                (Carrier::Node(node), Carrier::Body(_)) | (Carrier::Body(_), Carrier::Node(node)) => nodes.push(node),
                _ => {}
            }
        }
        nodes.sort_unstable();
        nodes.dedup();
        out.coupling.reset(nodes.into_iter(), self.model.tree.nv());
        for (spot, linear) in ws.spots.spots.iter().zip(&ws.spots.linear) {
            for side in 0..2 {
                // rows of `side`, columns of the other
                let [own, other] = [spot.carriers[side], spot.carriers[1 - side]];
                let scale = if side == 0 { -1.0 / self.h } else { 1.0 / self.h };
                if !matches!(
                    (own, other),
                    (Carrier::Body(_) | Carrier::Node(_), Carrier::Body(_)) | (Carrier::Body(_), Carrier::Node(_))
                ) {
                    continue;
                }
                let displaced = linear.by_displacement(1 - side, condensed) * scale;
                let moving = linear.by_velocity(1 - side, condensed) * scale;
                let change = |(xi, v): (Vector6<f64>, Vector6<f64>)| displaced * xi + moving * v;
                match (own, other) {
                    (Carrier::Body(i), Carrier::Body(l)) => self.each_column(l, ws, &mut |dof, column_change| {
                        let d = change(column_change);
                        self.each_row(i, ws, &mut |row, s| out.bodies.add(row, dof, s.dot(&d)));
                    }),
                    (Carrier::Node(node), Carrier::Body(l)) => self.each_column(l, ws, &mut |dof, column_change| {
                        let d = change(column_change);
                        (0..3).for_each(|a| out.coupling.add_upper(node, a, dof, d[3 + a]));
                    }),
                    (Carrier::Body(i), Carrier::Node(node)) => {
                        for a in 0..3 {
                            let mut unit = Vector6::zeros();
                            unit[3 + a] = 1.0;
                            let d = change((unit * by.cq, unit * by.cv));
                            self.each_row(i, ws, &mut |row, s| out.coupling.add_lower(row, node, a, s.dot(&d)));
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    /// Degrees of freedom that move a body, with their axes.
    fn each_row(&self, body: usize, ws: &Workspace, visit: &mut dyn FnMut(usize, &Vector6<f64>)) {
        let tree = &self.model.tree;
        for l in tree.chain(tree.last_dof(body)) {
            visit(l, &column(&ws.bodies.frames.axes[l].s));
        }
    }

    /// Degrees of freedom that move a body, with the displacement and the change of velocity it then has.
    fn each_column(&self, body: usize, ws: &Workspace, visit: &mut dyn FnMut(usize, (Vector6<f64>, Vector6<f64>))) {
        let tree = &self.model.tree;
        let velocity = ws.bodies.frames.bodies[body].velocity;
        for l in tree.chain(tree.last_dof(body)) {
            visit(l, ws.bodies.partials.change(l, &velocity));
        }
    }

    /// Changes of all w that go with the change `d` of velocities, for the residuals at hand; the columns must be those of K.
    pub(crate) fn spot_steps(&self, d: &[f64], ws: &mut Workspace, next: bool) {
        if ws.spots.spots.is_empty() {
            return;
        }
        let n = self.model.n_node_dofs();
        let moved = ws.bodies.partials.carry(&self.model.tree, &d[n..]);
        let change = |carrier: Carrier| self.moved(carrier, d, &moved, ws);
        let steps = ws
            .spots
            .spots
            .iter()
            .zip(&ws.spots.linear)
            .zip(&ws.spots.f)
            .map(|((spot, linear), f)| linear.dw(f, &spot.carriers.map(change)));
        let mut target: Vec<Vector4<f64>> = steps.collect();
        self.facet_steps(d, ws, &mut target);
        if next { ws.spots.dw_next = target } else { ws.spots.dw = target }
    }

    /// The displacement of a carrier and the change of its velocity that go with the change `d` of velocities; `moved` is what
    /// [`crate::bodies::dynamics::Partials::carry`] makes of it.
    pub(super) fn moved(
        &self,
        carrier: Carrier,
        d: &[f64],
        moved: &[(Vector6<f64>, Vector6<f64>)],
        ws: &Workspace,
    ) -> [Vector6<f64>; 2] {
        match carrier {
            Carrier::World => [Vector6::zeros(); 2],
            Carrier::Node(node) => {
                let v = Vector6::new(0.0, 0.0, 0.0, d[3 * node], d[3 * node + 1], d[3 * node + 2]);
                [v * (self.h * self.scheme.free.a1), v]
            }
            Carrier::Body(body) => {
                let (xi, own) = moved[body];
                [xi, own + moved_along(&xi, &ws.bodies.frames.bodies[body].velocity)]
            }
        }
    }
}
