//! Contact of colliders in a stage: bodies with each other, with fixed shapes and with nodes. The features of each near pair that may
//! meet are listed where a stage begins; each has a signed distance in closed form and a cone variable of its own, under the split law.

use super::link::Link;
use super::{
    Beginning, Change, ConeRecord, ConstraintId, ConstraintRecords, ConstraintSet, Evaluation, InputsAt, Loads, RecordAt, Slopes,
    WarmImpulses, cone, reach,
};
use crate::bodies::Frames;
use crate::bodies::operational::yields;
use crate::constraints::{
    LinkLinear, RHO, Sliding, SplitLaw, body_contact_law, contact_wrench, meeting_changes, pose, rounding, velocity,
};
use crate::geometry::solid::{Carrier, Form, Meeting, Pose, Posed, Spot, candidates, meet};
use crate::model::Model;
use crate::step::constants::STEP;
use crate::step::{Stage, StepError};
use nalgebra::Vector4;
use num_dual::Dual64;
use pliant_math::spatial::{Force, Motion};
use pliant_math::{Input, Vec3};

/// Which features of which pair meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeaturePair {
    pub pair: usize,
    pub features: Spot,
}

/// Contacts of colliders in a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct BodyContacts {
    pub links: Vec<Link>,
    pub contacts: Vec<FeaturePair>,
    /// The fastest approach of two colliders with a contact, or a step's fall [m/s].
    pub fastest: f64,
    /// The fastest at which one would be pierced if nothing changed its motion [m/s].
    pub closing: f64,
    posed: Vec<Posed<f64>>,
    found: Vec<(Spot, bool)>,
}

impl Stage<'_> {
    /// The law's numbers at a contact of colliders.
    pub(crate) fn body_contact_law(&self, link: &Link, pair: usize) -> SplitLaw {
        let soften = if self.options.absent { STEP.disabled } else { self.options.soften };
        let (pair, scales) = (&self.model.solid_pairs[pair], [self.h, self.options.rest_gap]);
        body_contact_law(self.model.contact.law, pair, [link.rho_n, link.rho_t], self.theta, scales, soften)
    }

    /// Geometry of a contact of colliders.
    pub(crate) fn meeting(&self, link: &Link, features: &Spot, at: &Evaluation) -> Result<Meeting<f64>, StepError> {
        let [a, b] = link.solids.map(|s| {
            let solid = &self.model.solids[s];
            solid.posed(&pose(solid.carrier, at.q, at.frames), |k| self.theta[k])
        });
        meet(features, &a, &b).map_err(|distance| self.no_normal(link, distance))
    }

    fn no_normal(&self, link: &Link, distance: f64) -> StepError {
        let [first, second] = link.solids.map(|s| self.model.solids[s].name.clone());
        StepError::NoNormal { step: 0, first, second, distance }
    }
}

impl Link {
    /// Relative motion at a contact.
    pub(crate) fn sliding(&self, meeting: &Meeting<f64>, at: &Evaluation) -> Sliding {
        let [a, b] = self.carriers.map(|c| velocity(c, at.v, at.frames));
        Sliding::new(meeting, a - b)
    }
}

impl BodyContacts {
    /// Whether colliders are near enough to touch within the stage.
    pub fn any(&self) -> bool {
        !self.links.is_empty()
    }

    /// Contacts with their features.
    pub fn each(&self) -> impl Iterator<Item = (&Link, &FeaturePair)> {
        self.links.iter().zip(&self.contacts)
    }

    /// w on the central path for the gap at the beginning: w₀ v_n = κ, bounded by what closes it.
    fn central(&self, stage: &Stage, k: usize) -> Vector4<f64> {
        let (link, FeaturePair { pair, features }) = (&self.links[k], self.contacts[k]);
        let [a, b] = link.solids;
        let gap = meet(&features, &self.posed[a], &self.posed[b]).map_or(0.0, |m| m.gap);
        stage.body_contact_law(link, pair).central(gap, stage.h)
    }
}

/// Whether corrections leave cone variables where they are.
pub(crate) fn cones_settled(lambda: &[f64], d: &[f64], rounding: impl Iterator<Item = f64>) -> bool {
    let largest = |x: &[f64]| x.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    lambda
        .chunks_exact(4)
        .zip(d.chunks_exact(4))
        .zip(rounding)
        .all(|((w, dw), rounding)| largest(dw) <= (STEP.settled_split * largest(w)).max(4.0 * rounding))
}

