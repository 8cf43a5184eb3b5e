//! Features of a collider that may touch.

use super::ColliderShape;

/// A feature of a solid, in its own frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Feature {
    /// The whole solid, where distance to it has one closed form per region: ball, capsule, block, cylinder.
    Whole,
    /// An end of a capsule's axis: a ball of its radius. −1 or 1 along z.
    End(i8),
    /// A corner of a block, −1 or 1 along each axis.
    Corner([i8; 3]),
    /// A face of a block or the flat end of a cylinder (axis 2): axis and side; of a half space its surface (axis 2, side 1).
    Face(u8, i8),
    /// The infinite line of an edge of a block: its direction, and its side along the next axis and the one after.
    Edge(u8, [i8; 2]),
    /// The infinite line of the axis of a capsule or a cylinder, thick by its radius.
    Axis,
    /// The circle round a flat end of a cylinder, −1 or 1 along z.
    Rim(i8),
    /// One of eight points of that circle, fixed in the solid.
    RimPoint(i8, u8),
    /// The round side of a cylinder, endless along its axis.
    Side,
}

/// Points that stand for a cylinder's rim where its deepest point does not do: on a flat end, and against round or sharp things.
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

const fn side(k: usize, bit: usize) -> i8 {
    SIDES[k / bit % 2]
}

/// Ends of a capsule.
pub(crate) const ENDS: [Feature; 2] = [Feature::End(-1), Feature::End(1)];

/// Corners of a block.
pub(crate) const CORNERS: [Feature; 8] = {
    let (mut out, mut k) = ([Feature::Whole; 8], 0);
    while k < out.len() {
        out[k] = Feature::Corner([side(k, 4), side(k, 2), side(k, 1)]);
        k += 1;
    }
    out
};

/// Edges of a block.
pub(crate) const EDGES: [Feature; 12] = {
    let (mut out, mut k) = ([Feature::Whole; 12], 0);
    while k < out.len() {
        out[k] = Feature::Edge((k / 4) as u8, [side(k, 2), side(k, 1)]);
        k += 1;
    }
    out
};

/// Points of a cylinder's rims.
const RIMS: [Feature; 2 * RIM_POINTS as usize] = {
    let (mut out, mut k) = ([Feature::Whole; 2 * RIM_POINTS as usize], 0);
    while k < out.len() {
        out[k] = Feature::RimPoint(side(k, RIM_POINTS as usize), (k % RIM_POINTS as usize) as u8);
        k += 1;
    }
    out
};

impl ColliderShape {
    /// Points that a solid can touch with.
    pub(super) fn points(self) -> &'static [Feature] {
        match self {
            Self::HalfSpace => &[],
            Self::Ball => &[Feature::Whole],
            Self::Capsule => &ENDS,
            Self::Cylinder => &RIMS,
            Self::Block => &CORNERS,
        }
    }
}
