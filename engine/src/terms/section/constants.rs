//! Numbers that decide in the laws of rods' sections. Units and reasons.

/// See the module; one value, [`SECTION`].
pub(crate) struct SectionConstants {
    /// Where the path's length is rounded off in Dahl's friction, over the strain κ_f l [-]: so small that nothing else notices.
    pub rounded: f64,
    /// Path over κ_f l below which the mean of a decay is its series [-], exact to the last digit.
    pub series: f64,
    /// |e·Δk| over (κ_f l)² below which a joint neither loads nor unloads [-]; only the modes of a record depend on it.
    pub rests: f64,
}

/// The values in use.
pub(crate) const SECTION: SectionConstants = SectionConstants { rounded: 1e-11, series: 1e-3, rests: 1e-12 };
