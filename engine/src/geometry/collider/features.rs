//! Features of a collider that may touch.

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
