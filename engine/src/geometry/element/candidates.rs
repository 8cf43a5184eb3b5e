//! Which features of a shape a contact element may touch in the coming step.
//!
//! Nodes touch by themselves, so an edge is listed where its inside is nearest to a feature, and a triangle where its inside is: where the
//! stage begins, or where the velocities there lead.

use super::nearest::{Nearest, Region, combine, nearest};
use crate::geometry::collider::{BLOCK, ColliderShape, Feature, PlacedCollider, SIDES, corner_sides, edge_sides};
use crate::geometry::constants::GEOMETRY;
use pliant_math::Vec3;

/// Third nodes of the triangles at a sheet's edge \[m\].
pub(crate) type Sheet = [Option<Vec3<f64>>; 2];

/// A contact element at one instant, and a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidates<'a> {
    /// Its nodes, two or three \[m\].
    pub x: &'a [Vec3<f64>],
    pub radius: f64,
    /// The triangles at an edge.
    pub sheet: Sheet,
    pub shape: &'a PlacedCollider<f64>,
    /// Features farther than this are left out \[m\].
    pub margin: f64,
}

fn corners() -> impl Iterator<Item = Feature> {
    (0..BLOCK[0]).map(Feature::Corner)
}

fn edges() -> impl Iterator<Item = Feature> {
    (0..BLOCK[1]).map(Feature::Edge)
}

/// Lists what the contact element may touch `now`, or where it will be `next`; both are the same contact element and shape.
pub(crate) fn candidates(now: &Candidates, next: &Candidates, found: &mut Vec<Feature>) {
    let mut list = |feature| {
        if now.meets(feature) || next.meets(feature) {
            found.push(feature);
        }
    };
    match (&now.shape.form, now.x.len()) {
        (ColliderShape::Ball, _) | (ColliderShape::Capsule, 2) => list(Feature::Whole),
        (ColliderShape::Capsule, _) => SIDES.map(Feature::End).into_iter().for_each(list),
        (ColliderShape::Block, 2) => edges().chain(corners()).for_each(list),
        (ColliderShape::Block, _) => corners().for_each(list),
        (ColliderShape::HalfSpace | ColliderShape::Cylinder | ColliderShape::Hull(_), _) => {}
    }
}

impl Candidates<'_> {
    fn meets(&self, feature: Feature) -> bool {
        let Ok(found) = nearest(self.x, self.radius, feature, self.shape) else { return false };
        let near = found.region == Region::Inside && found.gap <= self.margin;
        near && match (&self.shape.form, feature) {
            (ColliderShape::Ball, _) => self.over_no_triangle(&found),
            (ColliderShape::Capsule, Feature::Whole) => self.meets_capsule(&found),
            (ColliderShape::Block, Feature::Edge(..)) => self.crosses(feature, &found),
            (ColliderShape::Block, Feature::Corner(corner)) => {
                let sides = corner_sides(corner);
                let depth = self.shape.sizes.iter().copied().fold(f64::INFINITY, f64::min);
                let faces = |k: usize| sides[k] * self.shape.axis(k).dot(&found.normal) >= -GEOMETRY.lean;
                found.gap > -depth && (0..3).all(faces) && self.over_no_triangle(&found)
            }
            _ => true,
        }
    }

    /// Whether an edge's own normal does not lead over one of its triangles, whose inside is then nearer.
    fn over_no_triangle(&self, found: &Nearest<f64>) -> bool {
        let edge = self.x[1] - self.x[0];
        let leads_over = |third: &Vec3<f64>| {
            let inward = third - self.x[0];
            let inward = inward - edge * (inward.dot(&edge) / edge.norm_squared());
            inward.dot(&found.normal) < -GEOMETRY.lean * inward.norm()
        };
        !self.sheet.iter().flatten().any(leads_over)
    }

    fn meets_capsule(&self, found: &Nearest<f64>) -> bool {
        let axis = self.shape.axis(2);
        let t = (combine(&found.weights, self.x) - self.shape.position).dot(&axis);
        if t.abs() > self.shape.sizes[1] { self.over_no_triangle(found) } else { self.crossing(&axis) }
    }

    /// Whether the edge crosses a direction.
    fn crossing(&self, along: &Vec3<f64>) -> bool {
        let edge = self.x[1] - self.x[0];
        edge.cross(along).norm() >= GEOMETRY.parallel_edge * edge.norm()
    }

    /// Whether it crosses an edge of a block between the ends of that, not through the whole block, and with a normal between those of
    /// the two faces.
    fn crosses(&self, feature: Feature, found: &Nearest<f64>) -> bool {
        let Feature::Edge(edge) = feature else { return false };
        let (k, sides) = edge_sides(edge);
        let (at, along) = self.shape.line(feature);
        let t = (combine(&found.weights, self.x) - at).dot(&along);
        let depth = self.shape.sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let faces = |i: usize| {
            let axis = self.shape.axis((k + 1 + i) % 3);
            sides[i] * axis.dot(&found.normal) >= -GEOMETRY.lean
        };
        let within = t.abs() <= self.shape.half_length(feature) * (1.0 + GEOMETRY.sliver);
        within && found.gap > -depth && (0..2).all(faces) && self.crossing(&along)
    }
}
