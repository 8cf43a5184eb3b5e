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
    /// Distance that a gripper keeps from what it may seize per metre by which it is beside of the node that it is to hold [-]: it comes
    /// within reach where it is beside by less than a sixteenth of the reach. With 4 LiftRope's rope is held farther from its nodes, with 16 later.
    pub funnel: f64,
    /// Sweeps of projections on an edge's half-space, for the directions in which a node is the nearest point.
    pub sweeps: usize,
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
    funnel: 8.0,
    sweeps: 20,
    anneal: 0.1,
    never: 1e9,
};
