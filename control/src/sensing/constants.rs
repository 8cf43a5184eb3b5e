//! Numbers that decide in estimates. Units and reasons.

/// See the module; one value, [`SENSING`].
pub(crate) struct SensingConstants {
    /// Standard deviations of a reading's noise that its ball is wide [-]. A tightened row is a sum over the balls of all times, and holds
    /// against noise of a normal law with at least the 99.87 % of this many deviations of the row itself.
    pub deviations: f64,
    /// A gripper holds something if its reading is at least this [-]: half way from 0 to 1.
    pub holds: f64,
}

/// The values in use.
pub(crate) const SENSING: SensingConstants = SensingConstants { deviations: 3.0, holds: 0.5 };