impl ConstraintSet for BodyContacts {
    fn find(&mut self, stage: &Stage, at: &Beginning) {
        let model = stage.model;
        self.posed.clear();
        self.links.clear();
        self.contacts.clear();
        (self.fastest, self.closing) = (0.0, 0.0);
        if model.solid_pairs.is_empty() {
            return;
        }
        for solid in &model.solids {
            self.posed.push(solid.posed(&pose(solid.carrier, stage.q_ref, at.frames), |k| stage.theta[k]));
        }
        let g = stage.theta[model.gravity].abs();
        self.fastest = g * stage.h;
        for (k, pair) in model.solid_pairs.iter().enumerate() {
            let [a, b] = pair.solids;
            let (pa, pb) = (&self.posed[a], &self.posed[b]);
            let [va, vb] = [a, b].map(|s| velocity(model.solids[s].carrier, stage.v_ref, at.frames));
            let speed = approach(pa, pb, &(va - vb));
            let margin = reach(stage.options.rest_gap) + 1.5 * stage.h * speed + 4.0 * g * stage.h * stage.h;
            if bound(pa, pb) > margin {
                continue;
            }
            self.found.clear();
            candidates(pa, pb, margin, &mut self.found);
            self.fastest = if self.found.is_empty() { self.fastest } else { self.fastest.max(speed) };
            for &(features, swapped) in &self.found {
                let solids = if swapped { [b, a] } else { [a, b] };
                let carriers = solids.map(|s| model.solids[s].carrier);
                self.links.push(Link::new(ConstraintId::Bodies { pair: k, features, swapped }, carriers, solids));
                self.contacts.push(FeaturePair { pair: k, features });
            }
        }
    }

    fn scale(&mut self, stage: &Stage, at: &Beginning) {
        for (link, FeaturePair { features, .. }) in self.links.iter_mut().zip(&self.contacts) {
            let [a, b] = link.solids;
            let Ok(meeting) = meet(features, &self.posed[a], &self.posed[b]) else { continue };
            let along = |x: Vec3<f64>| stage.mobility(link.carriers, at, &Force::at(&meeting.point, x));
            let [s, t] = tangents(&meeting.normal);
            // the largest mobility across the normal
            let (ss, tt) = (along(s), along(t));
            let st = 0.25 * (along(s + t) - along(s - t));
            let across = 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt();
            (link.rho_n, link.rho_t) = (RHO / along(meeting.normal), RHO / across);
            link.gap = meeting.gap;
            let [va, vb] = link.carriers.map(|c| velocity(c, stage.v_ref, at.frames));
            self.closing = self.closing.max(-meeting.gap / stage.h - (va - vb).at(&meeting.point).dot(&meeting.normal));
        }
    }

    fn dim(&self) -> usize {
        4 * self.links.len()
    }

    fn residual(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
    ) -> Result<(), StepError> {
        for (k, (link, FeaturePair { pair, features })) in self.each().enumerate() {
            let meeting = stage.meeting(link, features, at)?;
            let sliding = link.sliding(&meeting, at);
            let (law, w) = (stage.body_contact_law(link, *pair), cone(lambda, k));
            let f = law.residual(meeting.gap / stage.h, &sliding.v_t, &w);
            out[4 * k..4 * k + 4].copy_from_slice(f.as_slice());
            link.push(contact_wrench(&meeting, law.at.mu, &(w - link.linear.inverse * f)), stage.h, loads);
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
        for (k, (link, FeaturePair { pair, features })) in self.links.iter_mut().zip(&self.contacts).enumerate() {
            let (w, solids) = (cone(lambda, k), link.solids.map(|s| &stage.model.solids[s]));
            let poses = link.carriers.map(|c| pose(c, at.q, at.frames));
            let (meeting, changes) = meeting_changes(features, solids, [&poses[0], &poses[1]], stage.theta)
                .map_err(|distance| stage.no_normal(link, distance))?;
            let sliding = link.sliding(&meeting, at);
            let law = stage.body_contact_law(link, *pair);
            let moves = link.carriers.map(|c| c != Carrier::World);
            let linear = LinkLinear::of_contact(moves, &law, &meeting, &changes, &sliding, stage.h, &w).ok_or_else(|| {
                let [first, second] = solids.map(|s| s.name.clone());
                StepError::ContactNotFinite { step: 0, first, second, value: w.norm() }
            })?;
            link.rounding = rounding(&linear.inverse, &w, &law, &sliding.v_t);
            link.linear = linear;
            out[4 * k..4 * k + 4].copy_from_slice(link.linear.f.as_slice());
            link.push(contact_wrench(&meeting, law.at.mu, &(w - link.linear.inverse * link.linear.f)), stage.h, loads);
            link.add_node_blocks(stage.h, slopes);
        }
        Ok(())
    }

    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        for (k, link) in self.links.iter().enumerate() {
            d[4 * k..4 * k + 4].copy_from_slice(link.correct(stage, change, &cone(residual, k)).as_slice());
        }
    }

