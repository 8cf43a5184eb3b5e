//! Numbers that decide in a fit: its first noise model, the damping of Levenberg–Marquardt, when a round ends, and how records are cut.
//! Units and reasons; where no source is named, a value is our own choice.

/// See the module; one value, [`FIT`].
pub(crate) struct FitConstants {
    /// σ of the white noise that a fit without a noise model begins with, in the channels' declared floors [-]
    pub start_floors: f64,
    /// Least declared floor of a channel [unit of the channel]: a sensor is never taken to be without noise.
    pub least_floor: f64,
    /// Floor of σ of the innovations, in declared floors [-]: it may be far below the stationary noise, whose floor follows once the
    /// colour is known.
    pub innovation_floor: f64,
    /// Largest order of the noise model [-].
    pub noise_order: usize,
    /// Change of the noise model's coefficients, and of ln σ, below which it has settled [-].
    pub same_coefficients: f64,
    /// Coefficients smaller than this are compared as if they were as large [-].
    pub least_coefficient: f64,
    /// Part of the cost below which a step ends a round whose noise model is still to be re-estimated [-].
    pub loose: f64,
    /// A step that lowers the whitened cost by less than this ends a round under a noise model that fits [-]: far below any quantile.
    pub settled: f64,
    /// Weight of the defects in the merit, as a standard deviation \[m\]: a defect counts like an error of this size.
    pub defect_sigma: f64,
    /// Largest factor by which a step is lengthened [-].
    pub longest_step: f64,
    /// First damping of a round, and the least after a rejected step, relative to the diagonal [-].
    pub start_damping: f64,
    /// Least damping after accepted steps [-].
    pub least_damping: f64,
    /// Damping at which a round ends without a step [-].
    pub largest_damping: f64,
    /// Factor on the damping after a rejected step [-].
    pub raise_damping: f64,
    /// Factor on the damping after an accepted step [-].
    pub lower_damping: f64,
    /// Part of the cost by which an accepted step may raise it [-]: rounding.
    pub cost_rounding: f64,
    /// Change of the cost by a rejected step, as a part of it, below which the round ends [-].
    pub flat: f64,
    /// Growth of a small disturbance over a record up to which its segments are joined whatever the model leaves [-]: one Lyapunov time. Whole
    /// records that grow more do not follow what is far off, as a motor that is 6 ms late.
    pub growth: f64,
    /// Growth up to which they are joined where the model follows them to noise [-]: pieces of two-link arms say a quarter of what their records
    /// say (λ of a spring 110 instead of 409), and nothing of a motor that saturates for 60 ms, in a record over which a disturbance grows
    /// 262-fold *(development)*. An error of half a milliradian at the start, that of an encoder, becomes half a radian at this growth.
    pub growth_followed: f64,
    /// That disturbance, in standard deviations of the initial state's prior [-]: small enough to be linear.
    pub disturbance: f64,
    /// Longest segment of a record whose initial state is unknown \[s\]: short enough to stay near the data while parameters are wrong.
    pub longest_segment: f64,
    /// Shortest segment \[s\]: a shorter one says little about forces.
    pub shortest_segment: f64,
    /// Two times closer than this part of a step are the same [-]: rounding of time stamps.
    pub same_time: f64,
    /// Records whose pieces suffice to bring parameters near.
    pub approached: usize,
    /// Part of the cost below which a step ends the fit over pieces [-].
    pub approach_tolerance: f64,
    /// Inputs before a piece that are kept \[s\]: several of the longest delays and lags of motors.
    pub past: f64,
    /// Time by which a piece of bodies starts before its first reading \[s\]: readings lag by some of the longest delays of sensors, and
    /// refer to states that would otherwise lie before the piece and have to be extrapolated.
    pub lead: f64,
}

/// The values in use.
pub(crate) const FIT: FitConstants = FitConstants {
    start_floors: 10.0,
    least_floor: 1e-9,
    innovation_floor: 1e-3,
    noise_order: 4,
    same_coefficients: 0.02,
    least_coefficient: 0.05,
    loose: 1e-3,
    settled: 0.01,
    defect_sigma: 1e-3,
    longest_step: 64.0,
    start_damping: 1e-6,
    least_damping: 1e-9,
    largest_damping: 1e8,
    raise_damping: 10.0,
    lower_damping: 0.1,
    cost_rounding: 1e-14,
    flat: 1e-9,
    growth: std::f64::consts::E,
    growth_followed: 1000.0,
    disturbance: 1e-4,
    longest_segment: 0.5,
    shortest_segment: 0.2,
    same_time: 1e-6,
    approached: 12,
    approach_tolerance: 1e-3,
    past: 0.3,
    lead: 0.03,
};
