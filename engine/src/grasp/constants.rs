//! Numbers that decide in grasping. Units and reasons.

/// See the module; one value, [`GRASP`].
pub(crate) struct GraspConstants {
    /// Closing control from which on a gripper holds [-]: half way.
    pub closed: f64,
    /// Time over the closing time from which on e^{−t/τ} is 0 [-]: it is below 1e-304 there.
    pub long: f64,
}

/// The values in use.
pub(crate) const GRASP: GraspConstants = GraspConstants { closed: 0.5, long: 700.0 };
