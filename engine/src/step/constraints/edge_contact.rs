//! Contact of edges and triangles with fixed shapes in a stage: listed where the stage begins, condensed into forces on two or three
//! nodes.

use super::{
    Beginning, Block, Change, ConeRecord, ConstraintId, ConstraintRecords, ConstraintSet, DofPartial, EdgeId, Evaluation,
    InputsAt, Loads, RecordAt, Slopes, WarmImpulses, cone, cones_at_rounding, reach,
};
use crate::constraints::{
    CONSTRAINTS, ConeLinear, ContactElement, ElementLinear, SplitLaw, element_changes, element_law, impulse, of_nodes,
    pose_of_world, sharpness, tangential, weighted,
};
use crate::geometry::collider::{Attachment, ColliderShape, Feature, PlacedCollider, Pose};
use crate::geometry::element::{Candidates, Nearest, Region, candidates, nearest};
use crate::model::Model;
use crate::step::impact_check::Approach;
use crate::step::{Stage, StepError};
use nalgebra::{Matrix3, Vector4};
use num_dual::Dual64;
use pliant_linalg::System;
use pliant_math::{Input, Vec3};

/// A contact of an edge or triangle, as the beginning of the stage lists it, and linearized.
#[derive(Clone, Debug)]
pub(crate) struct EdgeContact {
    pub id: EdgeId,
    /// Step of the law \[kg\].
    pub rho: f64,
    /// Signed distance where the stage begins \[m\].
    pub gap: f64,
    /// Signed distance that it must have where the stage ends \[m\]: 0, or less where it begins [deep](Stage::target), and then its
    /// derivatives by the positions of the nodes where the stage begins [-].
    pub target: f64,
    pub target_by_start: [Vec3<f64>; 3],
    /// The law alone, and with what it is evaluated at.
    pub law: ConeLinear,
    pub linear: Option<ElementLinear>,
}

/// Contacts of edges and triangles in a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct EdgeContacts {
    pub contacts: Vec<EdgeContact>,
    /// The shapes that groups may touch, in the world.
    pub fixed: Vec<PlacedCollider<f64>>,
    features: Vec<Feature>,
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]])
}

impl Stage<'_> {
    /// Features of a shape that an edge or triangle may touch within the stage.
    fn list_features(&self, element: &ContactElement, shape: &PlacedCollider<f64>, found: &mut Vec<Feature>) {
        let (now, radius) = (of_nodes(element, self.q_ref), self.theta[element.radius]);
        let velocity = |node: usize| {
            let from = if self.model.prescribed[node] { self.v_cmd } else { self.v_ref };
            Vec3::new(from[3 * node], from[3 * node + 1], from[3 * node + 2])
        };
        let at = |node: usize| Vec3::new(self.q_ref[3 * node], self.q_ref[3 * node + 1], self.q_ref[3 * node + 2]);
        let v = element.nodes.map(velocity);
        let speed = v.iter().fold(0.0_f64, |a, v| a.max(v.norm()));
        let g = self.theta[self.model.gravity].abs();
        let margin = reach(self.options.rest_gap) + 1.5 * self.h * speed + 4.0 * g * self.h * self.h;
        let n = element.count;
        let middle = now[..n].iter().sum::<Vec3<f64>>() / n as f64;
        let size = now[..n].iter().fold(0.0_f64, |a, x| a.max((x - middle).norm()));
        if shape.distance_bound(&middle) > margin + size + radius {
            return;
        }
        let next = std::array::from_fn::<_, 3, _>(|i| now[i] + v[i] * self.h);
        let thirds_next = element.thirds.map(|t| t.map(|node| at(node) + velocity(node) * self.h));
        let now = Candidates { x: &now[..n], radius, sheet: element.thirds.map(|t| t.map(at)), shape, margin };
        candidates(&now, &Candidates { x: &next[..n], sheet: thirds_next, ..now }, found);
    }

    /// The law's numbers at the contact of an edge or triangle.
    fn element_law(&self, contact: &EdgeContact) -> SplitLaw {
        let of = (&self.model.element_groups[contact.id.group], &self.model.elements[contact.id.element]);
        element_law(
            self.model.contact.law,
            of,
            contact.rho,
            self.theta,
            [self.options.rest_gap, sharpness(self.model.h)],
            self.options.regularization,
        )
    }

    fn element_names(&self, id: &EdgeId) -> [String; 2] {
        let collider = self.model.element_groups[id.group].collider;
        [self.model.element_name(id.element), self.model.colliders[collider].name.clone()]
    }

    fn no_normal_of_element(&self, id: &EdgeId, distance: f64) -> StepError {
        let [first, second] = self.element_names(id);
        StepError::NoNormal { step: 0, first, second, distance }
    }

    fn edge_contact(&self, id: EdgeId, shape: &PlacedCollider<f64>) -> EdgeContact {
        let element = &self.model.elements[id.element];
        let free = element.corners().iter().filter(|node| !self.model.prescribed[**node]);
        // wherever the point is, no node is lighter than this
        let rho = CONSTRAINTS.rho * free.fold(f64::INFINITY, |m, node| m.min(self.masses.nodes[*node]));
        let x = of_nodes(element, self.q_ref);
        let found = nearest(&x[..element.count], self.theta[element.radius], id.feature, shape);
        let (gap, by_start) =
            found.map_or((0.0, [Vec3::zeros(); 3]), |found| (found.gap, found.weights.map(|w| found.normal * w)));
        let target = self.target(gap);
        let target_by_start = if target < 0.0 { by_start } else { [Vec3::zeros(); 3] };
        EdgeContact { id, rho, gap, target, target_by_start, law: ConeLinear::zero(), linear: None }
    }
}

