//! Contact of edges and triangles with fixed shapes in a stage: listed where the stage begins, condensed into forces on two or three
//! nodes.

use super::body_contact::cones_settled;
use super::{
    Beginning, Block, Change, ConeRecord, ConstraintId, ConstraintRecords, ConstraintSet, DofPartial, EdgeId, Evaluation,
    InputsAt, Loads, RecordAt, Slopes, WarmImpulses, cone, reach,
};
use crate::constraints::{
    ConeLinear, Facet, FacetLinear, RHO, SplitLaw, facet_changes, facet_law, impulse, of_nodes, pose_of_world, rounding,
    tangential, weighted,
};
use crate::geometry::facet::{Candidates, Nearest, Region, candidates, nearest};
use crate::geometry::solid::{Carrier, Feature, Form, Pose, Posed};
use crate::model::Model;
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
    /// The law alone, and with what it is evaluated at.
    pub law: ConeLinear,
    pub linear: Option<FacetLinear>,
    /// Rounding of w [N·s].
    pub rounding: f64,
}

/// Contacts of edges and triangles in a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct EdgeContacts {
    pub contacts: Vec<EdgeContact>,
    /// The shapes that groups may touch, in the world.
    pub fixed: Vec<Posed<f64>>,
    features: Vec<Feature>,
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]])
}

impl Stage<'_> {
    /// Features of a shape that an edge or triangle may touch within the stage.
    fn list_features(&self, facet: &Facet, shape: &Posed<f64>, found: &mut Vec<Feature>) {
        let (now, radius) = (of_nodes(facet, self.q_ref), self.theta[facet.radius]);
        let velocity = |node: usize| {
            let from = if self.model.driven[node] { self.v_cmd } else { self.v_ref };
            Vec3::new(from[3 * node], from[3 * node + 1], from[3 * node + 2])
        };
        let at = |node: usize| Vec3::new(self.q_ref[3 * node], self.q_ref[3 * node + 1], self.q_ref[3 * node + 2]);
        let v = facet.nodes.map(velocity);
        let speed = v.iter().fold(0.0_f64, |a, v| a.max(v.norm()));
        let g = self.theta[self.model.gravity].abs();
        let margin = reach(self.options.rest_gap) + 1.5 * self.h * speed + 4.0 * g * self.h * self.h;
        let n = facet.count;
        let middle = now[..n].iter().sum::<Vec3<f64>>() / n as f64;
        let size = now[..n].iter().fold(0.0_f64, |a, x| a.max((x - middle).norm()));
        if shape.distance_bound(&middle) > margin + size + radius {
            return;
        }
        let next = std::array::from_fn::<_, 3, _>(|i| now[i] + v[i] * self.h);
        let thirds_next = facet.thirds.map(|t| t.map(|node| at(node) + velocity(node) * self.h));
        let now = Candidates { x: &now[..n], radius, sheet: facet.thirds.map(|t| t.map(at)), shape, margin };
        candidates(&now, &Candidates { x: &next[..n], sheet: thirds_next, ..now }, found);
    }

    /// The law's numbers at the contact of an edge or triangle.
    fn facet_law(&self, contact: &EdgeContact) -> SplitLaw {
        let of = (&self.model.facet_groups[contact.id.group], &self.model.facets[contact.id.facet]);
        facet_law(self.model.contact.law, of, contact.rho, self.theta, self.options.rest_gap, self.options.soften)
    }

    fn facet_names(&self, id: &EdgeId) -> [String; 2] {
        let solid = self.model.facet_groups[id.group].solid;
        [self.model.facet_name(id.facet), self.model.solids[solid].name.clone()]
    }

    fn no_normal_of_facet(&self, id: &EdgeId, distance: f64) -> StepError {
        let [first, second] = self.facet_names(id);
        StepError::NoNormal { step: 0, first, second, distance }
    }

    fn edge_contact(&self, id: EdgeId, shape: &Posed<f64>) -> EdgeContact {
        let facet = &self.model.facets[id.facet];
        let free = facet.corners().iter().filter(|node| !self.model.driven[**node]);
        // wherever the point is, no node is lighter than this
        let rho = RHO * free.fold(f64::INFINITY, |m, node| m.min(self.masses.nodes[*node]));
        let x = of_nodes(facet, self.q_ref);
        let gap = nearest(&x[..facet.count], self.theta[facet.radius], id.feature, shape).map_or(0.0, |found| found.gap);
        EdgeContact { id, rho, gap, law: ConeLinear::zero(), linear: None, rounding: 0.0 }
    }
}

