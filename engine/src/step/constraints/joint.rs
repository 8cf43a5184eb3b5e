//! Joint friction, joint limits and couplings in a stage: each impulse γ is eliminated,
//! ```text
//! r_l = … − γ/h,   F(γ; q⁺, v⁺) = 0      ⇒      r_l = … − (γ − F/F_γ)/h,   K_ll += (F_v + h a1 F_q)/(F_γ h)
//! ```
//! as contacts are. A coupling does the same along l and, by its lever, along the leading degree of freedom; there the lever's own
//! change adds −a1 γ ∂lever/∂q to K.

use super::{
    Block, Change, ConstraintRecords, ConstraintSet, DofPartial, Evaluation, InputsAt, JointRecord, Loads, RecordAt, Slopes,
    WarmImpulses,
};
use crate::constraints::{CONSTRAINTS, JointRow, JointRowKind, RowLinear, RowPoint, sharpness};
use crate::model::Model;
use crate::step::impact_check::Approach;
use crate::step::{Stage, StageRecord, StepError};
use pliant_linalg::System;
use pliant_math::Input;

/// Joint friction, limits and couplings linearized.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointConstraints {
    pub rows: Vec<RowLinear>,
}

impl JointConstraints {
    /// Of `count` rows.
    pub fn new(count: usize) -> Self {
        Self { rows: vec![RowLinear::default(); count] }
    }
}

impl Stage<'_> {
    /// ∂F/∂v⁺ of a row, positions moving along.
    pub(crate) fn row_slope(&self, linear: &RowLinear) -> f64 {
        linear.f_v + self.h * self.scheme.free.a1 * linear.f_q
    }

    fn row_point(&self, row: &JointRow, at: &Evaluation) -> RowPoint {
        row_point(self.model, row, [at.q, at.v, self.past.z], [self.h, self.options.rest_gap])
    }
}

impl ConstraintSet for JointConstraints {
    fn dim(&self) -> usize {
        self.rows.len()
    }

    fn residual(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
    ) -> Result<(), StepError> {
        let n = stage.model.n_node_dofs();
        for (k, row) in stage.joint_rows.iter().enumerate() {
            let point = stage.row_point(row, at);
            out[k] = row.residual(&point, lambda[k], stage.theta);
            let force = row.direction() * (lambda[k] - out[k] / self.rows[k].f_gamma) / stage.h;
            loads.joints.push((n + row.dof, force));
            if let Some(lead) = row.lead() {
                loads.joints.push((n + lead, row.lever(&point, stage.theta) * force));
            }
        }
        Ok(())
    }

    fn linearize(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
        slopes: &mut Slopes,
    ) -> Result<(), StepError> {
        let n = stage.model.n_node_dofs();
        for (k, row) in stage.joint_rows.iter().enumerate() {
            let linear = row.linearize(&stage.row_point(row, at), lambda[k], stage.theta);
            out[k] = linear.f;
            let force = row.direction() * (lambda[k] - linear.f / linear.f_gamma) / stage.h;
            let slope = row.direction() * stage.row_slope(&linear) / (linear.f_gamma * stage.h);
            loads.joints.push((n + row.dof, force));
            slopes.joints.push((row.dof, row.dof, slope));
            if let Some(lead) = row.lead() {
                loads.joints.push((n + lead, linear.lever * force));
                let bent = stage.scheme.free.a1 * linear.lever_bend * lambda[k];
                slopes.joints.push((row.dof, lead, slope * linear.lever));
                slopes.joints.push((lead, row.dof, slope * linear.lever));
                slopes.joints.push((lead, lead, slope * linear.lever * linear.lever - bent));
            }
            self.rows[k] = linear;
        }
        Ok(())
    }

    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        let n = stage.model.n_node_dofs();
        for (k, (row, linear)) in stage.joint_rows.iter().zip(&self.rows).enumerate() {
            let moved = change.d[n + row.dof] + row.lead().map_or(0.0, |lead| linear.lever * change.d[n + lead]);
            d[k] = -(residual[k] + stage.row_slope(linear) * moved) / linear.f_gamma;
        }
    }

    fn weights(&self, stage: &Stage, out: &mut [f64]) {
        out.iter_mut().zip(stage.joint_rows).for_each(|(w, row)| *w = 1.0 / inertias(stage.model, row)[1]);
    }

    fn visit_approaches(&self, stage: &Stage, at: &Evaluation, lambda: &[f64], visit: &mut dyn FnMut(Approach)) {
        let n = stage.model.n_node_dofs();
        for (row, gamma) in stage.joint_rows.iter().zip(lambda) {
            let JointRowKind::Stop(bound, side) = row.kind else { continue };
            let gap = [stage.q_ref, at.q].map(|q| side * (q[n + row.q] - stage.theta[bound]));
            let speed = [stage.v_ref, at.v].map(|v| side * v[n + row.dof]);
            visit(Approach { gap, speed, pushed: gamma / inertias(stage.model, row)[1] });
        }
    }

    fn start(&self, _stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        if let Some(warm) = warm {
            lambda.copy_from_slice(&warm.joints);
        }
    }

    fn start_cold(&self, _stage: &Stage, _warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        lambda.fill(0.0);
    }

    fn start_soft(&self, _stage: &Stage, lambda: &mut [f64]) {
        lambda.fill(0.0);
    }

    fn keep(&self, lambda: &[f64], warm: &mut WarmImpulses) {
        warm.joints.clear();
        warm.joints.extend_from_slice(lambda);
    }

    fn record(&self, stage: &Stage, _at: &mut RecordAt, lambda: &[f64], out: &mut ConstraintRecords) {
        let n = stage.model.n_node_dofs();
        for ((row, linear), gamma) in stage.joint_rows.iter().zip(&self.rows).zip(lambda) {
            let dof = |(v, lever): (usize, f64)| DofPartial {
                v,
                impulse: [row.direction() * lever].into(),
                by_q: [linear.f_q * lever].into(),
                slope: [stage.row_slope(linear) * lever].into(),
            };
            let dofs =
                std::iter::once((n + row.dof, 1.0)).chain(row.lead().map(|lead| (n + lead, linear.lever))).map(dof).collect();
            let (f_lambda, inverse) = ([linear.f_gamma].into(), [1.0 / linear.f_gamma].into());
            out.joints.push(JointRecord { gamma: *gamma, block: Block { row: out.rows, dofs, f_lambda, inverse } });
            out.take_rows(1);
        }
    }

    fn at_rounding(&self, stage: &Stage, lambda: &[f64], residuals: &[f64], unit: f64, speed: f64) -> bool {
        stage.joint_rows.iter().zip(lambda).zip(residuals).all(|((row, impulse), f)| {
            let inertia = inertias(stage.model, row)[0];
            f.abs() <= unit * (impulse.abs() + CONSTRAINTS.rho * inertia * speed)
        })
    }

    fn add_fixed(&self, stage: &Stage, lambda: &[f64], dq: &mut System, a: &mut System) {
        for ((row, linear), s) in stage.joint_rows.iter().zip(&self.rows).zip(lambda) {
            if let Some(lead) = row.lead() {
                a.bodies.add(lead, lead, -stage.scheme.free.a1 * linear.lever_bend * s);
                dq.bodies.add(lead, lead, linear.lever_bend * s / stage.h);
            }
        }
    }
}