impl ConstraintSet for EdgeContacts {
    fn find(&mut self, stage: &Stage, _at: &Beginning) {
        let model = stage.model;
        self.contacts.clear();
        self.fixed.clear();
        let world = pose_of_world(&Vec3::zeros());
        let shape = |collider: usize| model.colliders[collider].placed(&world, |k| stage.theta[k]);
        self.fixed.extend(model.element_groups.iter().map(|group| shape(group.collider)));
        for (k, (group, shape)) in model.element_groups.iter().zip(&self.fixed).enumerate() {
            for index in group.elements.clone() {
                self.features.clear();
                stage.list_features(&model.elements[index], shape, &mut self.features);
                let id = |&feature: &Feature| EdgeId { group: k, element: index, feature };
                self.contacts.extend(self.features.iter().map(id).map(|id| stage.edge_contact(id, shape)));
            }
        }
    }

    fn dim(&self) -> usize {
        4 * self.contacts.len()
    }

    fn least_gap(&self) -> f64 {
        self.contacts.iter().fold(f64::INFINITY, |least, contact| least.min(contact.gap))
    }

    fn visit_approaches(&self, stage: &Stage, at: &Evaluation, lambda: &[f64], visit: &mut dyn FnMut(Approach)) {
        for (k, contact) in self.contacts.iter().enumerate() {
            let element = &stage.model.elements[contact.id.element];
            let (radius, shape) = (stage.theta[element.radius], &self.fixed[contact.id.group]);
            // of the point that is nearest: the gap, and its rate along the normal
            let near = |q: &[f64], v: &[f64]| {
                let found = nearest(&of_nodes(element, q)[..element.count], radius, contact.id.feature, shape).ok()?;
                Some((found.gap, weighted(&found.weights, &of_nodes(element, v)).dot(&found.normal)))
            };
            let (Some(begin), Some(end)) = (near(stage.q_ref, stage.v_ref), near(at.q, at.v)) else { continue };
            let pushed = lambda[4 * k] * CONSTRAINTS.rho / contact.rho;
            visit(Approach { gap: [begin.0, end.0], speed: [begin.1, end.1], pushed });
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
        for (k, contact) in self.contacts.iter().enumerate() {
            let (element, w) = (&stage.model.elements[contact.id.element], cone(lambda, k));
            let x = of_nodes(element, at.q);
            let shape = &self.fixed[contact.id.group];
            let found = nearest(&x[..element.count], stage.theta[element.radius], contact.id.feature, shape)
                .map_err(|distance| stage.no_normal_of_element(&contact.id, distance))?;
            let law = stage.element_law(contact).for_search(at.at_root);
            let u_t = tangential(&found.normal, &weighted(&found.weights, &of_nodes(element, at.v)));
            let f = law.residual((found.gap - contact.target) / stage.h, &u_t, &w);
            out[4 * k..4 * k + 4].copy_from_slice(f.as_slice());
            element.push(&found, impulse(found.normal, law.mu, &(w - contact.law.inverse * f)), stage.h, loads.nodes);
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
        for (k, contact) in self.contacts.iter_mut().enumerate() {
            let (element, w) = (&stage.model.elements[contact.id.element], cone(lambda, k));
            let (x, v) = (of_nodes(element, at.q), of_nodes(element, at.v));
            let shape = &self.fixed[contact.id.group];
            let changes = element_changes(&x, element.count, stage.theta[element.radius], contact.id.feature, shape)
                .map_err(|distance| stage.no_normal_of_element(&contact.id, distance))?;
            let (found, law) = (changes.nearest, stage.element_law(contact).for_search(at.at_root));
            let u_t = tangential(&found.normal, &weighted(&found.weights, &v));
            let lin = law.linearize((found.gap - contact.target) / stage.h, &u_t, &w);
            if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
                let [first, second] = stage.element_names(&contact.id);
                return Err(StepError::ContactNotFinite { step: 0, first, second, value: w.norm() });
            }
            let linear = ElementLinear::new(&lin, &changes, law.mu, &v, stage.h, &w);
            for (i, &row) in element.corners().iter().enumerate() {
                for (j, &column) in element.corners().iter().enumerate() {
                    let [by_x, by_v] = linear.condensed(i, j);
                    slopes.dq.add_block(row, column, 1.0 / stage.h, &rows(&by_x));
                    slopes.dv.add_block(row, column, 1.0 / stage.h, &rows(&by_v));
                }
            }
            contact.law = ConeLinear::new(&lin, law.slip_by_mu);
            contact.linear = Some(linear);
            out[4 * k..4 * k + 4].copy_from_slice(lin.f.as_slice());
            element.push(&found, impulse(found.normal, law.mu, &(w - lin.df_dw_inverse * lin.f)), stage.h, loads.nodes);
        }
        Ok(())
    }

    fn settle(&self, stage: &Stage, at: &Evaluation, lambda: &mut [f64]) -> Result<(), StepError> {
        for (contact, w) in self.contacts.iter().zip(lambda.chunks_exact_mut(4)) {
            let law = stage.element_law(contact);
            if law.is_idle() {
                let element = &stage.model.elements[contact.id.element];
                let (x, v) = (of_nodes(element, at.q), of_nodes(element, at.v));
                let shape = &self.fixed[contact.id.group];
                let found = nearest(&x[..element.count], stage.theta[element.radius], contact.id.feature, shape)
                    .map_err(|distance| stage.no_normal_of_element(&contact.id, distance))?;
                let u_t = tangential(&found.normal, &weighted(&found.weights, &v));
                w.copy_from_slice(law.settled(&u_t, w[0]).as_slice());
            }
        }
        Ok(())
    }

    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        for (k, contact) in self.contacts.iter().enumerate() {
            let element = &stage.model.elements[contact.id.element];
            let d_x = of_nodes(element, change.d);
            let mut dw = -(contact.law.inverse * cone(residual, k));
            if let Some(linear) = &contact.linear {
                let moved = (0..element.count).map(|j| linear.slope(j, stage.h * stage.scheme.free.a1) * d_x[j]);
                dw -= contact.law.inverse * moved.sum::<Vector4<f64>>();
            }
            d[4 * k..4 * k + 4].copy_from_slice(dw.as_slice());
        }
    }

