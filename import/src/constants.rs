//! Numbers that decide in an import: limits of files, sizes that betray another unit, and tolerances. Units and reasons; where no source is
//! named, a value is our own choice.

/// See the module; one value, [`IMPORT`].
pub(crate) struct ImportConstants {
    /// Levels of elements, and of links that hang on each other, above which a file is refused.
    pub deepest: usize,
    /// Most contact rules that are made from masks and friction.
    pub pair_rules: usize,
    /// Longer than this betrays millimetres \[m\].
    pub longest: f64,
    /// Heavier than this betrays grams \[kg\].
    pub heaviest: f64,
    /// Larger than this, two turns, betrays degrees \[rad\].
    pub largest_angle: f64,
    /// A range below this, one turn in radians, betrays radians [°].
    pub small_range: f64,
    /// A pose of a weld that differs by more from that of the bodies would move them at the start [m, and -].
    pub weld_pose: f64,
    /// Coefficients of friction that differ by less are the same [-]: rounding.
    pub same_friction: f64,
    /// Coordinates of a coupling that differ by less are coupled from the start [rad or m].
    pub coupled: f64,
    /// Part of its largest moment by which an inertia may be impossible [-]: rounding.
    pub moments_rounding: f64,
    /// Least second moment of a mended inertia, relative to half the sum of its moments [-], and the least such sum [kg·m²].
    pub least_moment: (f64, f64),
    /// Part of a vector across another below which they are parallel [-].
    pub parallel: f64,
    /// Largest file of a mesh that is read [bytes]: it takes several times as much memory.
    pub mesh_bytes: u64,
    /// Most corners of a hull that touches: its edges are tried against those of other polyhedra one by one.
    pub hull_corners: usize,
    /// Sine of the angle to the z axis below which a direction lies along it [-].
    pub along_z: f64,
}

/// The values in use.
pub(crate) const IMPORT: ImportConstants = ImportConstants {
    deepest: 300,
    pair_rules: 2000,
    longest: 50.0,
    heaviest: 1e5,
    largest_angle: 4.0 * std::f64::consts::PI + 1e-3,
    small_range: 6.3,
    weld_pose: 1e-6,
    same_friction: 1e-12,
    coupled: 1e-9,
    moments_rounding: 1e-12,
    least_moment: (1e-6, 1e-12),
    parallel: 1e-12,
    along_z: 1e-10,
    mesh_bytes: 1 << 30,
    hull_corners: 32,
};
