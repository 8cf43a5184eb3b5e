//! Features of a collider that may touch.

use super::ColliderShape;

/// A feature of a solid, in its own frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Feature {
    /// The whole solid, where distance to it has one closed form per region: ball, capsule, block, polyhedron, cylinder.
    Whole,
    /// An end of a capsule's axis: a ball of its radius. −1 or 1 along z.
    End(i8),
    /// A corner of a polyhedron. Of a block: four for a positive side along x, two along y and one along z.
    Corner(u16),
    /// A face of a polyhedron. Of a block, of the flat ends of a cylinder (axis 2) and of a half space (its surface, axis 2): two for each
    /// axis before its own, and one for the positive side.
    Face(u16),
    /// The infinite line of an edge of a polyhedron. Of a block: four for each axis before its direction, two for a positive side along the
    /// next axis and one along the one after.
    Edge(u16),
    /// The infinite line of the axis of a capsule or a cylinder, thick by its radius.
    Axis,
    /// The circle round a flat end of a cylinder, −1 or 1 along z.
    Rim(i8),
    /// One of eight points of that circle, fixed in the solid.
    RimPoint(i8, u8),
    /// The half of that circle towards which the line that it meets (an edge or axis) points, 1, or from which it comes, −1.
    RimHalf(i8, i8),
    /// The place where that circle crosses another rim, by the part of the circle that it is in when a step begins.
    RimSector(i8, u8),
    /// The round side of a cylinder, endless along its axis.
    Side,
}

/// −1 or 1 by bit `k` of a number.
fn side(number: u16, k: u16) -> f64 {
    if number >> k & 1 == 1 { 1.0 } else { -1.0 }
}

impl Feature {
    /// The corner of a block on these sides, −1 or 1.
    pub const fn corner([x, y, z]: [i8; 3]) -> Self {
        Self::Corner(4 * (x > 0) as u16 + 2 * (y > 0) as u16 + (z > 0) as u16)
    }

    /// The edge of a block along an axis, on these sides along the next axis and the one after.
    pub const fn edge(axis: u8, [next, after]: [i8; 2]) -> Self {
        Self::Edge(4 * axis as u16 + 2 * (next > 0) as u16 + (after > 0) as u16)
    }

    /// The face of a block, of a cylinder's end or of a half space, by axis and side.
    pub const fn face(axis: u8, side: i8) -> Self {
        Self::Face(2 * axis as u16 + (side > 0) as u16)
    }
}

/// The surface of a half space, and the upper end of a cylinder.
pub const TOP: u16 = 5;
/// Numbers of corners, edges and faces of a block.
pub(crate) const BLOCK: [u16; 3] = [8, 12, 6];

/// Sides of a block's corner.
pub(crate) fn corner_sides(corner: u16) -> [f64; 3] {
    [side(corner, 2), side(corner, 1), side(corner, 0)]
}

/// The axis of a block's edge, and its sides along the next axis and the one after.
pub(crate) fn edge_sides(edge: u16) -> (usize, [f64; 2]) {
    (usize::from(edge / 4), [side(edge, 1), side(edge, 0)])
}

/// Axis and side of a block's face.
pub(crate) fn face_side(face: u16) -> (usize, f64) {
    (usize::from(face / 2), side(face, 0))
}

/// Points that stand for a cylinder's rim on a face that it lies on flat, where its deepest point is not one.
pub const RIM_POINTS: u8 = 8;

/// Two features that may meet. The normal points from the second solid to the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FeaturePair {
    /// Of the first solid: something that can be thought of as a point or a line.
    pub first: Feature,
    /// Of the second solid.
    pub second: Feature,
}

/// The two sides of a solid along an axis.
pub(crate) const SIDES: [i8; 2] = [-1, 1];

impl ColliderShape {
    /// Numbers of corners, edges and faces of a polyhedron.
    pub(super) fn counts(&self) -> [u16; 3] {
        match self {
            Self::Block => BLOCK,
            Self::Hull(p) => [p.corners.len(), p.edges.len(), p.faces.len()].map(|n| n as u16),
            _ => [0; 3],
        }
    }

    /// How many points it can touch with.
    pub(super) fn n_points(&self) -> usize {
        match self {
            Self::HalfSpace => 0,
            Self::Ball => 1,
            Self::Capsule => 2,
            Self::Cylinder => 2 * usize::from(RIM_POINTS),
            Self::Block | Self::Hull(_) => usize::from(self.counts()[0]),
        }
    }

    /// The `k`-th of them.
    pub(super) fn point(&self, k: usize) -> Feature {
        let rim = usize::from(RIM_POINTS);
        match self {
            Self::HalfSpace | Self::Ball => Feature::Whole,
            Self::Capsule => Feature::End(SIDES[k]),
            Self::Cylinder => Feature::RimPoint(SIDES[k / rim], (k % rim) as u8),
            Self::Block | Self::Hull(_) => Feature::Corner(k as u16),
        }
    }
}
