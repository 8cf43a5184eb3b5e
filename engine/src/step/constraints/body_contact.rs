//! Contact of colliders in a stage: bodies with each other, with fixed shapes and with nodes. The features of each near pair that may
//! meet are listed where a stage begins; each has a signed distance in closed form and a cone variable of its own, under the split law.

use super::link::Link;
use super::{Beginning, ConeRecord, ConstraintId, ConstraintSet, Evaluation, InputsAt, Loads, Slopes, WarmImpulses, cone, reach};
use crate::bodies::Frames;
use crate::bodies::operational::yields;
use crate::constraints::{
    CONSTRAINTS, Sliding, SplitLaw, body_contact_law, contact_geometry_changes, contact_wrench, pose, sharpness, velocity,
};
use crate::geometry::collider::{
    Attachment, ColliderShape, ContactGeometry, FeaturePair, PlacedCollider, Pose, candidates, contact_geometry, drop_hidden,
};
use crate::model::Model;
use crate::step::constants::STEP;
use crate::step::impact_check::Approach;
use crate::step::{Stage, StepError};
use nalgebra::Vector4;
use num_dual::Dual64;
use pliant_math::spatial::{Force, Motion, column};
use pliant_math::{Input, Vec3};

/// Which features of which pair meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyContact {
    pub pair: usize,
    pub features: FeaturePair,
    /// Places of its colliders among those that are used.
    used: [usize; 2],
}

/// A pair of colliders that may touch within the stage.
#[derive(Clone, Copy, Debug)]
struct NearPair {
    pair: usize,
    /// Bound of how fast they approach [m/s].
    speed: f64,
    /// Gap below which their features are listed \[m\].
    margin: f64,
}

/// Contacts of colliders in a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct BodyContacts {
    pub links: Vec<Link>,
    pub contacts: Vec<BodyContact>,
    /// The fastest approach of two colliders with a contact, or a step's fall [m/s].
    pub fastest: f64,
    /// The fastest at which one would be pierced if nothing changed its motion [m/s].
    pub closing: f64,
    placed: Vec<PlacedCollider<f64>>,
    /// Colliders of the listed contacts, and where they are in the evaluation at hand.
    used: Vec<usize>,
    now: Vec<PlacedCollider<f64>>,
    near: Vec<NearPair>,
    found: Vec<(FeaturePair, bool)>,
}

impl Stage<'_> {
    /// The law's numbers at a contact of colliders.
    pub(crate) fn body_contact_law(&self, link: &Link, pair: usize) -> SplitLaw {
        let regularization = if self.options.disabled { STEP.disabled } else { self.options.regularization };
        let (pair, scales) = (&self.model.collider_pairs[pair], [self.h, self.options.rest_gap, sharpness(self.model.h)]);
        body_contact_law(self.model.contact.law, pair, [link.rho_n, link.rho_t], self.theta, scales, regularization)
    }

    /// Geometry of a contact of colliders, its gap counted from its [target](Link::target).
    pub(crate) fn geometry(
        &self,
        link: &Link,
        features: &FeaturePair,
        at: &Evaluation,
    ) -> Result<ContactGeometry<f64>, StepError> {
        let [a, b] = link.colliders;
        self.geometry_of(link, features, [&self.placed(a, at), &self.placed(b, at)])
    }

    fn placed(&self, collider: usize, at: &Evaluation) -> PlacedCollider<f64> {
        let collider = &self.model.colliders[collider];
        collider.placed(&pose(collider.attachment, at.q, at.frames), |k| self.theta[k])
    }

    fn geometry_of(
        &self,
        link: &Link,
        features: &FeaturePair,
        [a, b]: [&PlacedCollider<f64>; 2],
    ) -> Result<ContactGeometry<f64>, StepError> {
        let mut geometry = contact_geometry(features, a, b).map_err(|distance| self.no_normal(link, distance))?;
        geometry.gap -= link.target;
        Ok(geometry)
    }

    fn no_normal(&self, link: &Link, distance: f64) -> StepError {
        let [first, second] = link.colliders.map(|s| self.model.colliders[s].name.clone());
        StepError::NoNormal { step: 0, first, second, distance }
    }
}

impl Link {
    /// Relative motion at a contact.
    pub(crate) fn sliding(&self, geometry: &ContactGeometry<f64>, at: &Evaluation) -> Sliding {
        let [a, b] = self.attachments.map(|c| velocity(c, at.v, at.frames));
        Sliding::new(geometry, a - b)
    }
}

