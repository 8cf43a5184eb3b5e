//! Numbers that decide in the synthesis of tubes. Units and reasons; where no source is named, a value is our own choice.

/// See the module; one value, [`TUBE`].
pub(crate) struct TubeConstants {
    /// Least row norm that a weight is divided by, in the row's tightening without weights \[-\]: a norm that is zero at the optimum, or of
    /// a disturbance that does not move the row, would otherwise get an unbounded weight.
    pub norm_floor: f64,
    /// Share of the room between two opposed hard rows that their tightenings are cut to while they exceed it \[-\]: the nominal problem
    /// keeps an interior.
    pub kept_room: f64,
    /// Largest ratio of needed to kept room, and the inverse of the least, that one iteration's multipliers of opposed rows react to \[-\].
    pub escalation: f64,
    /// Part of the costs below which multiplier times tightening is rounding of the nominal solver \[-\].
    pub negligible_multiplier: f64,
    /// A change of the tightenings above this part of the last one halves the step towards new ones \[-\]: it does not contract.
    pub stalled: f64,
    /// Least step towards new tightenings \[-\].
    pub least_step: f64,
    /// Part of a step by which the change must contract for the step to lengthen \[-\], and the factor by which it does \[-\].
    pub contracting: f64,
    /// See `contracting`.
    pub lengthening: f64,
    /// Longest step after one has failed, in that one \[-\].
    pub below_failed: f64,
    /// Sine of the angle to exact opposition below which two rows count as opposed \[-\].
    pub opposed: f64,
}

/// The values in use.
pub(crate) const TUBE: TubeConstants = TubeConstants {
    norm_floor: 1e-5,
    kept_room: 0.99,
    escalation: 10.0,
    negligible_multiplier: 1e-9,
    stalled: 0.9,
    least_step: 0.125,
    contracting: 0.7,
    lengthening: 1.5,
    below_failed: 0.75,
    opposed: 1e-9,
};
