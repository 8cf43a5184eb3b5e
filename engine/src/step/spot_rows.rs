//! Contacts of solids in a record, with their cone variables as unknowns: see [`super::contact_rows`]. Each moves the degrees of
//! freedom of two carriers, so its blocks are lists over those:
//! ```text
//! r_k −= (column_k · w)/h,     F(w; slope) = F_w dw + Σ_k slope_k dv_k
//! ```

use super::contact_rows::{add_product, replace};
use super::facets::FacetSpot;
use super::spots::{pose, spot_law, tie_law, velocity};
use super::{Stage, StageRecord, Workspace};
use crate::bodies::Frames;
use crate::bodies::dynamics::Displacement;
use crate::bodies::spatial::{Force, column};
use crate::contact::{Sliding, SpotKey, SpotState, Tie, spot_wrench};
use crate::geometry::solid::{Carrier, Meeting, Posed, Spot, meet};
use crate::kinematics::Input;
use crate::model::Model;
use crate::terms::Vec3;
use nalgebra::{Matrix4, SMatrix, Vector4, Vector6};
use num_dual::Dual64;

/// Part of its bound from which friction counts as slipping.
pub(super) const SLIP: f64 = 0.999;

/// A degree of freedom that a contact moves or is moved by.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpotDof {
    /// Its row.
    pub v: usize,
    /// Impulse on it per unit of w.
    pub impulse: Vector4<f64>,
    /// ∂F/∂q̄ along it, and ∂F/∂v⁺ with positions moving along.
    pub by_q: Vector4<f64>,
    pub slope: Vector4<f64>,
}

/// A contact at the root.
#[derive(Clone, Debug)]
pub(crate) struct SpotRecord {
    pub(super) state: SpotState,
    /// Cone variable [N·s].
    pub(super) w: Vector4<f64>,
    pub(super) dofs: Vec<SpotDof>,
    pub(super) f_w: Matrix4<f64>,
    pub(super) inverse: Matrix4<f64>,
    pub(super) f_vn: Vector4<f64>,
    pub(super) f_mu: Vector4<f64>,
    pub(super) f_vt: SMatrix<f64, 4, 3>,
}

impl Stage<'_> {
    /// What the record keeps of the contacts, linearized at the root.
    pub(super) fn spot_records(&self, ws: &mut Workspace) -> Vec<SpotRecord> {
        if ws.spots.spots.is_empty() {
            return Vec::new();
        }
        let by_v = self.spot_dofs(ws);
        ws.bodies.partials.fill_columns(&self.model.tree, &ws.bodies.frames, Displacement { cm: 0.0, cv: 0.0, cq: 1.0 }, &[]);
        let by_q = self.spot_dofs(ws);
        let first_facet = ws.spots.first_facet();
        let record = |(k, state): (usize, &SpotState)| {
            let linear = &ws.spots.linear[k];
            let dofs = by_v[k].iter().zip(&by_q[k]);
            SpotRecord {
                state: *state,
                w: ws.it.p[k],
                dofs: match state.key.facet() {
                    Some(at) => self.facet_dofs(at, &ws.spots.facets[k - first_facet]),
                    None => dofs.map(|(v, q)| SpotDof { v: v.0, impulse: v.1, slope: v.2, by_q: q.3 }).collect(),
                },
                f_w: linear.f_w,
                inverse: linear.inverse,
                f_vn: linear.f_vn,
                f_mu: linear.f_mu,
                f_vt: linear.f_vt,
            }
        };
        ws.spots.spots.iter().enumerate().map(record).collect()
    }

    /// For every spot and every degree of freedom it has to do with: (row, impulse, ∂F by the composites' columns with nodes moving
    /// along as in K, and with nodes displaced alone).
    #[allow(clippy::type_complexity)] // four numbers per degree of freedom, used at once
    fn spot_dofs(&self, ws: &Workspace) -> Vec<Vec<(usize, Vector4<f64>, Vector4<f64>, Vector4<f64>)>> {
        let (n, tree) = (self.model.n_node_dofs(), &self.model.tree);
        let of_spot = |(state, linear): (&SpotState, &crate::contact::SpotLinear)| {
            let mut out: Vec<(usize, Vector4<f64>, Vector4<f64>, Vector4<f64>)> = Vec::new();
            let twice = state.carriers.iter().all(|c| matches!(c, Carrier::Body(_)));
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
                match state.carriers[side] {
                    Carrier::World => {}
                    Carrier::Node(node) => (0..3).for_each(|a| {
                        let xi = linear.f_xi[side].column(3 + a).into_owned();
                        let v = linear.f_v.column(3 + a) * sign;
                        let impulse = linear.w_w.row(3 + a).transpose() * sign;
                        if !self.model.driven[node] {
                            add(3 * node + a, impulse, xi * (self.h * self.scheme.free.a1) + v, xi);
                        }
                    }),
                    Carrier::Body(body) => {
                        let motion = ws.bodies.frames.bodies[body].velocity;
                        for l in tree.chain(tree.last_dof(body)) {
                            let (xi, v): (Vector6<f64>, Vector6<f64>) = ws.bodies.partials.change(l, &motion);
                            let f = linear.f_xi[side] * xi + linear.f_v * v * sign;
                            let impulse = linear.w_w.transpose() * column(&ws.bodies.frames.axes[l].s) * sign;
                            add(n + l, impulse, f, f);
                        }
                    }
                }
            }
            out
        };
        ws.spots.spots.iter().zip(&ws.spots.linear).map(of_spot).collect()
    }
}

