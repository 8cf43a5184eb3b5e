//! Points, lines and faces of a solid in the world.

use super::features::{RIM_POINTS, corner_sides, edge_sides, face_side};
use super::{ColliderShape, Feature, PlacedCollider};
use pliant_math::{Real, Vec3};
use std::f64::consts::TAU;

impl<S: Real> PlacedCollider<S> {
    /// Axis `k`, a unit vector.
    pub(in crate::geometry) fn axis(&self, k: usize) -> Vec3<S> {
        self.rotation.column(k).into_owned()
    }

    /// A point of the solid's own frame.
    fn world(&self, y: &Vec3<f64>) -> Vec3<S> {
        self.position + self.rotation * y.map(S::from)
    }

    /// A point in the solid's own frame.
    pub(super) fn local(&self, x: &Vec3<S>) -> Vec3<S> {
        self.rotation.tr_mul(&(x - self.position))
    }

    /// Half the length along axis `k` of a block, or of a capsule's or cylinder's axis.
    fn half(&self, k: usize) -> S {
        match self.form {
            ColliderShape::Block => self.sizes[k],
            _ => self.sizes[1],
        }
    }

    /// Radius of the ball that a point feature is \[m\]: zero where it is sharp.
    pub(super) fn roundness(&self, feature: Feature) -> S {
        match (feature, &self.form) {
            (Feature::Whole, ColliderShape::Ball) | (Feature::End(_) | Feature::Axis, _) => self.sizes[0],
            _ => S::from(0.0),
        }
    }

    /// Where a point feature is.
    pub(in crate::geometry) fn point(&self, feature: Feature) -> Vec3<S> {
        match feature {
            Feature::End(side) => self.position + self.axis(2) * (self.sizes[1] * f64::from(side)),
            Feature::Corner(corner) => match &self.form {
                ColliderShape::Hull(p) => self.world(&p.corners[usize::from(corner)]),
                _ => {
                    let sides = corner_sides(corner);
                    let along = |k: usize| self.axis(k) * (self.sizes[k] * sides[k]);
                    self.position + along(0) + along(1) + along(2)
                }
            },
            Feature::RimPoint(side, k) => {
                let angle = TAU * f64::from(k) / f64::from(RIM_POINTS);
                let across = self.axis(0) * S::from(angle.cos()) + self.axis(1) * S::from(angle.sin());
                self.position + self.axis(2) * (self.sizes[1] * f64::from(side)) + across * self.sizes[0]
            }
            _ => self.position,
        }
    }

    /// A point of a line feature and its unit direction.
    pub(in crate::geometry) fn line(&self, feature: Feature) -> (Vec3<S>, Vec3<S>) {
        let Feature::Edge(edge) = feature else { return (self.position, self.axis(2)) };
        if let ColliderShape::Hull(p) = &self.form {
            let edge = &p.edges[usize::from(edge)];
            return (self.world(&edge.middle), self.rotation * edge.direction.map(S::from));
        }
        let (k, sides) = edge_sides(edge);
        let along = |next: usize, side: f64| self.axis((k + next) % 3) * (self.sizes[(k + next) % 3] * side);
        (self.position + along(1, sides[0]) + along(2, sides[1]), self.axis(k))
    }

    /// Half the length of a line feature.
    pub(in crate::geometry) fn half_length(&self, feature: Feature) -> S {
        match (feature, &self.form) {
            (Feature::Edge(edge), ColliderShape::Hull(p)) => S::from(p.edges[usize::from(edge)].half_length),
            (Feature::Edge(edge), _) => self.half(edge_sides(edge).0),
            _ => self.half(2),
        }
    }

    /// The sum of the outward normals of the faces that meet at an edge or corner of a block.
    pub(in crate::geometry) fn outward(&self, feature: Feature) -> Vec3<S> {
        let along = |k: usize, side: f64| self.axis(k % 3) * S::from(side);
        match feature {
            Feature::Edge(edge) => {
                let (k, sides) = edge_sides(edge);
                along(k + 1, sides[0]) + along(k + 2, sides[1])
            }
            Feature::Corner(corner) => {
                let sides = corner_sides(corner);
                along(0, sides[0]) + along(1, sides[1]) + along(2, sides[2])
            }
            _ => Vec3::repeat(S::from(0.0)),
        }
    }

    /// A point of a flat feature and its outward normal.
    pub(super) fn face(&self, face: u16) -> (Vec3<S>, Vec3<S>) {
        if let ColliderShape::Hull(p) = &self.form {
            let face = &p.faces[usize::from(face)];
            return (self.world(&face.point), self.rotation * face.normal.map(S::from));
        }
        let (k, side) = face_side(face);
        let normal = self.axis(k) * S::from(side);
        match self.form {
            ColliderShape::HalfSpace => (self.position, normal),
            _ => (self.position + normal * self.half(k), normal),
        }
    }
}

impl PlacedCollider<f64> {
    /// Of each face at an edge of a polyhedron the outward unit normal within the face: of a block that of the other face.
    pub(super) fn conormals(&self, edge: u16) -> [Vec3<f64>; 2] {
        if let ColliderShape::Hull(p) = &self.form {
            return p.edges[usize::from(edge)].conormals.map(|across| self.rotation * across);
        }
        let (k, sides) = edge_sides(edge);
        [0, 1].map(|i| self.axis((k + 1 + i) % 3) * sides[i])
    }
}
