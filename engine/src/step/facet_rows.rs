//! Contacts of facets in a record: their degrees of freedom are those of their nodes, of which held ones move the contact but do not feel
//! it. See [`super::spot_rows`].

use super::facets::{FacetSpot, of_nodes};
use super::spot_rows::{SLIP, SpotDof, SpotRecord};
use super::{Stage, StageRecord};
use crate::contact::{Facet, FacetLinear, facet_law, impulse, pose_of_world, tangential, weighted};
use crate::geometry::facet::{Nearest, Region, nearest};
use crate::kinematics::Input;
use crate::model::Model;
use crate::terms::Vec3;
use nalgebra::Vector4;
use num_dual::Dual64;

impl Stage<'_> {
    /// The rows of a facet's contact.
    pub(super) fn facet_dofs(&self, at: FacetSpot, linear: &FacetLinear) -> Vec<SpotDof> {
        let facet = &self.model.facets[at.facet];
        let mut out = Vec::with_capacity(3 * facet.count);
        for (j, &node) in facet.nodes[..facet.count].iter().enumerate() {
            let felt = if self.model.driven[node] { 0.0 } else { linear.weights[j] };
            let slope = linear.f_x[j] * (self.h * self.scheme.free.a1) + linear.f_v[j];
            out.extend((0..3).map(|a| SpotDof {
                v: 3 * node + a,
                impulse: linear.by_w.row(a).transpose() * felt,
                by_q: linear.f_x[j].column(a).into_owned(),
                slope: slope.column(a).into_owned(),
            }));
        }
        out
    }
}

/// The nearest point of a facet at positions `q` for entries of θ as `theta` has them.
fn nearest_with(model: &Model, at: FacetSpot, q: &[f64], theta: impl Fn(usize) -> Dual64) -> Option<Nearest<Dual64>> {
    let facet = &model.facets[at.facet];
    let x = of_nodes(facet, q).map(|x| x.map(Dual64::from_re));
    let world = pose_of_world(&Vec3::zeros());
    let pose = crate::geometry::solid::Pose {
        rotation: world.rotation.map(Dual64::from_re),
        position: world.position.map(Dual64::from_re),
    };
    let shape = model.solids[model.facet_groups[at.group].solid].posed(&pose, &theta);
    nearest(&x[..facet.count], theta(facet.radius), at.feature, &shape).ok()
}

impl StageRecord {
    /// Which contact of a facet it is: numbers that tell it apart, 0 separate, 1 stick or 2 slip, and what of the facet is nearest.
    pub(super) fn facet_mode(&self, spot: &SpotRecord, at: FacetSpot, model: &Model, theta: &[f64]) -> Vec<u8> {
        let (group, facet) = (&model.facet_groups[at.group], &model.facets[at.facet]);
        let law = facet_law(model.contact.law, group, facet, &spot.state, theta, self.rest_gap, 0.0);
        let open = spot.w[0] < (law.at.kappa * law.at.rho_n).sqrt();
        let load = spot.w.fixed_rows::<3>(1).norm() / spot.w[0];
        let mode = if open { 0 } else { 1 + u8::from(load > SLIP) };
        let (q, _) = self.evaluation_point(model);
        let region = nearest_with(model, at, &q, |k| Dual64::from_re(theta[k])).map_or(0, |found| match found.region {
            Region::Inside => 1,
            Region::Side(k) => 2 + k,
            Region::Node(k) => 5 + k,
        });
        // far from touching, nothing hangs on it
        let region = if mode == 0 { 0 } else { region };
        [spot.state.key.fold().to_le_bytes().to_vec(), vec![mode, region]].concat()
    }

    /// ∂(r, F)/∂θ of a facet's contact, whose rows of w begin at `row`: friction, the facet's radius, and what places and sizes the shape.
    pub(super) fn visit_facet(
        &self,
        (spot, row): (&SpotRecord, usize),
        at: FacetSpot,
        model: &Model,
        theta: &[f64],
        q: &[f64],
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        let (group, facet) = (&model.facet_groups[at.group], &model.facets[at.facet]);
        let along = |param: Option<usize>| {
            let seeded = |k: usize| Dual64::new(theta[k], if Some(k) == param { 1.0 } else { 0.0 });
            nearest_with(model, at, q, seeded)
        };
        let Some(found) = along(None) else { return };
        let (n, weights) = (found.normal.map(|x| x.re), found.weights.map(|w| w.re));
        let v = of_nodes(facet, &self.v);
        let (u, push) = (weighted(&weights, &v), impulse(n, group.friction.value(theta), &spot.w));
        let across = Vec3::new(spot.w[1], spot.w[2], spot.w[3]);
        for (param, share) in group.friction.entries().into_iter().flatten() {
            self.emit(facet, model, row, |i| across * (weights[i] * share), spot.f_mu * share, param, visit);
        }
        let mut params: Vec<usize> = model.solids[group.solid].params().chain([facet.radius]).collect();
        params.sort_unstable();
        params.dedup();
        for param in params {
            let Some(by) = along(Some(param)) else { continue };
            let (dn, dweights) = (by.normal.map(|x| x.eps), by.weights.map(|w| w.eps));
            let du_t = tangential(&n, &weighted(&dweights, &v)) - dn * n.dot(&u) - n * dn.dot(&u);
            let df = spot.f_vn * (by.gap.eps / self.h) + spot.f_vt * du_t;
            let forces = |i: usize| push * dweights[i] + dn * (weights[i] * spot.w[0]);
            self.emit(facet, model, row, forces, df, param, visit);
        }
    }

    /// Visits the changes `by(i)` of the impulses on free nodes i and `df` of F with a parameter.
    #[allow(clippy::too_many_arguments)] // where it goes, and what
    fn emit(
        &self,
        facet: &Facet,
        model: &Model,
        row: usize,
        by: impl Fn(usize) -> Vec3<f64>,
        df: Vector4<f64>,
        param: usize,
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        for (i, &node) in facet.nodes[..facet.count].iter().enumerate().filter(|(_, node)| !model.driven[**node]) {
            let change = by(i) / self.h;
            (0..3).for_each(|a| visit(3 * node + a, Input::Theta(param), -change[a]));
        }
        (0..4).for_each(|a| visit(row + a, Input::Theta(param), df[a]));
    }
}
