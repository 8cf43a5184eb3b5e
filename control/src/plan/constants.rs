//! Numbers that decide in planning. Units and reasons.

/// See the module; one value, [`PLAN`].
pub(crate) struct PlanConstants {
    /// Least entry on the Gauss–Newton matrix's diagonal, as a part of its largest [-]: inputs that change nothing stay as they are.
    pub least_curvature: f64,
    /// Damping with which a rejected undamped step is tried again [-].
    pub first_damping: f64,
    /// Factor of the damping from one rejected step to the next [-], and its inverse after an accepted one.
    pub damping_factor: f64,
    /// Damping at which no step is found [-]: it would be 1e-8 of the undamped one.
    pub most_damping: f64,
    /// Part of the predicted decrease that a step must achieve [-], as usual of trust regions.
    pub sufficient: f64,
    /// Part of a gripper's reach from which on it need not come nearer [-]: inside, rounding and the object's own motion do not lose it.
    pub inside: f64,
    /// Rest gap of a stage of annealing over that of the one before [-]: a decade, as schedules of κ have it.
    pub anneal: f64,
    /// Closing time of a virtual hold \[s\]: so long that what is held stays where it is.
    pub never: f64,
}

/// The values in use.
pub(crate) const PLAN: PlanConstants = PlanConstants {
    least_curvature: 1e-12,
    first_damping: 1e-3,
    damping_factor: 10.0,
    most_damping: 1e8,
    sufficient: 1e-4,
    inside: 0.5,
    anneal: 0.1,
    never: 1e9,
};