impl StageRecord {
    /// Whether there are contacts of solids, or closures.
    pub fn has_solids(&self) -> bool {
        !self.spots.is_empty()
    }

    pub(super) fn spot_row(&self, k: usize) -> usize {
        self.v.len() + 4 * self.contacts.len() + self.rows.len() + 4 * k
    }

    // One column: the same operations as of the transpose, in the same order, so that products with the one and the other agree.

    pub(super) fn subtract_spots_one(&self, x: &[f64], out: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            for dof in &spot.dofs {
                add_product(&(dof.impulse.transpose() / self.h), x, at, out, dof.v, 1);
                add_product(&-dof.slope, x, dof.v, out, at, 1);
            }
            add_product(&-spot.f_w, x, at, out, at, 1);
        }
    }

    /// `b_v += impulse F_w⁻¹ b_w/h`; F_w⁻¹ first: its large entries cancel there.
    pub(super) fn eliminate_spots_one(&self, b: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            let w = spot.inverse * Vector4::from_fn(|r, _| b[at + r]);
            spot.dofs.iter().for_each(|dof| b[dof.v] += dof.impulse.dot(&w) / self.h);
        }
    }

    /// `b_w ← F_w⁻¹ (b_w − slope b_v)`.
    pub(super) fn recover_spots_one(&self, b: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            let mut w = Vector4::from_fn(|r, _| b[at + r]);
            spot.dofs.iter().for_each(|dof| w -= dof.slope * b[dof.v]);
            w = spot.inverse * w;
            (0..4).for_each(|r| b[at + r] = w[r]);
        }
    }

    pub(super) fn add_spot_positions_one(&self, scale: f64, q: &[f64], out: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            for dof in &spot.dofs {
                (0..4).for_each(|r| out[at + r] += scale * dof.by_q[r] * q[dof.v]);
            }
        }
    }

    pub(super) fn subtract_spots_transpose(&self, x: &[f64], out: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            for dof in &spot.dofs {
                add_product(&(dof.impulse / self.h), x, dof.v, out, at, 1);
                add_product(&-dof.slope.transpose(), x, at, out, dof.v, 1);
            }
            add_product(&-spot.f_w.transpose(), x, at, out, at, 1);
        }
    }

    /// `b_w ← F_w⁻ᵀ b_w`, `b_v −= slopeᵀ b_w`.
    pub(super) fn eliminate_spots_transpose(&self, b: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            replace(&spot.inverse.transpose(), b, at, 1);
            let w = Vector4::from_fn(|r, _| b[at + r]);
            spot.dofs.iter().for_each(|dof| b[dof.v] -= dof.slope.dot(&w));
        }
    }

    /// `b_w += F_w⁻ᵀ impulseᵀ b_v/h`.
    pub(super) fn recover_spots_transpose(&self, b: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let at = self.spot_row(k);
            let pulled: Vector4<f64> = spot.dofs.iter().map(|dof| dof.impulse * b[dof.v]).sum();
            let w = spot.inverse.tr_mul(&pulled) / self.h;
            (0..4).for_each(|r| b[at + r] += w[r]);
        }
    }

    pub(super) fn add_spot_positions_transpose(&self, scale: f64, x: &[f64], out: &mut [f64]) {
        for (k, spot) in self.spots.iter().enumerate() {
            let w = Vector4::from_fn(|r, _| x[self.spot_row(k) + r]);
            spot.dofs.iter().for_each(|dof| out[dof.v] += scale * dof.by_q.dot(&w));
        }
    }

    /// Of every contact of solids: which it is (its pair and features, folded), and 0 separate, 1 stick or 2 slip.
    pub(super) fn spot_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let mode = |spot: &SpotRecord| {
            if let Some(at) = spot.state.key.facet() {
                return self.facet_mode(spot, at, model, theta);
            }
            let SpotKey::Contact { pair, .. } = spot.state.key else { return Vec::new() };
            let law = spot_law(model.contact.law, &model.solid_pairs[pair], &spot.state, theta, [self.h, self.rest_gap], 0.0);
            let open = spot.w[0] < (law.at.kappa * law.at.rho_n).sqrt();
            let load = spot.w.fixed_rows::<3>(1).norm() / spot.w[0];
            let mode = if open { 0 } else { 1 + u8::from(load > SLIP) };
            [spot.state.key.fold().to_le_bytes().to_vec(), vec![mode]].concat()
        };
        self.spots.iter().flat_map(mode).collect()
    }

    /// ∂(r, F)/∂θ of the contacts of solids and facets: friction, compliance, and what places and sizes them.
    pub(super) fn visit_spots(
        &self,
        model: &Model,
        theta: &[f64],
        q_bar: &[f64],
        frames: &Frames<f64>,
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        for (k, spot) in self.spots.iter().enumerate() {
            let (pair, features) = match &spot.state.key {
                SpotKey::Contact { pair, spot: features, .. } => (&model.solid_pairs[*pair], features),
                SpotKey::Tie { tie, turn } => {
                    self.visit_tie(k, &model.ties[*tie], *turn, model, theta, q_bar, frames, visit);
                    continue;
                }
                SpotKey::Facet { group, facet, feature } => {
                    let at = FacetSpot { group: *group, facet: *facet, feature: *feature };
                    self.visit_facet((spot, self.spot_row(k)), at, model, theta, q_bar, visit);
                    continue;
                }
            };
            let at = self.spot_row(k);
            let mut emit = |param: usize, wrench: Option<Force<f64>>, f: Vector4<f64>| {
                if let Some(wrench) = wrench {
                    self.visit_wrench(model, frames, &spot.state, &(wrench * (1.0 / self.h)), &mut |row, value| {
                        visit(row, Input::Theta(param), -value);
                    });
                }
                (0..4).for_each(|a| visit(at + a, Input::Theta(param), f[a]));
            };
            let Some((meeting, _)) = meeting_along(model, features, &spot.state, q_bar, frames, theta, None) else { continue };
            let [a, b] = spot.state.carriers.map(|c| velocity(c, &self.v, frames));
            let sliding = Sliding::new(&meeting, a - b);
            let mu = pair.friction.value(theta);
            let tangential = Vec3::new(spot.w[1], spot.w[2], spot.w[3]);
            for (param, share) in pair.friction.entries().into_iter().flatten() {
                emit(param, Some(Force::at(&meeting.point, tangential) * share), spot.f_mu * share);
            }
            if let Some(compliance) = pair.compliance {
                emit(compliance, None, spot.f_vn * (spot.w[0] / (self.h * self.h)));
            }
            let mut params: Vec<usize> = spot.state.solids.iter().flat_map(|s| model.solids[*s].params()).collect();
            params.sort_unstable();
            params.dedup();
            let wrench = spot_wrench(&meeting, mu, &spot.w);
            let n = &meeting.normal;
            for param in params {
                let Some((_, by)) = meeting_along(model, features, &spot.state, q_bar, frames, theta, Some(param)) else {
                    continue;
                };
                let impulse = by.normal * spot.w[0];
                let change = Force { n: by.point.cross(&wrench.f) + meeting.point.cross(&impulse), f: impulse };
                let slip = sliding.relative.w.cross(&by.point);
                let dv_t = slip - n * n.dot(&slip) - by.normal * n.dot(&sliding.velocity) - n * by.normal.dot(&sliding.velocity);
                emit(param, Some(change), spot.f_vn * (by.gap / self.h) + spot.f_vt * dv_t);
            }
        }
    }

    /// ∂(r, F)/∂θ of a tie: its points and its compliance.
    #[allow(clippy::too_many_arguments)] // what `visit_spots` has, and which tie
    fn visit_tie(
        &self,
        k: usize,
        tie: &Tie,
        turn: bool,
        model: &Model,
        theta: &[f64],
        q_bar: &[f64],
        frames: &Frames<f64>,
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        let (spot, at) = (&self.spots[k], self.spot_row(k));
        let law = tie_law(tie, &spot.state, theta, [self.h, self.rest_gap], 0.0);
        let w = Vec3::new(spot.w[1], spot.w[2], spot.w[3]);
        if let Some(compliance) = tie.compliance {
            (0..3).for_each(|a| visit(at + 1 + a, Input::Theta(compliance), law.rho * w[a] / (self.h * self.h)));
        }
        if turn {
            return;
        }
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let pose = pose(tie.carriers[side], q_bar, frames);
            for axis in 0..3 {
                let param = Input::Theta(tie.points[side] + axis);
                let moved = pose.rotation.column(axis).into_owned();
                (0..3).for_each(|a| visit(at + 1 + a, param, sign * law.rho / self.h * moved[a]));
                let wrench = Force { n: moved.cross(&w) * (0.5 / self.h), f: Vec3::zeros() };
                self.visit_wrench(model, frames, &spot.state, &wrench, &mut |row, value| visit(row, param, -value));
            }
        }
    }

    /// Generalized forces of a wrench on the first solid and its opposite on the second.
    fn visit_wrench(
        &self,
        model: &Model,
        frames: &Frames<f64>,
        state: &SpotState,
        wrench: &Force<f64>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        let (n, tree) = (model.n_node_dofs(), &model.tree);
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            match state.carriers[side] {
                Carrier::World => {}
                Carrier::Node(node) if model.driven[node] => {}
                Carrier::Node(node) => (0..3).for_each(|a| visit(3 * node + a, sign * wrench.f[a])),
                Carrier::Body(body) => {
                    tree.chain(tree.last_dof(body)).for_each(|l| visit(n + l, sign * frames.axes[l].s.dot(wrench)));
                }
            }
        }
    }
}

/// A spot's meeting, and its derivative with respect to one entry of θ at fixed poses.
fn meeting_along(
    model: &Model,
    features: &Spot,
    state: &SpotState,
    q_bar: &[f64],
    frames: &Frames<f64>,
    theta: &[f64],
    param: Option<usize>,
) -> Option<(Meeting<f64>, Meeting<f64>)> {
    let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
    let [a, b]: [Posed<Dual64>; 2] = state.solids.map(|s| {
        let solid = &model.solids[s];
        let pose = pose(solid.carrier, q_bar, frames);
        let pose =
            crate::geometry::solid::Pose { rotation: pose.rotation.map(Dual64::from), position: pose.position.map(Dual64::from) };
        solid.posed(&pose, seeded)
    });
    let m = meet(features, &a, &b).ok()?;
    let part = |take: fn(&Dual64) -> f64| Meeting {
        gap: take(&m.gap),
        normal: m.normal.map(|x| take(&x)),
        point: m.point.map(|x| take(&x)),
    };
    Some((part(|x| x.re), part(|x| x.eps)))
}
