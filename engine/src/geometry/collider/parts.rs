//! Points, lines and faces of a solid in the world.

use super::features::RIM_POINTS;
use super::{ColliderShape, Feature, PlacedCollider};
use pliant_math::{Real, Vec3};
use std::f64::consts::TAU;

impl<S: Real> PlacedCollider<S> {
    /// Axis `k`, a unit vector.
    pub(in crate::geometry) fn axis(&self, k: usize) -> Vec3<S> {
        self.rotation.column(k).into_owned()
    }

    /// A vector in the solid's axes.
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
        match (feature, self.form) {
            (Feature::Whole, ColliderShape::Ball) | (Feature::End(_) | Feature::Axis, _) => self.sizes[0],
            _ => S::from(0.0),
        }
    }

    /// Where a point feature is.
    pub(in crate::geometry) fn point(&self, feature: Feature) -> Vec3<S> {
        match feature {
            Feature::End(side) => self.position + self.axis(2) * (self.sizes[1] * f64::from(side)),
            Feature::Corner(sides) => {
                let along = |k: usize| self.axis(k) * (self.sizes[k] * f64::from(sides[k]));
                self.position + along(0) + along(1) + along(2)
            }
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
        let Feature::Edge(k, sides) = feature else { return (self.position, self.axis(2)) };
        let k = usize::from(k);
        let along = |next: usize, side: i8| self.axis((k + next) % 3) * (self.sizes[(k + next) % 3] * f64::from(side));
        (self.position + along(1, sides[0]) + along(2, sides[1]), self.axis(k))
    }

    /// Half the length of a line feature.
    pub(in crate::geometry) fn half_length(&self, feature: Feature) -> S {
        match feature {
            Feature::Edge(k, _) => self.half(usize::from(k)),
            _ => self.half(2),
        }
    }

    /// The sum of the outward normals of the faces that meet at an edge or corner of a block.
    pub(in crate::geometry) fn outward(&self, feature: Feature) -> Vec3<S> {
        let along = |k: usize, side: i8| self.axis(k % 3) * S::from(f64::from(side));
        match feature {
            Feature::Edge(k, sides) => along(usize::from(k) + 1, sides[0]) + along(usize::from(k) + 2, sides[1]),
            Feature::Corner(sides) => along(0, sides[0]) + along(1, sides[1]) + along(2, sides[2]),
            _ => Vec3::repeat(S::from(0.0)),
        }
    }

    /// A point of a flat feature and its outward normal.
    pub(super) fn face(&self, k: u8, side: i8) -> (Vec3<S>, Vec3<S>) {
        let normal = self.axis(usize::from(k)) * S::from(f64::from(side));
        match self.form {
            ColliderShape::HalfSpace => (self.position, normal),
            _ => (self.position + normal * self.half(usize::from(k)), normal),
        }
    }
}
