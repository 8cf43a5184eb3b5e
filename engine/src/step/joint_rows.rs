//! Friction and stops at joints in a stage, and joints that follow others: each impulse γ is eliminated,
//! ```text
//! r_l = … − γ/h,   F(γ; q⁺, v⁺) = 0      ⇒      r_l = … − (γ − F/F_γ)/h,   K_ll += (F_v + h a1 F_q)/(F_γ h)
//! ```
//! as contacts are. A coupling does the same along l and, by its lever, along the degree of freedom that leads; there the lever's own
//! change adds −a1 γ ∂lever/∂q to K.

use super::contact_rows::RowRecord;
use super::{Stage, StageRecord, Workspace};
use crate::contact::{JointRow, RowLinear, RowPoint};
use crate::kinematics::Input;
use crate::kkt::System;
use crate::model::Model;

/// Relative change below which an impulse has settled.
const SETTLED: f64 = 1e-6;
/// Part of the degree of freedom's inertia that is the step ρ of the natural residual.
const RHO: f64 = 0.3;

impl Stage<'_> {
    /// What row `k` is evaluated with.
    fn row_point(&self, row: &JointRow, q: &[f64], v: &[f64]) -> RowPoint {
        row_point(self.model, row, [q, v, self.past.z], [self.h, self.rest_gap])
    }

    /// What the record keeps of the rows.
    pub(super) fn row_records(&self, rows: &[RowLinear]) -> Vec<RowRecord> {
        let n = self.model.n_node_dofs();
        let one = |(row, linear): (&JointRow, &RowLinear)| RowRecord {
            v: n + row.dof,
            direction: row.direction(),
            lead: row.lead().map(|dof| (n + dof, linear.lever)),
            linear: *linear,
        };
        self.measure.rows.iter().zip(rows).map(one).collect()
    }

    /// Rows at the iterate, and their share of `ws.r`, for the matrices linearized before.
    pub(super) fn add_rows(&self, s: &[f64], v: &[f64], ws: &mut Workspace) {
        let n = self.model.n_node_dofs();
        for (k, row) in self.measure.rows.iter().enumerate() {
            let at = self.row_point(row, &ws.q_bar, v);
            let f = row.residual(&at, s[k], self.theta);
            ws.row_residuals[k] = f;
            let force = row.direction() * (s[k] - f / ws.rows[k].f_gamma) / self.h;
            ws.r[n + row.dof] -= force;
            if let Some(lead) = row.lead() {
                ws.r[n + lead] -= row.lever(&at, self.theta) * force;
            }
        }
    }

    /// Linearizes the rows, and adds their share to `ws.r` and `ws.k`.
    pub(super) fn linearize_rows(&self, s: &[f64], v: &[f64], ws: &mut Workspace) {
        let n = self.model.n_node_dofs();
        for (diagonal, row) in ws.row_diagonals.iter_mut().zip(&self.measure.rows) {
            *diagonal = ws.k.bodies.get(row.dof, row.dof);
        }
        for (k, row) in self.measure.rows.iter().enumerate() {
            let linear = row.linearize(&self.row_point(row, &ws.q_bar, v), s[k], self.theta);
            ws.row_residuals[k] = linear.f;
            let force = row.direction() * (s[k] - linear.f / linear.f_gamma) / self.h;
            let slope = row.direction() * self.row_slope(&linear) / (linear.f_gamma * self.h);
            ws.r[n + row.dof] -= force;
            ws.k.bodies.add(row.dof, row.dof, slope);
            if let Some(lead) = row.lead() {
                ws.r[n + lead] -= linear.lever * force;
                ws.k.bodies.add(row.dof, lead, slope * linear.lever);
                ws.k.bodies.add(lead, row.dof, slope * linear.lever);
                ws.k.bodies.add(lead, lead, slope * linear.lever * linear.lever - self.scheme.free.a1 * linear.lever_bend * s[k]);
            }
            ws.rows[k] = linear;
        }
    }

    /// ∂F/∂v⁺, positions moving along.
    fn row_slope(&self, linear: &RowLinear) -> f64 {
        linear.f_v + self.h * self.scheme.free.a1 * linear.f_q
    }

    /// Changes of all γ that go with the change `d` of velocities, for the residuals at hand.
    pub(crate) fn row_changes(&self, d: &[f64], ws_rows: &[RowLinear], residuals: &[f64], ds: &mut [f64]) {
        let n = self.model.n_node_dofs();
        for (k, row) in self.measure.rows.iter().enumerate() {
            let moved = d[n + row.dof] + row.lead().map_or(0.0, |lead| ws_rows[k].lever * d[n + lead]);
            ds[k] = -(residuals[k] + self.row_slope(&ws_rows[k]) * moved) / ws_rows[k].f_gamma;
        }
    }

    /// Takes what condensed rows added out of `a`, which is K, and leaves what they do at fixed impulses, as ∂f/∂q̄ in `dq` too.
    pub(super) fn rows_at_fixed_impulses(&self, ws: &mut Workspace, dq: &mut System, a: &mut System) {
        let coupled = self.measure.rows.iter().any(|row| row.lead().is_some());
        if coupled || !ws.spots.spots.is_empty() {
            self.change_by_velocities(false, ws, a);
        } else {
            for (row, diagonal) in self.measure.rows.iter().zip(&ws.row_diagonals) {
                a.bodies.set(row.dof, row.dof, *diagonal);
            }
        }
        for ((row, linear), s) in self.measure.rows.iter().zip(&ws.rows).zip(&ws.it.s) {
            if let Some(lead) = row.lead() {
                a.bodies.add(lead, lead, -self.scheme.free.a1 * linear.lever_bend * s);
                dq.bodies.add(lead, lead, linear.lever_bend * s / self.h);
            }
        }
    }

    /// Rounding noise of all γ in the same measure.
    pub(crate) fn rows_rounding2(&self, rows: &[RowLinear]) -> f64 {
        let noise = |(row, linear): (&JointRow, &RowLinear)| linear.rounding.powi(2) / inertias(self.model, row)[1];
        self.measure.rows.iter().zip(rows).map(noise).sum()
    }

    /// What Δγ² of each row counts: one over its inertia.
    pub(crate) fn row_weights(&self) -> impl Iterator<Item = f64> {
        self.measure.rows.iter().map(|row| 1.0 / inertias(self.model, row)[1])
    }

    /// Rounding of the velocities that closed stops tell, in the norm of corrections [m/s].
    pub(crate) fn rows_held(&self, rows: &[RowLinear]) -> f64 {
        let noise = |(row, linear): (&JointRow, &RowLinear)| linear.held.powi(2) * inertias(self.model, row)[0];
        (self.measure.rows.iter().zip(rows).map(noise).sum::<f64>() / self.measure.total).sqrt()
    }

    /// Whether the pending changes leave the impulses where they are: relative to them, or to what gravity does in the step; those of
    /// couplings at least within their rounding, and those where a stop is closed within what the velocity's makes of them.
    pub(crate) fn rows_settled(&self, s: &[f64], ds: &[f64], rows: &[RowLinear]) -> bool {
        self.measure.rows.iter().zip(s).zip(ds).zip(rows).all(|(((row, s), d), linear)| {
            let weight = inertias(self.model, row)[0] * WEIGHT * self.h;
            let at_stop =
                self.measure.rows.iter().zip(rows).filter(|(other, _)| other.dof == row.dof).map(|(_, other)| other.held);
            let moved = at_stop.fold(0.0, f64::max) * (self.row_slope(linear) / linear.f_gamma).abs();
            let noise = if row.coupling().is_some() { 4.0 * linear.rounding } else { moved };
            d.abs() <= (SETTLED * s.abs().max(1e-3 * weight)).max(noise)
        })
    }
}

