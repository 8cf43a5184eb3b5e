//! Numbers that decide about signals. Units and reasons.

/// See the module; one value, [`MEMORY`].
pub(crate) struct MemoryConstants {
    /// Part of a step below which a lag is none [-]: e^{−h/T} is zero long before.
    pub no_lag: f64,
}

/// The values in use.
pub(crate) const MEMORY: MemoryConstants = MemoryConstants { no_lag: 1e-12 };
