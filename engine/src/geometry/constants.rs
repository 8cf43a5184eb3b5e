//! Numbers that decide where there is no normal and which features of colliders and contact elements are listed. Units and reasons.

/// See the module; one value, [`GEOMETRY`].
pub(crate) struct GeometryConstants {
    /// Distance of a node's centre to a sphere's centre or a capsule's segment below which there is no normal \[m\]: so near, rounding would choose
    /// it. Also the least sine between two lines that have a common normal [-].
    pub min_distance: f64,
    /// Tilt (sine) of a cylinder's axis against a face's normal above which the rim touches the face by its deepest point, and below which by its
    /// fixed points [-]: there the deepest would run round the rim at once.
    pub leaning: f64,
    /// Sine of the angle between two lines below which they count as parallel [-]: their ends meet, not their middles.
    pub parallel_lines: f64,
    /// The same between an edge and a capsule's axis or a block's edge [-]: the ends of the edge are nodes, which touch by themselves.
    pub parallel_edge: f64,
    /// Sine of the angle between an edge and a line below which the nearest point is an end of the edge [-]: rounding would choose it.
    pub endless: f64,
    /// Largest lean of a normal out of the normals of a block's neighbouring faces, or over a neighbouring triangle (sine) [-].
    pub lean: f64,
    /// Distance beyond an edge or a line's end at which a contact still counts, as a part of the collider's size [-]: rounding.
    pub sliver: f64,
    /// Distance of corners from a plane, as a part of the polyhedron's extent, below which they lie in it [-]: flat sides of a mesh in single
    /// precision are flat to 1e-7.
    pub in_plane: f64,
    /// Thickness of points, as a part of their extent (standard deviations along principal axes), below which they lie in a plane [-]: the
    /// rounding of a covariance in double precision, 1e-16, is the square of 1e-8.
    pub flat: f64,
    /// Square of the sine between a rim's axis and a line above which the two halves of the rim are told apart [-]: below, the line is nearer
    /// to one point of the rim than to the others however deep it is, and which half that is may be rounding.
    pub halved: f64,
    /// Iterations for the point of a rim that is nearest to a line or to another rim; 4 to 8 are taken, more where two such points merge.
    pub rim_iterations: usize,
    /// Points of a line that are looked at for an overlap, to each side of its middle.
    pub samples: i32,
}

/// The values in use.
pub(crate) const GEOMETRY: GeometryConstants = GeometryConstants {
    min_distance: 1e-12,
    leaning: 0.05,
    parallel_lines: 1e-3,
    parallel_edge: 0.02,
    endless: 1e-9,
    lean: 1e-3,
    sliver: 1e-9,
    in_plane: 1e-6,
    flat: 1e-7,
    halved: 0.25,
    rim_iterations: 60,
    samples: 32,
};
