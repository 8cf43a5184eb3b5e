//! Contact of nodes with fixed shapes in a stage: every pair of the model, always listed.

use super::{
    Block, Change, ConeRecord, ConstraintId, ConstraintRecords, ConstraintSet, DofPartial, Evaluation, InputsAt, Loads, RecordAt,
    Slopes, WarmImpulses, cone, cones_at_rounding,
};
use crate::constraints::{CONSTRAINTS, Condensed, LawPoint, Touch, contact_law, impulse, sharpness, slip, weighed};
use crate::geometry::collider::Attachment;
use crate::step::impact_check::Approach;
use crate::step::{Stage, StepError};
use nalgebra::{Matrix3, Vector4};
use pliant_math::{Input, Vec3};

/// Node contacts of a stage: every pair of the model, always listed.
#[derive(Clone, Debug, Default)]
pub(crate) struct NodeContacts {
    pub contacts: Vec<Condensed>,
}

impl NodeContacts {
    /// Of `count` pairs.
    pub fn new(count: usize) -> Self {
        Self { contacts: vec![Condensed::zero(); count] }
    }
}

/// Three numbers of a node.
fn of_node(x: &[f64], node: usize) -> Vec3<f64> {
    Vec3::new(x[3 * node], x[3 * node + 1], x[3 * node + 2])
}

fn add_force(node: usize, force: Vec3<f64>, f: &mut [f64]) {
    (0..3).for_each(|a| f[3 * node + a] += force[a]);
}

impl Stage<'_> {
    /// The law's numbers at node contact `c`.
    fn law_point(&self, c: usize) -> LawPoint {
        let pair = &self.model.pairs[c];
        let mass = self.masses.nodes[pair.node];
        LawPoint {
            law: contact_law(self.model.contact.law),
            mu: self.theta[pair.friction],
            slip: slip(self.model.contact.law, self.theta[pair.friction], sharpness(self.model.h)),
            kappa: self.options.rest_gap * mass * weighed(self.theta[self.model.gravity]).0,
            rho: CONSTRAINTS.rho * mass,
        }
    }

    /// Node contact `c` at q⁺, which is q̄ for the schemes that allow contact, and the node's velocity.
    fn touch(&self, c: usize, at: &Evaluation) -> Result<(Touch, Vec3<f64>), StepError> {
        let pair = &self.model.pairs[c];
        let (x, v) = (of_node(at.q, pair.node), of_node(at.v, pair.node));
        let touch = Touch::new(&self.model.shapes[pair.shape], x, v, self.h, self.theta[pair.radius], self.theta);
        let touch = touch.map_err(|source| StepError::Geometry {
            step: 0,
            node: pair.node,
            shape: self.model.shape_names[pair.shape].clone(),
            source,
        })?;
        Ok((touch, v))
    }
}

impl ConstraintSet for NodeContacts {
    fn dim(&self) -> usize {
        4 * self.contacts.len()
    }

    fn visit_approaches(&self, stage: &Stage, at: &Evaluation, lambda: &[f64], visit: &mut dyn FnMut(Approach)) {
        let start = Evaluation { q: stage.q_ref, v: stage.v_ref, ..*at };
        for (c, pair) in stage.model.pairs.iter().enumerate() {
            let [Ok(begin), Ok(end)] = [&start, at].map(|at| stage.touch(c, at)) else { continue };
            let gap = [&begin, &end].map(|(touch, _)| touch.v_n * stage.h);
            let speed = [&begin, &end].map(|(touch, v)| touch.normal.dot(v));
            visit(Approach { gap, speed, pushed: lambda[4 * c] / stage.masses.nodes[pair.node] });
        }
    }

