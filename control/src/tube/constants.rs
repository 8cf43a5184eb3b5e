//! Numbers that decide in the synthesis of tubes. Units and reasons; where no source is named, a value is our own choice.

/// See the module; one value, [`TUBE`].
pub(crate) struct TubeConstants {
    /// Least row norm that a weight is divided by, in the row's tightening without weights \[-\]: a norm that is zero at the optimum, or of
    /// a disturbance that does not move the row, would otherwise get an unbounded weight.
    pub norm_floor: f64,
    /// Share of the room between two opposed hard rows that their tightenings are cut to while they exceed it \[-\]: the nominal problem
    /// keeps an interior.
    pub kept_room: f64,
    /// Largest ratio of needed to available width, and the inverse of the least, that one iteration's multipliers react to \[-\].
    pub escalation: f64,
    /// Part of the costs below which multiplier times tightening is rounding of the nominal solver \[-\].
    pub negligible_multiplier: f64,
    /// Share of its distance to the mean multipliers that a step leaves, of 1 − step/2, above which it counts as stalled \[-\]: were the
    /// nominal problem's multipliers independent of the mean, a step would leave 1 − step.
    pub stalled: f64,
    /// Most syntheses with multipliers held, after an alternation of which no tube fitted between its hard constraints \[-\].
    pub fitting: usize,
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
    fitting: 100,
    opposed: 1e-9,
};