impl BodyContacts {
    /// Whether colliders are near enough to touch within the stage.
    pub fn any(&self) -> bool {
        !self.links.is_empty()
    }

    /// Contacts with their features.
    pub fn each(&self) -> impl Iterator<Item = (&Link, &BodyContact)> {
        self.links.iter().zip(&self.contacts)
    }

    /// Places the colliders of the listed contacts where they are evaluated.
    fn place(&mut self, stage: &Stage, at: &Evaluation) {
        self.now.clear();
        self.now.extend(self.used.iter().map(|collider| stage.placed(*collider, at)));
    }

    /// Finds the pairs that may touch within the stage, from the frames where it begins; whether there are any.
    pub fn find_near(&mut self, stage: &Stage, frames: &Frames<f64>) -> bool {
        let model = stage.model;
        self.placed.clear();
        self.near.clear();
        if model.collider_pairs.is_empty() {
            return false;
        }
        for collider in &model.colliders {
            self.placed.push(collider.placed(&pose(collider.attachment, stage.q_ref, frames), |k| stage.theta[k]));
        }
        let fall = stage.theta[model.gravity].abs() * stage.h;
        for (k, pair) in model.collider_pairs.iter().enumerate() {
            let [a, b] = pair.colliders;
            let (pa, pb) = (&self.placed[a], &self.placed[b]);
            let [va, vb] = [a, b].map(|s| velocity(model.colliders[s].attachment, stage.v_ref, frames));
            let speed = approach(pa, pb, &(va - vb));
            let margin = reach(stage.options.rest_gap) + 1.5 * stage.h * speed + 4.0 * fall * stage.h;
            if bound(pa, pb) <= margin {
                self.near.push(NearPair { pair: k, speed, margin });
            }
        }
        !self.near.is_empty()
    }

    /// Adds the features that will be near where the motion leads: a corner may pass an edge and enter a face within a step. Those
    /// behind which the other collider already is are not the ones that it comes through.
    fn find_ahead(&mut self, stage: &Stage, at: &Beginning, pair: [usize; 2], margin: f64) {
        let [a, b] = pair.map(|k| {
            let collider = &stage.model.colliders[k];
            collider.placed(&pose(collider.attachment, at.q_ahead, at.ahead), |k| stage.theta[k])
        });
        let (from, most) = (self.found.len(), STEP.recovery * stage.h * stage.h);
        candidates(&a, &b, margin, &mut self.found);
        for k in (from..self.found.len()).rev() {
            let (features, swapped) = self.found[k];
            let [first, second] = if swapped { [pair[1], pair[0]] } else { pair };
            let gap = contact_geometry(&features, &self.placed[first], &self.placed[second]).ok().map(|m| m.gap);
            if gap.is_none_or(|gap| gap < -most) || self.found[..from].contains(&self.found[k]) {
                self.found.remove(k);
            }
        }
    }

    /// w on the central path for the gap at the beginning: w₀ v_n = κ, bounded by what closes it.
    fn central(&self, stage: &Stage, k: usize) -> Vector4<f64> {
        let (link, BodyContact { pair, features, .. }) = (&self.links[k], self.contacts[k]);
        let [a, b] = link.colliders;
        let gap = contact_geometry(&features, &self.placed[a], &self.placed[b]).map_or(0.0, |m| m.gap);
        stage.body_contact_law(link, pair).central(gap, stage.h)
    }
}

impl ConstraintSet for BodyContacts {
    fn find(&mut self, stage: &Stage, at: &Beginning) {
        let model = stage.model;
        self.links.clear();
        self.contacts.clear();
        self.used.clear();
        (self.fastest, self.closing) = (stage.theta[model.gravity].abs() * stage.h, 0.0);
        for k in 0..self.near.len() {
            let NearPair { pair, speed, margin } = self.near[k];
            let [a, b] = model.collider_pairs[pair].colliders;
            let (pa, pb) = (&self.placed[a], &self.placed[b]);
            self.found.clear();
            candidates(pa, pb, margin, &mut self.found);
            drop_hidden(pa, pb, STEP.recovery * stage.h * stage.h, &mut self.found);
            self.find_ahead(stage, at, [a, b], margin);
            self.fastest = if self.found.is_empty() { self.fastest } else { self.fastest.max(speed) };
            for &(features, swapped) in &self.found {
                let colliders = if swapped { [b, a] } else { [a, b] };
                let attachments = colliders.map(|s| model.colliders[s].attachment);
                self.links.push(Link::new(ConstraintId::Bodies { pair, features, swapped }, attachments, colliders));
                let used = colliders.map(|s| place_in(&mut self.used, s));
                self.contacts.push(BodyContact { pair, features, used });
            }
        }
    }