impl ConstraintSet for EdgeContacts {
    fn find(&mut self, stage: &Stage, _at: &Beginning) {
        let model = stage.model;
        self.contacts.clear();
        self.fixed.clear();
        let world = pose_of_world(&Vec3::zeros());
        let shape = |solid: usize| model.solids[solid].posed(&world, |k| stage.theta[k]);
        self.fixed.extend(model.facet_groups.iter().map(|group| shape(group.solid)));
        for (k, (group, shape)) in model.facet_groups.iter().zip(&self.fixed).enumerate() {
            for index in group.facets.clone() {
                self.features.clear();
                stage.list_features(&model.facets[index], shape, &mut self.features);
                let id = |&feature: &Feature| EdgeId { group: k, facet: index, feature };
                self.contacts.extend(self.features.iter().map(id).map(|id| stage.edge_contact(id, shape)));
            }
        }
    }

    fn dim(&self) -> usize {
        4 * self.contacts.len()
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
            let (facet, w) = (&stage.model.facets[contact.id.facet], cone(lambda, k));
            let x = of_nodes(facet, at.q);
            let shape = &self.fixed[contact.id.group];
            let found = nearest(&x[..facet.count], stage.theta[facet.radius], contact.id.feature, shape)
                .map_err(|distance| stage.no_normal_of_facet(&contact.id, distance))?;
            let law = stage.facet_law(contact);
            let u_t = tangential(&found.normal, &weighted(&found.weights, &of_nodes(facet, at.v)));
            let f = law.residual(found.gap / stage.h, &u_t, &w);
            out[4 * k..4 * k + 4].copy_from_slice(f.as_slice());
            facet.push(&found, impulse(found.normal, law.at.mu, &(w - contact.law.inverse * f)), stage.h, loads.nodes);
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
            let (facet, w) = (&stage.model.facets[contact.id.facet], cone(lambda, k));
            let (x, v) = (of_nodes(facet, at.q), of_nodes(facet, at.v));
            let shape = &self.fixed[contact.id.group];
            let changes = facet_changes(&x, facet.count, stage.theta[facet.radius], contact.id.feature, shape)
                .map_err(|distance| stage.no_normal_of_facet(&contact.id, distance))?;
            let (found, law) = (changes.nearest, stage.facet_law(contact));
            let u_t = tangential(&found.normal, &weighted(&found.weights, &v));
            let lin = law.linearize(found.gap / stage.h, &u_t, &w);
            if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
                let [first, second] = stage.facet_names(&contact.id);
                return Err(StepError::ContactNotFinite { step: 0, first, second, value: w.norm() });
            }
            let linear = FacetLinear::new(&lin, &changes, law.at.mu, &v, stage.h, &w);
            for (i, &row) in facet.corners().iter().enumerate() {
                for (j, &column) in facet.corners().iter().enumerate() {
                    let [by_x, by_v] = linear.condensed(i, j);
                    slopes.dq.add_block(row, column, 1.0 / stage.h, &rows(&by_x));
                    slopes.dv.add_block(row, column, 1.0 / stage.h, &rows(&by_v));
                }
            }
            contact.law = ConeLinear::new(&lin);
            contact.rounding = rounding(&lin.df_dw_inverse, &w, &law, &u_t);
            contact.linear = Some(linear);
            out[4 * k..4 * k + 4].copy_from_slice(lin.f.as_slice());
            facet.push(&found, impulse(found.normal, law.at.mu, &(w - lin.df_dw_inverse * lin.f)), stage.h, loads.nodes);
        }
        Ok(())
    }

    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        for (k, contact) in self.contacts.iter().enumerate() {
            let facet = &stage.model.facets[contact.id.facet];
            let d_x = of_nodes(facet, change.d);
            let mut dw = -(contact.law.inverse * cone(residual, k));
            if let Some(linear) = &contact.linear {
                let moved = (0..facet.count).map(|j| linear.slope(j, stage.h * stage.scheme.free.a1) * d_x[j]);
                dw -= contact.law.inverse * moved.sum::<Vector4<f64>>();
            }
            d[4 * k..4 * k + 4].copy_from_slice(dw.as_slice());
        }
    }

    fn weights(&self, _stage: &Stage, out: &mut [f64]) {
        self.contacts.iter().zip(out.chunks_exact_mut(4)).for_each(|(contact, out)| out.fill(RHO / contact.rho));
    }

    fn start(&self, stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        for (contact, w) in self.contacts.iter().zip(lambda.chunks_exact_mut(4)) {
            let known = warm.and_then(|warm| warm.of(&ConstraintId::Edge(contact.id)));
            let start = known.unwrap_or_else(|| stage.facet_law(contact).central(contact.gap, stage.h));
            w.copy_from_slice(start.as_slice());
        }
    }

    fn start_soft(&self, stage: &Stage, lambda: &mut [f64]) {
        for (contact, w) in self.contacts.iter().zip(lambda.chunks_exact_mut(4)) {
            w.copy_from_slice(stage.facet_law(contact).middle().as_slice());
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
            let facet = &stage.model.facets[contact.id.facet];
            let dofs = facet.corners().iter().enumerate().flat_map(|(j, &node)| {
                let felt = if stage.model.driven[node] { 0.0 } else { linear.weights[j] };
                let slope = linear.slope(j, way);
                (0..3).map(move |a| DofPartial {
                    v: 3 * node + a,
                    impulse: linear.by_w.row(a).transpose() * felt,
                    by_q: linear.f_x[j].column(a).into_owned(),
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
                carriers: [Carrier::World; 2],
                solids: [0; 2],
                rho: [contact.rho; 2],
            });
        }
    }

    fn rounding2(&self, _stage: &Stage) -> f64 {
        self.contacts.iter().map(|contact| RHO * contact.rounding * contact.rounding / contact.rho).sum()
    }

    fn settled(&self, _stage: &Stage, lambda: &[f64], d: &[f64]) -> bool {
        cones_settled(lambda, d, self.contacts.iter().map(|contact| contact.rounding))
    }

    fn joined_nodes(&self, stage: &Stage, pairs: &mut Vec<[usize; 2]>) {
        for contact in &self.contacts {
            let nodes = stage.model.facets[contact.id.facet].corners();
            for &i in nodes.iter().filter(|i| !stage.model.driven[**i]) {
                pairs.extend(nodes.iter().filter(|j| **j != i).map(|&j| [i, j]));
            }
        }
    }

    fn add_fixed(&self, stage: &Stage, _lambda: &[f64], dq: &mut System, a: &mut System) {
        let cq = stage.h * stage.scheme.free.a1;
        for (contact, linear) in self.contacts.iter().filter_map(|contact| Some((contact, contact.linear.as_ref()?))) {
            let nodes = stage.model.facets[contact.id.facet].corners();
            for (i, &row) in nodes.iter().enumerate().filter(|(_, node)| !stage.model.driven[**node]) {
                for (j, &column) in nodes.iter().enumerate() {
                    let block = rows(&linear.fixed[i][j]);
                    dq.nodes.add_block(row, column, 1.0 / stage.h, &block);
                    a.nodes.add_block(row, column, -cq / stage.h, &block);
                }
            }
        }
    }
}

impl Posed<f64> {
    /// A lower bound of the distance from a point to the solid \[m\], for balls, capsules and blocks.
    fn distance_bound(&self, x: &Vec3<f64>) -> f64 {
        let y = self.rotation.tr_mul(&(x - self.position));
        match self.form {
            Form::Ball => (x - self.position).norm() - self.sizes[0],
            Form::Capsule => {
                let beyond = (y[2].abs() - self.sizes[1]).max(0.0);
                let across = ((x - self.position).norm_squared() - y[2] * y[2]).max(0.0);
                (across + beyond * beyond).sqrt() - self.sizes[0]
            }
            Form::Block => Vec3::from_fn(|k, _| (y[k].abs() - self.sizes[k]).max(0.0)).norm(),
            Form::HalfSpace | Form::Cylinder => f64::INFINITY,
        }
    }
}

impl Model {
    /// A facet by its nodes, for messages.
    pub(crate) fn facet_name(&self, facet: usize) -> String {
        let facet = &self.facets[facet];
        let first = facet.nodes[0];
        let span = self.node_spans().find(|(_, nodes)| nodes.contains(&first));
        let (name, start) = span.map_or(("", 0), |(name, nodes)| (name, nodes.start));
        match facet.nodes.map(|node| node - start) {
            [a, b, c] if facet.count == 3 => format!("{name}, triangle of nodes {a}, {b}, {c}"),
            [a, b, _] => format!("{name}, edge of nodes {a}, {b}"),
        }
    }
}

/// The nearest point of an edge or triangle at positions `q` for entries of θ as `theta` has them.
fn nearest_with(model: &Model, id: EdgeId, q: &[f64], theta: impl Fn(usize) -> Dual64) -> Option<Nearest<Dual64>> {
    let facet = &model.facets[id.facet];
    let x = of_nodes(facet, q).map(|x| x.map(Dual64::from_re));
    let world = pose_of_world(&Vec3::zeros());
    let pose = Pose { rotation: world.rotation.map(Dual64::from_re), position: world.position.map(Dual64::from_re) };
    let shape = model.solids[model.facet_groups[id.group].solid].posed(&pose, &theta);
    nearest(&x[..facet.count], theta(facet.radius), id.feature, &shape).ok()
}

/// Numbers that tell the contact apart, 0 separate, 1 stick or 2 slip, and which part of the edge or triangle is nearest.
pub(super) fn mode(record: &ConeRecord, id: EdgeId, at: &InputsAt) -> Vec<u8> {
    let of = (&at.model.facet_groups[id.group], &at.model.facets[id.facet]);
    let law = facet_law(at.model.contact.law, of, record.rho[0], at.theta, at.stage.rest_gap, 0.0);
    let phase = record.phase((law.at.kappa * law.at.rho_n).sqrt());
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
    let (group, facet) = (&model.facet_groups[id.group], &model.facets[id.facet]);
    let along = |param: Option<usize>| {
        let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
        nearest_with(model, id, at.q, seeded)
    };
    // changes of the impulses on free nodes, and of F
    let mut emit = |param: usize, by: &dyn Fn(usize) -> Vec3<f64>, df: Vector4<f64>| {
        for (i, &node) in facet.corners().iter().enumerate().filter(|(_, node)| !model.driven[**node]) {
            let change = by(i) / h;
            (0..3).for_each(|a| visit(3 * node + a, Input::Theta(param), -change[a]));
        }
        (0..4).for_each(|a| visit(record.block.row + a, Input::Theta(param), df[a]));
    };
    let Some(found) = along(None) else { return };
    let (n, weights) = (found.normal.map(|x| x.re), found.weights.map(|w| w.re));
    let (v, w) = (of_nodes(facet, &at.stage.v), &record.w);
    let (u, push) = (weighted(&weights, &v), impulse(n, group.friction.value(theta), w));
    let across = Vec3::new(w[1], w[2], w[3]);
    for (param, share) in group.friction.entries().into_iter().flatten() {
        emit(param, &|i| across * (weights[i] * share), record.f_mu * share);
    }
    let mut params: Vec<usize> = model.solids[group.solid].params().chain([facet.radius]).collect();
    params.sort_unstable();
    params.dedup();
    for param in params {
        let Some(by) = along(Some(param)) else { continue };
        let (dn, dweights) = (by.normal.map(|x| x.eps), by.weights.map(|w| w.eps));
        let du_t = tangential(&n, &weighted(&dweights, &v)) - dn * n.dot(&u) - n * dn.dot(&u);
        let df = record.f_vn * (by.gap.eps / h) + record.f_vt * du_t;
        emit(param, &|i| push * dweights[i] + dn * (weights[i] * w[0]), df);
    }
}