    fn weights(&self, _stage: &Stage, out: &mut [f64]) {
        self.contacts.iter().zip(out.chunks_exact_mut(4)).for_each(|(contact, out)| out.fill(CONSTRAINTS.rho / contact.rho));
    }

    fn start(&self, stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        for (contact, w) in self.contacts.iter().zip(lambda.chunks_exact_mut(4)) {
            let known = warm.and_then(|warm| warm.of(&ConstraintId::Edge(contact.id)));
            let start = known.unwrap_or_else(|| stage.element_law(contact).central(contact.gap - contact.target, stage.h));
            w.copy_from_slice(start.as_slice());
        }
    }

    fn start_soft(&self, stage: &Stage, lambda: &mut [f64]) {
        for (contact, w) in self.contacts.iter().zip(lambda.chunks_exact_mut(4)) {
            w.copy_from_slice(stage.element_law(contact).middle().as_slice());
        }
    }

    fn keep(&self, lambda: &[f64], warm: &mut WarmImpulses) {
        let each = |(k, contact): (usize, &EdgeContact)| (ConstraintId::Edge(contact.id), cone(lambda, k));
        warm.listed.extend(self.contacts.iter().enumerate().map(each));
    }

    /// Prescribed nodes move the contact but do not feel it.
    fn record(&self, stage: &Stage, _at: &mut RecordAt, lambda: &[f64], out: &mut ConstraintRecords) {
        let way = stage.h * stage.scheme.free.a1;
        for (k, (contact, linear)) in self.contacts.iter().filter_map(|c| Some((c, c.linear.as_ref()?))).enumerate() {
            let element = &stage.model.elements[contact.id.element];
            let dofs = element.corners().iter().enumerate().flat_map(|(j, &node)| {
                let felt = if stage.model.prescribed[node] { 0.0 } else { linear.weights[j] };
                let slope = linear.slope(j, way);
                let (by_gap, by_start) = (contact.law.f_vn / stage.h, contact.target_by_start[j]);
                (0..3).map(move |a| DofPartial {
                    v: 3 * node + a,
                    impulse: linear.by_w.row(a).transpose() * felt,
                    // v_n = (gap − target)/h, where the target may follow the positions at the beginning
                    by_q: linear.f_x[j].column(a) - by_gap * by_start[a],
                    slope: slope.column(a).into_owned(),
                })
            });
            let block = Block { row: out.rows, dofs: dofs.collect(), f_lambda: contact.law.f_w, inverse: contact.law.inverse };
            out.take_rows(4);
            out.cones.push(ConeRecord {
                id: ConstraintId::Edge(contact.id),
                w: cone(lambda, k),
                block,
                f_vn: contact.law.f_vn,
                f_mu: contact.law.f_mu,
                f_kappa: Vector4::zeros(),
                f_vt: contact.law.f_vt,
                attachments: [Attachment::World; 2],
                colliders: [0; 2],
                rho: [contact.rho; 2],
                recovers: contact.target < 0.0,
            });
        }
    }