    fn scale(&mut self, stage: &Stage, at: &Beginning) {
        for (link, BodyContact { pair, features, .. }) in self.links.iter_mut().zip(&self.contacts) {
            let [a, b] = link.colliders;
            let Ok(geometry) = contact_geometry(features, &self.placed[a], &self.placed[b]) else { continue };
            let along = |x: Vec3<f64>| stage.mobility(link.attachments, at, &Force::at(&geometry.point, x));
            let [s, t] = tangents(&geometry.normal);
            // the largest mobility across the normal
            let (ss, tt) = (along(s), along(t));
            let st = 0.25 * (along(s + t) - along(s - t));
            let across = 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt();
            link.mobility = [along(geometry.normal), across];
            link.set_steps(stage, |node| stage.masses.nodes[node]);
            link.gap = geometry.gap;
            stage.set_target(link, *pair, features, at);
            let [va, vb] = link.attachments.map(|c| velocity(c, stage.v_ref, at.frames));
            link.speed = (va - vb).at(&geometry.point).dot(&geometry.normal);
            self.closing = self.closing.max((link.target - link.gap) / stage.h - link.speed);
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
        self.place(stage, at);
        for (k, (link, BodyContact { pair, features, used })) in self.each().enumerate() {
            let geometry = stage.geometry_of(link, features, used.map(|s| &self.now[s]))?;
            let sliding = link.sliding(&geometry, at);
            let (law, w) = (stage.body_contact_law(link, *pair).for_search(at.at_root), cone(lambda, k));
            let f = law.residual(geometry.gap / stage.h, &sliding.v_t, &w);
            out[4 * k..4 * k + 4].copy_from_slice(f.as_slice());
            link.push(contact_wrench(&geometry, law.mu, &link.load(&w, &f, at)), stage.h, loads);
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
        self.place(stage, at);
        for (k, (link, BodyContact { pair, features, used })) in self.links.iter_mut().zip(&self.contacts).enumerate() {
            if link.attachments.iter().any(|c| matches!(c, Attachment::Node(_))) {
                link.set_steps(stage, |node| stage.resisting_mass(node, at.blocks));
            }
            let (w, first) = (cone(lambda, k), &stage.model.colliders[link.colliders[0]]);
            let first = (first, &pose(first.attachment, at.q, at.frames));
            let (mut geometry, changes) = contact_geometry_changes(features, used.map(|s| &self.now[s]), first, stage.theta)
                .map_err(|distance| stage.no_normal(link, distance))?;
            geometry.gap -= link.target;
            let sliding = link.sliding(&geometry, at);
            let law = stage.body_contact_law(link, *pair).for_search(at.at_root);
            let moves = link.attachments.map(|c| c != Attachment::World);
            if !link.linear.set_contact(moves, &law, &geometry, &changes, &sliding, stage.h, &w) {
                let [first, second] = link.colliders.map(|s| stage.model.colliders[s].name.clone());
                return Err(StepError::ContactNotFinite { step: 0, first, second, value: w.norm() });
            }
            out[4 * k..4 * k + 4].copy_from_slice(link.linear.f.as_slice());
            link.push(contact_wrench(&geometry, law.mu, &link.load(&w, &link.linear.f, at)), stage.h, loads);
            link.add_node_blocks(stage.h, slopes);
        }
        Ok(())
    }

    fn settle(&self, stage: &Stage, at: &Evaluation, lambda: &mut [f64]) -> Result<(), StepError> {
        for ((link, BodyContact { pair, features, .. }), w) in self.each().zip(lambda.chunks_exact_mut(4)) {
            let law = stage.body_contact_law(link, *pair);
            if law.is_idle() {
                let sliding = link.sliding(&stage.geometry(link, features, at)?, at);
                w.copy_from_slice(law.settled(&sliding.v_t, w[0]).as_slice());
            }
        }
        Ok(())
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

    fn links(&self) -> &[Link] {
        &self.links
    }

    fn least_gap(&self) -> f64 {
        self.links.iter().fold(f64::INFINITY, |least, link| least.min(link.gap))
    }

    fn visit_approaches(&self, stage: &Stage, at: &Evaluation, lambda: &[f64], visit: &mut dyn FnMut(Approach)) {
        for (k, (link, BodyContact { features, .. })) in self.each().enumerate() {
            let Ok(geometry) = stage.geometry(link, features, at) else { continue };
            let speed = link.sliding(&geometry, at).velocity.dot(&geometry.normal);
            let pushed = lambda[4 * k] * CONSTRAINTS.rho / link.rho_n;
            visit(Approach { gap: [link.gap, geometry.gap + link.target], speed: [link.speed, speed], pushed });
        }
    }

    fn visit_fixed_blocks(&self, stage: &Stage, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        self.links.iter().for_each(|link| link.visit_fixed_blocks(stage.h, add));
    }
}

impl Stage<'_> {
    /// ρ \[kg\] of a law for a mobility [1/kg]. What nothing can move has none; ρ then only scales the residual, and must be finite.
    pub(crate) fn law_step(&self, mobility: f64) -> f64 {
        CONSTRAINTS.rho / mobility.max(STEP.least_mobility / self.masses.total)
    }

    /// Decides how far a contact is pushed out in this stage. A compliant one is meant to be deep.
    fn set_target(&self, link: &mut Link, pair: usize, features: &FeaturePair, at: &Beginning) {
        (link.target, link.target_by_start) = (0.0, Vec::new());
        let target = self.target(link.gap);
        if target >= 0.0 || self.model.collider_pairs[pair].compliance.is_some() {
            return;
        }
        let [a, b] = link.colliders.map(|s| &self.model.colliders[s]);
        let [of_a, of_b] = [a, b].map(|collider| pose(collider.attachment, self.q_ref, at.frames));
        let placed = [a.placed(&of_a, |k| self.theta[k]), b.placed(&of_b, |k| self.theta[k])];
        let Ok((_, changes)) = contact_geometry_changes(features, placed.each_ref(), (a, &of_a), self.theta) else { return };
        link.target = target;
        let (n, tree) = (self.model.n_node_dofs(), &self.model.tree);
        for (attachment, by) in link.attachments.iter().zip(&changes.gap) {
            match *attachment {
                Attachment::World => {}
                Attachment::Node(node) if self.model.prescribed[node] => {}
                Attachment::Node(node) => link.target_by_start.extend((0..3).map(|a| (3 * node + a, by[3 + a]))),
                Attachment::Body(body) => link
                    .target_by_start
                    .extend(tree.chain(tree.last_dof(body)).map(|l| (n + l, (by * column(&at.frames.axes[l].s))[0]))),
            }
        }
    }

    /// Inverse effective mass of two frames for a wrench on the first and its opposite on the second, where the stage begins; nodes
    /// aside [1/kg].
    pub(crate) fn mobility(&self, attachments: [Attachment; 2], at: &Beginning, wrench: &Force<f64>) -> f64 {
        let of = |attachment: Attachment| match attachment {
            Attachment::World => 0.0,
            Attachment::Body(body) => yields(&at.mobility[body], wrench),
            Attachment::Node(_) => 0.0,
        };
        of(attachments[0]) + of(attachments[1])
    }
}

/// The place of `x` in a short list, to which it is added if it is not there.
fn place_in(list: &mut Vec<usize>, x: usize) -> usize {
    list.iter().position(|y| *y == x).unwrap_or_else(|| {
        list.push(x);
        list.len() - 1
    })
}

/// A bound of how fast two colliders approach anywhere, for the motion of the first relative to the second [m/s].
fn approach(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, relative: &Motion<f64>) -> f64 {
    let toward = |collider: &PlacedCollider<f64>, down: f64| down.max(0.0) + relative.w.norm() * collider.reach();
    match (&a.form, &b.form) {
        (ColliderShape::HalfSpace, _) => toward(b, relative.at(&b.position).dot(&a.rotation.column(2))),
        (_, ColliderShape::HalfSpace) => toward(a, -relative.at(&a.position).dot(&b.rotation.column(2))),
        _ if a.reach() < b.reach() => toward(a, relative.at(&a.position).norm()),
        _ => toward(b, relative.at(&b.position).norm()),
    }
}

/// A lower bound of the distance between two colliders \[m\].
fn bound(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> f64 {
    match (&a.form, &b.form) {
        (ColliderShape::HalfSpace, ColliderShape::HalfSpace) => f64::INFINITY,
        (ColliderShape::HalfSpace, _) => (b.position - a.position).dot(&a.rotation.column(2)) - b.reach(),
        (_, ColliderShape::HalfSpace) => (a.position - b.position).dot(&b.rotation.column(2)) - a.reach(),
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

/// Which contact it is (its pair and features, folded), and 0 separate, 1 stick or 2 slip, plus 4 where it is pushed out over several steps.
pub(super) fn mode(record: &ConeRecord, pair: usize, at: &InputsAt) -> Vec<u8> {
    let (pair, scales) = (&at.model.collider_pairs[pair], [at.stage.h, at.stage.rest_gap, sharpness(at.model.h)]);
    let law = body_contact_law(at.model.contact.law, pair, record.rho, at.theta, scales, 0.0);
    let phase = record.phase((law.at.kappa * law.at.rho_n).sqrt()) + if record.recovers { 4 } else { 0 };
    [record.id.fold().to_le_bytes().to_vec(), vec![phase]].concat()
}

/// ∂(r, F)/∂θ: friction, compliance, and numbers that place and size the colliders.
pub(super) fn visit_inputs(
    record: &ConeRecord,
    pair: usize,
    features: &FeaturePair,
    at: &InputsAt,
    frames: &Frames<f64>,
    visit: &mut dyn FnMut(usize, Input, f64),
) {
    let (model, theta, h) = (at.model, at.theta, at.stage.h);
    let pair = &model.collider_pairs[pair];
    let mut emit = |param: usize, wrench: Option<Force<f64>>, f: Vector4<f64>| {
        if let Some(wrench) = wrench {
            record.visit_wrench(model, frames, &(wrench * (1.0 / h)), &mut |row, value| visit(row, Input::Theta(param), -value));
        }
        (0..4).for_each(|a| visit(record.block.row + a, Input::Theta(param), f[a]));
    };
    let geometry_by = |param| geometry_along(model, features, record.colliders, at.q, frames, theta, param);
    // where its target follows the gap at the beginning
    let start = record.recovers.then(|| at.stage.frames_at_start(model));
    let gap_at_start = |param| {
        let q_ref = &at.stage.start.q_ref;
        let by = start.as_ref().and_then(|frames| geometry_along(model, features, record.colliders, q_ref, frames, theta, param));
        by.map_or(0.0, |(_, by)| by.gap)
    };
    let Some((geometry, _)) = geometry_by(None) else { return };
    let [a, b] = record.attachments.map(|c| velocity(c, &at.stage.v, frames));
    let sliding = Sliding::new(&geometry, a - b);
    let (mu, w) = (pair.friction.value(theta), &record.w);
    let tangential = Vec3::new(w[1], w[2], w[3]);
    for (param, share) in pair.friction.entries().into_iter().flatten() {
        emit(param, Some(Force::at(&geometry.point, tangential) * share), record.f_mu * share);
    }
    if let Some(compliance) = pair.compliance {
        emit(compliance, None, record.f_vn * (w[0] / (h * h)));
    }
    let mut params: Vec<usize> = record.colliders.iter().flat_map(|s| model.colliders[*s].params()).collect();
    params.sort_unstable();
    params.dedup();
    let wrench = contact_wrench(&geometry, mu, w);
    let n = &geometry.normal;
    for param in params {
        let Some((_, by)) = geometry_by(Some(param)) else { continue };
        let impulse = by.normal * w[0];
        let change = Force { n: by.point.cross(&wrench.f) + geometry.point.cross(&impulse), f: impulse };
        let slip = sliding.relative.w.cross(&by.point);
        let dv_t = slip - n * n.dot(&slip) - by.normal * n.dot(&sliding.velocity) - n * by.normal.dot(&sliding.velocity);
        emit(param, Some(change), record.f_vn * ((by.gap - gap_at_start(Some(param))) / h) + record.f_vt * dv_t);
    }
}

/// Geometry of a contact, and its derivative with respect to one entry of θ at fixed poses.
fn geometry_along(
    model: &Model,
    features: &FeaturePair,
    colliders: [usize; 2],
    q_bar: &[f64],
    frames: &Frames<f64>,
    theta: &[f64],
    param: Option<usize>,
) -> Option<(ContactGeometry<f64>, ContactGeometry<f64>)> {
    let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
    let [a, b]: [PlacedCollider<Dual64>; 2] = colliders.map(|s| {
        let collider = &model.colliders[s];
        let pose = pose(collider.attachment, q_bar, frames);
        let pose = Pose { rotation: pose.rotation.map(Dual64::from), position: pose.position.map(Dual64::from) };
        collider.placed(&pose, seeded)
    });
    let m = contact_geometry(features, &a, &b).ok()?;
    let part = |take: fn(&Dual64) -> f64| ContactGeometry {
        gap: take(&m.gap),
        normal: m.normal.map(|x| take(&x)),
        point: m.point.map(|x| take(&x)),
    };
    Some((part(|x| x.re), part(|x| x.eps)))
}