/// Inertia that a row acts on, all other degrees of freedom held, and all yielding [kg·m² or kg].
fn inertias(model: &Model, row: &JointRow) -> [f64; 2] {
    match row.coupling() {
        Some(coupling) => [coupling.held, coupling.yielding],
        None => [model.weights.held[row.dof], model.weights.yielding[row.dof]],
    }
}

/// The numbers a row's law is evaluated with.
pub(crate) fn row_point(model: &Model, row: &JointRow, [q, v, z]: [&[f64]; 3], [h, rest_gap]: [f64; 2]) -> RowPoint {
    let n = model.n_node_dofs();
    let [held, yielding] = inertias(model, row);
    RowPoint {
        q: q[n + row.q],
        v: v[n + row.dof],
        lead: row.coupling().and_then(|c| c.lead).map_or(0.0, |joint| q[n + joint.q]),
        h,
        rest_gap,
        sharpness: sharpness(model.h),
        weight: CONSTRAINTS.weight * held,
        rho: CONSTRAINTS.rho * yielding,
        load: row.load().map_or(0.0, |place| z[place]),
    }
}

impl Model {
    /// Friction and limits that can act at these parameters, and couplings.
    pub(crate) fn active_rows(&self, theta: &[f64]) -> Vec<JointRow> {
        self.joint_rows.iter().copied().filter(|row| row.acts(theta)).collect()
    }
}

impl StageRecord {
    /// 1 stick, 2 or 3 slip this way or that (plus 4 under a negative load) of every joint friction; 0 open, 1 closed of every limit; 0 of
    /// couplings.
    pub(crate) fn row_modes(&self, at: &InputsAt) -> Vec<u8> {
        let point = |row: &JointRow| row_point(at.model, row, [at.q, &self.v, &self.start.z_past], [self.h, self.rest_gap]);
        let mut records = self.constraints.joints.iter();
        let mode = |row: &JointRow| match row.acts(at.theta).then(|| records.next()).flatten() {
            Some(record) => row.mode(&point(row), record.gamma, at.theta),
            // friction of size zero slips
            None => 2 + u8::from(point(row).v < 0.0),
        };
        at.model.joint_rows.iter().map(mode).collect()
    }

    /// ∂F/∂(θ, loads) of joint friction, limits and couplings; their smoothing is made of the scene's own inertia and does not change
    /// with θ.
    pub(crate) fn visit_rows(&self, at: &InputsAt, visit: &mut dyn FnMut(usize, Input, f64)) {
        let (model, theta) = (at.model, at.theta);
        if model.joint_rows.is_empty() {
            return;
        }
        let n = model.n_node_dofs();
        let point = |row: &JointRow| row_point(model, row, [at.q, &self.v, &self.start.z_past], [self.h, self.rest_gap]);
        let active = model.joint_rows.iter().filter(|row| row.acts(theta));
        for (row, JointRecord { gamma, block }) in active.zip(&self.constraints.joints) {
            row.visit_theta(&point(row), *gamma, theta, &mut |param, value| visit(block.row, Input::Theta(param), value));
            if let Some((coupling, lead)) = row.coupling().zip(row.lead()) {
                coupling.visit_theta(&point(row), *gamma, theta, &mut |param, [_, by_lever]| {
                    visit(n + lead, Input::Theta(param), -by_lever * gamma / self.h);
                });
            }
            if let Some(place) = row.load() {
                visit(block.row, Input::Z(place), row.by_load(&point(row), *gamma, theta));
            }
        }
        // friction of size zero has no row; its impulse would begin as γ = −F
        for row in model.joint_rows.iter().filter(|row| !row.acts(theta)) {
            row.visit_theta(&point(row), 0.0, theta, &mut |param, value| {
                visit(n + row.dof, Input::Theta(param), row.direction() * value / self.h);
            });
        }
    }
}
