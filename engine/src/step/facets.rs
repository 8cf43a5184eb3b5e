//! Contacts of edges and triangles with fixed shapes: found where a stage begins, condensed into forces on their two or three nodes. They
//! are spots ([`super::spots`]) that move no body.

use super::spots::{RHO, SpotWorkspace, reach};
use super::{Stage, StepError, Workspace};
use crate::contact::{
    Facet, FacetLinear, SpotKey, SpotLaw, SpotLinear, SpotState, facet_changes, facet_law, impulse, pose_of_world, tangential,
    weighted,
};
use crate::geometry::facet::{Candidates, Nearest, candidates, nearest};
use crate::geometry::solid::{Carrier, Feature, Posed};
use crate::model::Model;
use crate::terms::Vec3;
use nalgebra::{Matrix3, Vector4};

/// Blocks of ∂f/∂q̄ and ∂f/∂v̄ before contacts were added, and of K by what rods' axes carry.
pub(crate) type Blocks = [[[f64; 3]; 3]; 3];

/// Which contact of a facet a spot is.
#[derive(Clone, Copy)]
pub(super) struct FacetSpot {
    pub group: usize,
    pub facet: usize,
    pub feature: Feature,
}

impl SpotKey {
    /// The facet's contact that it is, if any.
    pub(super) fn facet(&self) -> Option<FacetSpot> {
        match *self {
            Self::Facet { group, facet, feature } => Some(FacetSpot { group, facet, feature }),
            _ => None,
        }
    }
}

/// Three numbers each of a facet's nodes.
pub(super) fn of_nodes(facet: &Facet, x: &[f64]) -> [Vec3<f64>; 3] {
    facet.nodes.map(|node| Vec3::new(x[3 * node], x[3 * node + 1], x[3 * node + 2]))
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]])
}

