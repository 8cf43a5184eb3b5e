//! Numbers that decide in statistics. Units and reasons; where no source is named, a value is our own choice. Levels and numbers of draws that a caller may choose are fields of the modules' options.

/// Factor from a median absolute deviation to a Gaussian standard deviation.
pub(crate) const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// See the module; one value, [`STATS`].
pub(crate) struct StatsConstants {
    // noise models
    /// Largest magnitude of a fitted reflection coefficient [-]: at 1 the model is not stationary.
    pub reflection_limit: f64,
    /// Largest order tried by default, and for the noise of residuals [-].
    pub noise_order: usize,
    /// Fits of one order with channels weighted by the σ of the last: the weights have settled after two.
    pub weight_passes: usize,
    // score tests
    /// A column is dead when its part orthogonal to the others is below this share of its norm [-].
    pub dead: f64,
    /// Whitened effect of a change of typical size below which a column is rounding [-]: the mass of a thing in free fall.
    pub rounding: f64,
    /// A direction of which another cause leaves less than this (cosine above 0.9995) is the other cause's [-].
    pub conditional: f64,
    /// Smallest size that would be seen, in standard errors [-].
    pub detectable: f64,
    /// Largest leverage that is corrected for [-]: above, one cluster holds nearly all the information.
    pub leverage_limit: f64,
    /// Least p that is turned into a normal quantile [-]: below it the statistic itself serves.
    pub least_p: f64,
    /// Least whitened distance that a lead is divided by [-].
    pub least_distance: f64,
    // sign flips
    /// Fewest records for which flips have any resolution: the smallest p is 2/2⁸.
    pub flip_records: usize,
    /// Records up to which all sign patterns are gone through: 4096.
    pub exhaustive_records: usize,
    /// Part of the statistic by which a pattern may fall short of it and still count as equal [-]: the mirror pattern gives the same up
    /// to rounding.
    pub flip_slack: f64,
    /// |z| of a pattern whose p is zero in double precision, beside the logarithm of its F [-]: z of the smallest p that is not.
    pub beyond_z: f64,
    // intervals and regressions
    /// Records from which on an interval comes from the bootstrap.
    pub bootstrap_records: usize,
    /// Fewest blocks of a record that are resampled.
    pub bootstrap_blocks: usize,
    /// Fewest draws.
    pub bootstrap_draws: usize,
    /// Weights of a ridge regression that are tried [-]: beyond the last the correction is nil.
    pub ridge_weights: [f64; 8],
    /// Weight of all features alike, in the largest one's [-]: a feature that is always zero gets a zero coefficient.
    pub ridge_zero: f64,
    // correlation with inputs
    /// Largest order of the residual's noise model [-].
    pub correlated_order: usize,
    /// Autocorrelation below which a series has forgotten, if all of the last order are [-].
    pub forgotten: f64,
    /// Least variance in that of white series [-]: a sum of alternating terms is not trusted further.
    pub least_bartlett: f64,
}

/// The values in use.
pub(crate) const STATS: StatsConstants = StatsConstants {
    reflection_limit: 0.999,
    noise_order: 4,
    weight_passes: 2,
    dead: 1e-8,
    rounding: 1e-6,
    conditional: 0.03,
    detectable: 5.0,
    leverage_limit: 0.95,
    least_p: 1e-300,
    least_distance: 1e-9,
    flip_records: 8,
    exhaustive_records: 12,
    flip_slack: 1e-10,
    beyond_z: 38.0,
    bootstrap_records: 5,
    bootstrap_blocks: 4,
    bootstrap_draws: 200,
    ridge_weights: [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0],
    ridge_zero: 1e-12,
    correlated_order: 8,
    forgotten: 1e-6,
    least_bartlett: 0.1,
};