    fn residual(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
    ) -> Result<(), StepError> {
        for (c, contact) in self.contacts.iter().enumerate() {
            let (touch, _) = stage.touch(c, at)?;
            let (law, w) = (stage.law_point(c), cone(lambda, c));
            let f = pliant_smoothing::residual(law.law, law.slip.0, law.kappa, law.rho, touch.v_n, touch.v_t.into(), w.into());
            out[4 * c..4 * c + 4].copy_from_slice(&f);
            let condensed = (impulse(touch.normal, law.mu, &w) - contact.gain * Vector4::from(f)) / stage.h;
            add_force(stage.model.pairs[c].node, condensed, loads.nodes);
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
        for (c, contact) in self.contacts.iter_mut().enumerate() {
            let (touch, v) = stage.touch(c, at)?;
            let (pair, w) = (&stage.model.pairs[c], cone(lambda, c));
            if !contact.linearize(stage.law_point(c), &touch, v, stage.h, &w) {
                return Err(StepError::NotFinite {
                    step: 0,
                    term: stage.model.shape_names[pair.shape].clone(),
                    place: stage.model.row_name(3 * pair.node),
                    value: w.norm(),
                });
            }
            let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]]);
            slopes.dq.add_block(pair.node, pair.node, 1.0 / stage.h, &rows(&contact.dp_dq));
            slopes.dv.add_block(pair.node, pair.node, 1.0 / stage.h, &rows(&contact.dp_dv));
            out[4 * c..4 * c + 4].copy_from_slice(contact.residual.as_slice());
            add_force(pair.node, (contact.impulse - contact.gain * contact.residual) / stage.h, loads.nodes);
        }
        Ok(())
    }

    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        for (c, (contact, pair)) in self.contacts.iter().zip(&stage.model.pairs).enumerate() {
            let dw = contact.dw(&cone(residual, c), of_node(change.d, pair.node), stage.h);
            d[4 * c..4 * c + 4].copy_from_slice(dw.as_slice());
        }
    }

    fn weights(&self, stage: &Stage, out: &mut [f64]) {
        let pairs = out.chunks_exact_mut(4).zip(&stage.model.pairs);
        pairs.for_each(|(w, pair)| w.fill(1.0 / stage.masses.nodes[pair.node]));
    }

    fn start(&self, _stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        if let Some(warm) = warm {
            lambda.copy_from_slice(&warm.nodes);
        }
    }

    fn start_cold(&self, stage: &Stage, _warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        self.start_soft(stage, lambda);
    }

    /// w = √(κ m) e.
    fn start_soft(&self, stage: &Stage, lambda: &mut [f64]) {
        for (c, w) in lambda.chunks_exact_mut(4).enumerate() {
            w.fill(0.0);
            w[0] = (stage.law_point(c).kappa * stage.masses.nodes[stage.model.pairs[c].node]).sqrt();
        }
    }

    fn keep(&self, lambda: &[f64], warm: &mut WarmImpulses) {
        warm.nodes.clear();
        warm.nodes.extend_from_slice(lambda);
    }

    fn record(&self, stage: &Stage, _at: &mut RecordAt, lambda: &[f64], out: &mut ConstraintRecords) {
        for (k, (pair, contact)) in stage.model.pairs.iter().zip(&self.contacts).enumerate() {
            let slope = contact.df_dq * (stage.h * stage.scheme.free.a1) + contact.df_dv;
            let dof = |a: usize| DofPartial {
                v: 3 * pair.node + a,
                impulse: contact.dp_dw.row(a).transpose(),
                by_q: contact.df_dq.column(a).into_owned(),
                slope: slope.column(a).into_owned(),
            };
            let (dofs, row) = ([0, 1, 2].map(dof).to_vec(), out.take_rows(4));
            out.cones.push(ConeRecord {
                id: ConstraintId::Node(k),
                w: cone(lambda, k),
                block: Block { row, dofs, f_lambda: contact.df_dw, inverse: contact.inverse },
                f_vn: contact.df_dvn,
                f_mu: contact.df_dmu,
                f_kappa: contact.df_dkappa,
                f_vt: contact.df_dvt,
                attachments: [Attachment::Node(pair.node), Attachment::World],
                colliders: [0; 2],
                rho: [0.0; 2],
                recovers: false,
            });
        }
    }

    fn at_rounding(&self, stage: &Stage, lambda: &[f64], residuals: &[f64], unit: f64, speed: f64) -> bool {
        let steps = (0..self.contacts.len()).map(|c| stage.law_point(c).rho);
        cones_at_rounding(lambda, residuals, steps, unit, speed)
    }

    fn visit_fixed_blocks(&self, stage: &Stage, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        for (pair, contact) in stage.model.pairs.iter().zip(&self.contacts) {
            add(pair.node, std::array::from_fn(|r| std::array::from_fn(|c| contact.dp_dq_fixed[(r, c)] / stage.h)));
        }
    }
}

/// Calls `emit(parameter, ∂p/∂θ at fixed w, ∂F/∂θ)`: the impulse depends on θ through gap and normal (shape, radius), friction, and
/// κ = δ m g.
pub(crate) fn for_inputs(record: &ConeRecord, pair: usize, at: &InputsAt, emit: &mut dyn FnMut(usize, Vec3<f64>, Vector4<f64>)) {
    let (model, stage, theta) = (at.model, at.stage, at.theta);
    let pair = &model.pairs[pair];
    let (x, v, w) = (of_node(at.q, pair.node), of_node(&stage.v, pair.node), &record.w);
    let shape = &model.shapes[pair.shape];
    let Ok(touch) = Touch::new(shape, x, v, stage.h, theta[pair.radius], theta) else { return };
    // the geometry was evaluated above without error, so it is here
    let _ = shape.visit_theta(&x, pair.radius, theta, &mut |param, dgap, dn| {
        let dv_t = -(dn * touch.normal.dot(&v)) - touch.normal * dn.dot(&v);
        emit(param, dn * w[0], record.f_vn * (dgap / stage.h) + record.f_vt * dv_t);
    });
    emit(pair.friction, Vec3::new(w[1], w[2], w[3]), record.f_mu);
    let mass = &model.masses[pair.node];
    let ((g, slope), by_kappa) = (weighed(theta[model.gravity]), record.f_kappa * stage.rest_gap);
    emit(model.gravity, Vec3::zeros(), by_kappa * (mass.mass(theta) * slope));
    mass.visit(theta, &mut |param, dm| emit(param, Vec3::zeros(), by_kappa * (dm * g)));
}

/// ∂(r, F)/∂θ.
pub(super) fn visit_inputs(record: &ConeRecord, pair: usize, at: &InputsAt, visit: &mut dyn FnMut(usize, Input, f64)) {
    let (node, row) = (at.model.pairs[pair].node, record.block.row);
    for_inputs(record, pair, at, &mut |param, dp, df| {
        (0..3).for_each(|a| visit(3 * node + a, Input::Theta(param), -dp[a] / at.stage.h));
        (0..4).for_each(|a| visit(row + a, Input::Theta(param), df[a]));
    });
}

/// 0 separate, 1 stick, 2 slip.
pub(super) fn mode(record: &ConeRecord, pair: usize, at: &InputsAt) -> u8 {
    let pair = &at.model.pairs[pair];
    let mass = at.model.masses[pair.node].mass(at.theta);
    let weight = mass * weighed(at.theta[at.model.gravity]).0;
    record.phase((at.stage.rest_gap * weight * mass).sqrt())
}
