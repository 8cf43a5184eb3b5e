//! Numbers that decide in the laws of constraints. Units and reasons.

/// See the module; one value, [`CONSTRAINTS`].
pub(crate) struct ConstraintConstants {
    /// Safe fraction of the effective mass as the laws' steps ρ [-]: design, never above the mass itself.
    pub rho: f64,
    /// Acceleration that makes a weight of a mass in the smoothing of contacts of colliders and joints [m/s²]: near gravity's, but no parameter.
    /// It replaces gravity's in the smoothing of nodes' contacts where that is zero: a law without any smoothing has no derivative.
    pub weight: f64,
    /// Part of its bound from which friction counts as slipping, |γ_t|/(μ γ_n) of a contact [-]; only the modes of a record depend on it.
    pub slip: f64,
    /// τ [s] of [`super::sharpness`]: in steps shorter than this friction is sharper than the rest gap alone makes it. A longer τ costs
    /// iterations: with 0.01 s a cable in clips takes 1.7 times as many at 1/240 s.
    pub friction_time: f64,
    /// Coefficient below which Coulomb's friction turns no less sharply [-]: small beside those that hold anything, so that these keep
    /// theirs, and large enough for a derivative by a coefficient of zero.
    pub least_slip: f64,
}

/// The values in use.
pub(crate) const CONSTRAINTS: ConstraintConstants =
    ConstraintConstants { rho: 0.3, weight: 10.0, slip: 0.999, friction_time: 0.002, least_slip: 0.05 };
