//! Numbers that decide about rods' axes. Units and reasons.

/// See the module; one value, [`RODS`].
pub(crate) struct RodConstants {
    /// Largest deviation of an axis from normal and from unit length [-]: far above what steps leave, far below what shows.
    pub loose: f64,
}

/// The values in use.
pub(crate) const RODS: RodConstants = RodConstants { loose: 1e-6 };
