//! Numbers that decide about commands of grippers. Units and reasons.

/// See the module; one value, [`KINEMATICS`].
pub(crate) struct KinematicsConstants {
    /// Sine of the smallest angle between a clamp's axis and its director [-]: nearer, the director says nothing.
    pub parallel: f64,
}

/// The values in use.
pub(crate) const KINEMATICS: KinematicsConstants = KinematicsConstants { parallel: 1e-6 };
