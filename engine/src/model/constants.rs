//! Numbers that decide when a model is built: what a scene may begin with, and how its matrices are stored. Units and reasons.

/// See the module; one value, [`MODEL`].
pub(crate) struct ModelConstants {
    /// Distance of two points that a closure holds together, or of a joint from where its coupling has it, at the start [m or rad]: so much a
    /// first step closes without a jerk.
    pub open: f64,
    /// Overlap of colliders at the start that contact opens without a jerk \[m\].
    pub overlap: f64,
    /// Depth of an edge or a triangle in a shape at the start that counts as none \[m\]: rounding.
    pub touching: f64,
    /// Least mass of which a weight is made for the smoothing of contacts and closures \[kg\]: without weight they would have none.
    pub lightest: f64,
    /// Half width of a band in nodes beyond which a fill-reducing order is cheaper: measured on square sheets, where 5 × 5 nodes are faster in
    /// the band and 7 × 7 are not (docs/cloth.md).
    pub widest_band: usize,
}

/// The values in use.
pub(crate) const MODEL: ModelConstants =
    ModelConstants { open: 1e-6, overlap: 1e-6, touching: 1e-12, lightest: 1e-9, widest_band: 12 };