    fn weights(&self, _stage: &Stage, out: &mut [f64]) {
        self.links.iter().zip(out.chunks_exact_mut(4)).for_each(|(link, out)| out.copy_from_slice(&link.weights()));
    }

    fn start(&self, stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        for (k, link) in self.links.iter().enumerate() {
            let w = warm.and_then(|warm| warm.of(&link.id)).unwrap_or_else(|| self.central(stage, k));
            lambda[4 * k..4 * k + 4].copy_from_slice(w.as_slice());
        }
    }

    fn start_soft(&self, stage: &Stage, lambda: &mut [f64]) {
        for ((link, contact), w) in self.each().zip(lambda.chunks_exact_mut(4)) {
            w.copy_from_slice(stage.body_contact_law(link, contact.pair).middle().as_slice());
        }
    }

    fn keep(&self, lambda: &[f64], warm: &mut WarmImpulses) {
        warm.listed.extend(self.links.iter().enumerate().map(|(k, link)| (link.id, cone(lambda, k))));
    }

    fn record(&self, stage: &Stage, at: &mut RecordAt, lambda: &[f64], out: &mut ConstraintRecords) {
        self.links.iter().enumerate().for_each(|(k, link)| stage.record_link(link, cone(lambda, k), at, out));
    }

    fn rounding2(&self, _stage: &Stage) -> f64 {
        self.links.iter().map(Link::rounding2).sum()
    }

    fn settled(&self, _stage: &Stage, lambda: &[f64], d: &[f64]) -> bool {
        cones_settled(lambda, d, self.links.iter().map(|link| link.rounding))
    }

    fn links(&self) -> &[Link] {
        &self.links
    }

    fn visit_fixed_blocks(&self, stage: &Stage, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        self.links.iter().for_each(|link| link.visit_fixed_blocks(stage.h, add));
    }
}

impl Stage<'_> {
    /// How far two frames yield to a wrench on the first and its opposite on the second, where the stage begins [1/kg].
    pub(crate) fn mobility(&self, carriers: [Carrier; 2], at: &Beginning, wrench: &Force<f64>) -> f64 {
        let of = |carrier: Carrier| match carrier {
            Carrier::World => 0.0,
            Carrier::Body(body) => yields(&at.mobility[body], wrench),
            Carrier::Node(node) => wrench.f.norm_squared() / self.masses.nodes[node].max(f64::MIN_POSITIVE),
        };
        of(carriers[0]) + of(carriers[1])
    }
}

/// A bound of how fast two solids approach anywhere, for the motion of the first relative to the second [m/s].
fn approach(a: &Posed<f64>, b: &Posed<f64>, relative: &Motion<f64>) -> f64 {
    let toward = |solid: &Posed<f64>, down: f64| down.max(0.0) + relative.w.norm() * solid.reach();
    match (a.form, b.form) {
        (Form::HalfSpace, _) => toward(b, relative.at(&b.position).dot(&a.rotation.column(2))),
        (_, Form::HalfSpace) => toward(a, -relative.at(&a.position).dot(&b.rotation.column(2))),
        _ if a.reach() < b.reach() => toward(a, relative.at(&a.position).norm()),
        _ => toward(b, relative.at(&b.position).norm()),
    }
}