impl Stage<'_> {
    /// Adds the contacts of facets to the spots of the stage, and makes room for their blocks.
    pub(super) fn find_facets(&self, part: &mut SpotWorkspace, blocks: &mut Vec<([usize; 2], Blocks)>) {
        blocks.clear();
        part.fixed.clear();
        let world = pose_of_world(&Vec3::zeros());
        let shape = |solid: usize| self.model.solids[solid].posed(&world, |k| self.theta[k]);
        part.fixed.extend(self.model.facet_groups.iter().map(|group| shape(group.solid)));
        let mut found = std::mem::take(&mut part.features);
        for (k, group) in self.model.facet_groups.iter().enumerate() {
            for index in group.facets.clone() {
                found.clear();
                self.list_features(&self.model.facets[index], &part.fixed[k], &mut found);
                for &feature in &found {
                    let key = SpotKey::Facet { group: k, facet: index, feature };
                    self.push_facet(key, &part.fixed[k], &mut part.spots);
                }
                if !found.is_empty() {
                    self.push_blocks(&self.model.facets[index], blocks);
                }
            }
        }
        part.features = found;
        blocks.sort_unstable_by_key(|(nodes, _)| *nodes);
        blocks.dedup_by_key(|(nodes, _)| *nodes);
    }

    /// What a facet may touch of a shape within the stage.
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
        let margin = reach(self.rest_gap) + 1.5 * self.h * speed + 4.0 * g * self.h * self.h;
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

    fn push_facet(&self, key: SpotKey, shape: &Posed<f64>, spots: &mut Vec<SpotState>) {
        let Some(FacetSpot { group, facet, feature }) = key.facet() else { return };
        let facet = &self.model.facets[facet];
        let solid = self.model.facet_groups[group].solid;
        let free = facet.nodes[..facet.count].iter().filter(|node| !self.model.driven[**node]);
        // wherever the point is, no node is lighter than this
        let rho = RHO * free.fold(f64::INFINITY, |m, node| m.min(self.mass[*node]));
        let x = of_nodes(facet, self.q_ref);
        let gap = nearest(&x[..facet.count], self.theta[facet.radius], feature, shape).map_or(0.0, |found| found.gap);
        spots.push(SpotState { key, carriers: [Carrier::World; 2], solids: [solid; 2], rho_n: rho, rho_t: rho, gap });
    }

    fn push_blocks(&self, facet: &Facet, blocks: &mut Vec<([usize; 2], Blocks)>) {
        let nodes = &facet.nodes[..facet.count];
        for &i in nodes.iter().filter(|i| !self.model.driven[**i]) {
            blocks.extend(nodes.iter().filter(|j| **j != i).map(|&j| ([i, j], Blocks::default())));
        }
    }

    /// The law's numbers at a facet's contact.
    pub(super) fn facet_law(&self, at: FacetSpot, spot: &SpotState) -> SpotLaw {
        let (group, facet) = (&self.model.facet_groups[at.group], &self.model.facets[at.facet]);
        facet_law(self.model.contact.law, group, facet, spot, self.theta, self.rest_gap, self.soften)
    }

    fn no_normal_of_facet(&self, at: FacetSpot, distance: f64) -> StepError {
        let [first, second] = self.facet_names(at);
        StepError::NoNormal { step: 0, first, second, distance }
    }

    fn facet_names(&self, at: FacetSpot) -> [String; 2] {
        let solid = self.model.facet_groups[at.group].solid;
        [self.model.facet_name(at.facet), self.model.solids[solid].name.clone()]
    }

    /// F and the condensed forces of a facet's contact, with the matrices linearized before.
    pub(super) fn add_facet(
        &self,
        k: usize,
        at: FacetSpot,
        w: &Vector4<f64>,
        v: &[f64],
        ws: &mut Workspace,
    ) -> Result<(), StepError> {
        let (facet, spot) = (&self.model.facets[at.facet], ws.spots.spots[k]);
        let x = of_nodes(facet, &ws.q_bar);
        let found = nearest(&x[..facet.count], self.theta[facet.radius], at.feature, &ws.spots.fixed[at.group])
            .map_err(|distance| self.no_normal_of_facet(at, distance))?;
        let law = self.facet_law(at, &spot);
        let u_t = tangential(&found.normal, &weighted(&found.weights, &of_nodes(facet, v)));
        let f = law.residual(found.gap / self.h, &u_t, w);
        ws.spots.f[k] = f;
        let w = w - ws.spots.linear[k].inverse * f;
        self.push_nodes(facet, &found, impulse(found.normal, law.at.mu, &w), ws);
        Ok(())
    }

    /// The impulse at the nearest point as forces on the facet's nodes.
    fn push_nodes(&self, facet: &Facet, found: &Nearest<f64>, impulse: Vec3<f64>, ws: &mut Workspace) {
        for (&node, weight) in facet.nodes[..facet.count].iter().zip(found.weights) {
            (0..3).for_each(|a| ws.f[3 * node + a] += weight * impulse[a] / self.h);
        }
    }

    /// As [`Stage::add_facet`], linearizing: into `ws.spots.facets` and the blocks of `ws.dq`, `ws.dv`. Returns the law and the rounding
    /// of w.
    pub(super) fn linearize_facet(
        &self,
        k: usize,
        at: FacetSpot,
        w: &Vector4<f64>,
        v: &[f64],
        ws: &mut Workspace,
    ) -> Result<(SpotLinear, f64), StepError> {
        let (facet, spot) = (&self.model.facets[at.facet], ws.spots.spots[k]);
        let (x, v) = (of_nodes(facet, &ws.q_bar), of_nodes(facet, v));
        let changes = facet_changes(&x, facet.count, self.theta[facet.radius], at.feature, &ws.spots.fixed[at.group])
            .map_err(|distance| self.no_normal_of_facet(at, distance))?;
        let (found, law) = (changes.nearest, self.facet_law(at, &spot));
        let u_t = tangential(&found.normal, &weighted(&found.weights, &v));
        let lin = law.linearize(found.gap / self.h, &u_t, w);
        if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
            let [first, second] = self.facet_names(at);
            return Err(StepError::ContactNotFinite { step: 0, first, second, value: w.norm() });
        }
        let linear = FacetLinear::new(&lin, &changes, law.at.mu, &v, self.h, w);
        for (i, &row) in facet.nodes[..facet.count].iter().enumerate() {
            for (j, &column) in facet.nodes[..facet.count].iter().enumerate() {
                let [by_x, by_v] = linear.condensed(i, j);
                ws.dq.nodes.add_block(row, column, 1.0 / self.h, &rows(&by_x));
                ws.dv.nodes.add_block(row, column, 1.0 / self.h, &rows(&by_v));
            }
        }
        let law_alone = SpotLinear::of_law(&lin);
        let rounding = law_alone.rounding(w, &law, &u_t);
        let settled = w - lin.df_dw_inverse * lin.f;
        self.push_nodes(facet, &found, impulse(found.normal, law.at.mu, &settled), ws);
        ws.spots.facets.push(linear);
        Ok((law_alone, rounding))
    }

    /// Changes of the facets' w that go with the change `d` of velocities, completing those for still nodes.
    pub(super) fn facet_steps(&self, d: &[f64], ws: &Workspace, dw: &mut [Vector4<f64>]) {
        let spots = ws.spots.first_facet()..;
        let each =
            ws.spots.spots[spots.clone()].iter().zip(&ws.spots.linear[spots.clone()]).zip(&ws.spots.facets).zip(&mut dw[spots]);
        for (((spot, law), linear), dw) in each {
            let Some(at) = spot.key.facet() else { continue };
            let facet = &self.model.facets[at.facet];
            let d = of_nodes(facet, d);
            let moved = (0..facet.count).map(|j| (linear.f_x[j] * (self.h * self.scheme.free.a1) + linear.f_v[j]) * d[j]);
            *dw -= law.inverse * moved.sum::<Vector4<f64>>();
        }
    }

    /// Adds what facets' contacts do at fixed w to ∂f/∂q̄ and A, whose blocks are those without contacts.
    pub(super) fn facets_at_fixed_impulses(&self, ws: &Workspace, dq: &mut crate::kkt::System, a: &mut crate::kkt::System) {
        let cq = self.h * self.scheme.free.a1;
        for (spot, linear) in ws.spots.spots[ws.spots.first_facet()..].iter().zip(&ws.spots.facets) {
            let Some(at) = spot.key.facet() else { continue };
            let facet = &self.model.facets[at.facet];
            let nodes = &facet.nodes[..facet.count];
            for (i, &row) in nodes.iter().enumerate().filter(|(_, node)| !self.model.driven[**node]) {
                for (j, &column) in nodes.iter().enumerate() {
                    let block = rows(&linear.fixed[i][j]);
                    dq.nodes.add_block(row, column, 1.0 / self.h, &block);
                    a.nodes.add_block(row, column, -cq / self.h, &block);
                }
            }
        }
    }
}

impl SpotWorkspace {
    /// Where the contacts of facets begin among the spots.
    pub(super) fn first_facet(&self) -> usize {
        self.spots.iter().position(|s| s.key.facet().is_some()).unwrap_or(self.spots.len())
    }
}

impl Posed<f64> {
    /// A lower bound of the distance from a point to the solid \[m\], for balls, capsules and blocks.
    fn distance_bound(&self, x: &Vec3<f64>) -> f64 {
        use crate::geometry::solid::Form;
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