    fn at_rounding(&self, _stage: &Stage, lambda: &[f64], residuals: &[f64], unit: f64, speed: f64) -> bool {
        cones_at_rounding(lambda, residuals, self.contacts.iter().map(|contact| contact.rho), unit, speed)
    }

    fn joined_nodes(&self, stage: &Stage, pairs: &mut Vec<[usize; 2]>) {
        for contact in &self.contacts {
            let nodes = stage.model.elements[contact.id.element].corners();
            for &i in nodes.iter().filter(|i| !stage.model.prescribed[**i]) {
                pairs.extend(nodes.iter().filter(|j| **j != i).map(|&j| [i, j]));
            }
        }
    }

    fn add_fixed(&self, stage: &Stage, _lambda: &[f64], dq: &mut System, a: &mut System) {
        let cq = stage.h * stage.scheme.free.a1;
        for (contact, linear) in self.contacts.iter().filter_map(|contact| Some((contact, contact.linear.as_ref()?))) {
            let nodes = stage.model.elements[contact.id.element].corners();
            for (i, &row) in nodes.iter().enumerate().filter(|(_, node)| !stage.model.prescribed[**node]) {
                for (j, &column) in nodes.iter().enumerate() {
                    let block = rows(&linear.fixed[i][j]);
                    dq.nodes.add_block(row, column, 1.0 / stage.h, &block);
                    a.nodes.add_block(row, column, -cq / stage.h, &block);
                }
            }
        }
    }
}

impl PlacedCollider<f64> {
    /// A lower bound of the distance from a point to the solid \[m\], for balls, capsules and blocks.
    fn distance_bound(&self, x: &Vec3<f64>) -> f64 {
        let y = self.rotation.tr_mul(&(x - self.position));
        match self.form {
            ColliderShape::Ball => (x - self.position).norm() - self.sizes[0],
            ColliderShape::Capsule => {
                let beyond = (y[2].abs() - self.sizes[1]).max(0.0);
                let across = ((x - self.position).norm_squared() - y[2] * y[2]).max(0.0);
                (across + beyond * beyond).sqrt() - self.sizes[0]
            }
            ColliderShape::Block => Vec3::from_fn(|k, _| (y[k].abs() - self.sizes[k]).max(0.0)).norm(),
            ColliderShape::HalfSpace | ColliderShape::Cylinder | ColliderShape::Hull(_) => f64::INFINITY,
        }
    }
}

impl Model {
    /// A contact element by its nodes, for messages.
    pub(crate) fn element_name(&self, element: usize) -> String {
        let element = &self.elements[element];
        let first = element.nodes[0];
        let span = self.node_spans().find(|(_, nodes)| nodes.contains(&first));
        let (name, start) = span.map_or(("", 0), |(name, nodes)| (name, nodes.start));
        match element.nodes.map(|node| node - start) {
            [a, b, c] if element.count == 3 => format!("{name}, triangle of nodes {a}, {b}, {c}"),
            [a, b, _] => format!("{name}, edge of nodes {a}, {b}"),
        }
    }
}