/// A lower bound of the distance between two solids \[m\].
fn bound(a: &Posed<f64>, b: &Posed<f64>) -> f64 {
    match (a.form, b.form) {
        (Form::HalfSpace, Form::HalfSpace) => f64::INFINITY,
        (Form::HalfSpace, _) => (b.position - a.position).dot(&a.rotation.column(2)) - b.reach(),
        (_, Form::HalfSpace) => (a.position - b.position).dot(&b.rotation.column(2)) - a.reach(),
        _ => (a.position - b.position).norm() - a.reach() - b.reach(),
    }
}

/// Two unit vectors across a unit vector and each other.
pub(crate) fn tangents(n: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let k = n.iamin();
    let mut e = Vec3::zeros();
    e[k] = 1.0;
    let s = n.cross(&e).normalize();
    [s, n.cross(&s)]
}

/// Which contact it is (its pair and features, folded), and 0 separate, 1 stick or 2 slip.
pub(super) fn mode(record: &ConeRecord, pair: usize, at: &InputsAt) -> Vec<u8> {
    let (pair, scales) = (&at.model.solid_pairs[pair], [at.stage.h, at.stage.rest_gap]);
    let law = body_contact_law(at.model.contact.law, pair, record.rho, at.theta, scales, 0.0);
    let phase = record.phase((law.at.kappa * law.at.rho_n).sqrt());
    [record.id.fold().to_le_bytes().to_vec(), vec![phase]].concat()
}

/// ∂(r, F)/∂θ: friction, compliance, and numbers that place and size the colliders.
pub(super) fn visit_inputs(
    record: &ConeRecord,
    pair: usize,
    features: &Spot,
    at: &InputsAt,
    frames: &Frames<f64>,
    visit: &mut dyn FnMut(usize, Input, f64),
) {
    let (model, theta, h) = (at.model, at.theta, at.stage.h);
    let pair = &model.solid_pairs[pair];
    let mut emit = |param: usize, wrench: Option<Force<f64>>, f: Vector4<f64>| {
        if let Some(wrench) = wrench {
            record.visit_wrench(model, frames, &(wrench * (1.0 / h)), &mut |row, value| visit(row, Input::Theta(param), -value));
        }
        (0..4).for_each(|a| visit(record.block.row + a, Input::Theta(param), f[a]));
    };
    let geometry = |param| meeting_along(model, features, record.solids, at.q, frames, theta, param);
    let Some((meeting, _)) = geometry(None) else { return };
    let [a, b] = record.carriers.map(|c| velocity(c, &at.stage.v, frames));
    let sliding = Sliding::new(&meeting, a - b);
    let (mu, w) = (pair.friction.value(theta), &record.w);
    let tangential = Vec3::new(w[1], w[2], w[3]);
    for (param, share) in pair.friction.entries().into_iter().flatten() {
        emit(param, Some(Force::at(&meeting.point, tangential) * share), record.f_mu * share);
    }
    if let Some(compliance) = pair.compliance {
        emit(compliance, None, record.f_vn * (w[0] / (h * h)));
    }
    let mut params: Vec<usize> = record.solids.iter().flat_map(|s| model.solids[*s].params()).collect();
    params.sort_unstable();
    params.dedup();
    let wrench = contact_wrench(&meeting, mu, w);
    let n = &meeting.normal;
    for param in params {
        let Some((_, by)) = geometry(Some(param)) else { continue };
        let impulse = by.normal * w[0];
        let change = Force { n: by.point.cross(&wrench.f) + meeting.point.cross(&impulse), f: impulse };
        let slip = sliding.relative.w.cross(&by.point);
        let dv_t = slip - n * n.dot(&slip) - by.normal * n.dot(&sliding.velocity) - n * by.normal.dot(&sliding.velocity);
        emit(param, Some(change), record.f_vn * (by.gap / h) + record.f_vt * dv_t);
    }
}

/// Geometry of a contact, and its derivative with respect to one entry of θ at fixed poses.
fn meeting_along(
    model: &Model,
    features: &Spot,
    solids: [usize; 2],
    q_bar: &[f64],
    frames: &Frames<f64>,
    theta: &[f64],
    param: Option<usize>,
) -> Option<(Meeting<f64>, Meeting<f64>)> {
    let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
    let [a, b]: [Posed<Dual64>; 2] = solids.map(|s| {
        let solid = &model.solids[s];
        let pose = pose(solid.carrier, q_bar, frames);
        let pose = Pose { rotation: pose.rotation.map(Dual64::from), position: pose.position.map(Dual64::from) };
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