/// Acceleration that makes a weight of an inertia in smoothing and tolerances [1/s²] or [m/s²]; near gravity's, but no parameter.
const WEIGHT: f64 = 10.0;

/// Inertia that a row acts on, all other degrees of freedom held, and all yielding [kg·m² or kg].
fn inertias(model: &Model, row: &JointRow) -> [f64; 2] {
    match row.coupling() {
        Some(coupling) => [coupling.held, coupling.yielding],
        None => [model.weights.held[row.dof], model.weights.yielding[row.dof]],
    }
}

fn row_point(model: &Model, row: &JointRow, [q, v, z]: [&[f64]; 3], [h, rest_gap]: [f64; 2]) -> RowPoint {
    let n = model.n_node_dofs();
    let [held, yielding] = inertias(model, row);
    RowPoint {
        q: q[n + row.q],
        v: v[n + row.dof],
        lead: row.coupling().and_then(|c| c.lead).map_or(0.0, |joint| q[n + joint.q]),
        h,
        rest_gap,
        weight: WEIGHT * held,
        rho: RHO * yielding,
        load: row.load().map_or(0.0, |place| z[place]),
    }
}

impl Model {
    /// Friction and stops that can act at these parameters, and couplings.
    pub(crate) fn active_rows(&self, theta: &[f64]) -> Vec<JointRow> {
        self.joint_rows.iter().copied().filter(|row| row.acts(theta)).collect()
    }
}

impl StageRecord {
    /// What every joint friction and stop does at the root.
    pub(super) fn row_modes(&self, model: &Model, theta: &[f64]) -> Vec<u8> {
        let (q, _) = self.evaluation_point(model);
        let point = |row: &JointRow| row_point(model, row, [&q, &self.v, &self.z_past], [self.h, self.rest_gap]);
        let mut impulses = self.s.iter();
        let mode = |row: &JointRow| match row.acts(theta).then(|| impulses.next()).flatten() {
            Some(gamma) => row.mode(&point(row), *gamma, theta),
            // friction of size zero slips
            None => 2 + u8::from(point(row).v < 0.0),
        };
        model.joint_rows.iter().map(mode).collect()
    }

    /// ∂F/∂(θ, loads) of the joints' friction and stops; their smoothing is made of the scene's own inertia and does not change with θ.
    pub(super) fn visit_rows(&self, model: &Model, theta: &[f64], q_bar: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        if model.joint_rows.is_empty() {
            return;
        }
        let point = |row: &JointRow| row_point(model, row, [q_bar, &self.v, &self.z_past], [self.h, self.rest_gap]);
        for (k, row) in model.joint_rows.iter().filter(|row| row.acts(theta)).enumerate() {
            let at = self.joint_row(k);
            row.visit_theta(&point(row), self.s[k], theta, &mut |param, value| visit(at, Input::Theta(param), value));
            if let Some((coupling, lead)) = row.coupling().zip(row.lead()) {
                coupling.visit_theta(&point(row), self.s[k], theta, &mut |param, [_, by_lever]| {
                    visit(model.n_node_dofs() + lead, Input::Theta(param), -by_lever * self.s[k] / self.h);
                });
            }
            if let Some(place) = row.load() {
                visit(at, Input::Z(place), row.by_load(&point(row), self.s[k], theta));
            }
        }
        // friction of size zero has no row; its impulse would begin as γ = −F
        let n = model.n_node_dofs();
        for row in model.joint_rows.iter().filter(|row| !row.acts(theta)) {
            row.visit_theta(&point(row), 0.0, theta, &mut |param, value| {
                visit(n + row.dof, Input::Theta(param), row.direction() * value / self.h);
            });
        }
    }
}