/// The nearest point of an edge or triangle at nodes' positions `q` for entries of θ as `theta` has them.
fn nearest_with(model: &Model, id: EdgeId, q: &[f64], theta: impl Fn(usize) -> Dual64) -> Option<Nearest<Dual64>> {
    let element = &model.elements[id.element];
    let x = of_nodes(element, q).map(|x| x.map(Dual64::from_re));
    let world = pose_of_world(&Vec3::zeros());
    let pose = Pose { rotation: world.rotation.map(Dual64::from_re), position: world.position.map(Dual64::from_re) };
    let shape = model.colliders[model.element_groups[id.group].collider].placed(&pose, &theta);
    nearest(&x[..element.count], theta(element.radius), id.feature, &shape).ok()
}

/// Numbers that tell the contact apart, 0 separate, 1 stick or 2 slip, plus 4 where it is pushed out over several steps, and which part of the edge or triangle is nearest.
pub(super) fn mode(record: &ConeRecord, id: EdgeId, at: &InputsAt) -> Vec<u8> {
    let of = (&at.model.element_groups[id.group], &at.model.elements[id.element]);
    let law = element_law(at.model.contact.law, of, record.rho[0], at.theta, [at.stage.rest_gap, sharpness(at.model.h)], 0.0);
    let phase = record.phase((law.at.kappa * law.at.rho_n).sqrt()) + if record.recovers { 4 } else { 0 };
    let region = || match nearest_with(at.model, id, at.q, |k| Dual64::from_re(at.theta[k]))?.region {
        Region::Inside => Some(1),
        Region::Side(k) => Some(2 + k),
        Region::Node(k) => Some(5 + k),
    };
    // far from touching, nothing hangs on it
    let region = if phase == 0 { 0 } else { region().unwrap_or(0) };
    [record.id.fold().to_le_bytes().to_vec(), vec![phase, region]].concat()
}

/// ∂(r, F)/∂θ: friction, the radius, and numbers that place and size the shape.
pub(super) fn visit_inputs(record: &ConeRecord, id: EdgeId, at: &InputsAt, visit: &mut dyn FnMut(usize, Input, f64)) {
    let (model, theta, h) = (at.model, at.theta, at.stage.h);
    let (group, element) = (&model.element_groups[id.group], &model.elements[id.element]);
    let along_at = |q: &[f64], param: Option<usize>| {
        let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
        nearest_with(model, id, q, seeded)
    };
    let along = |param| along_at(at.q, param);
    // where its target follows the gap at the beginning
    let gap_at_start = |param| {
        let by = record.recovers.then(|| along_at(&at.stage.start.q_ref, Some(param))).flatten();
        by.map_or(0.0, |by| by.gap.eps)
    };
    // changes of the impulses on free nodes, and of F
    let mut emit = |param: usize, by: &dyn Fn(usize) -> Vec3<f64>, df: Vector4<f64>| {
        for (i, &node) in element.corners().iter().enumerate().filter(|(_, node)| !model.prescribed[**node]) {
            let change = by(i) / h;
            (0..3).for_each(|a| visit(3 * node + a, Input::Theta(param), -change[a]));
        }
        (0..4).for_each(|a| visit(record.block.row + a, Input::Theta(param), df[a]));
    };
    let Some(found) = along(None) else { return };
    let (n, weights) = (found.normal.map(|x| x.re), found.weights.map(|w| w.re));
    let (v, w) = (of_nodes(element, &at.stage.v), &record.w);
    let (u, push) = (weighted(&weights, &v), impulse(n, group.friction.value(theta), w));
    let across = Vec3::new(w[1], w[2], w[3]);
    for (param, share) in group.friction.entries().into_iter().flatten() {
        emit(param, &|i| across * (weights[i] * share), record.f_mu * share);
    }
    let mut params: Vec<usize> = model.colliders[group.collider].params().chain([element.radius]).collect();
    params.sort_unstable();
    params.dedup();
    for param in params {
        let Some(by) = along(Some(param)) else { continue };
        let (dn, dweights) = (by.normal.map(|x| x.eps), by.weights.map(|w| w.eps));
        let du_t = tangential(&n, &weighted(&dweights, &v)) - dn * n.dot(&u) - n * dn.dot(&u);
        let df = record.f_vn * ((by.gap.eps - gap_at_start(param)) / h) + record.f_vt * du_t;
        emit(param, &|i| push * dweights[i] + dn * (weights[i] * w[0]), df);
    }
}
