//! Numbers that decide in a diagnosis, in the order of its steps; those of the search by cross-validation stand in `search/constants.rs`.
//! Units and reasons; where no source is named, a value is our own choice.

use crate::fit::FitOptions;

/// See the module; one value, [`DIAGNOSE`].
pub(super) struct DiagnoseConstants {
    // baseline
    /// Typical size of a declared parameter, in the width of its bounds [-].
    pub declared_size: f64,
    /// Typical size of an entry of the markers' sensor [unit of the entry].
    pub sensor_size: f64,
    /// Squared effect of a change of typical size on the readings below which a free parameter is refused [squared unit of the readings]:
    /// rounding.
    pub no_influence: f64,
    /// A whitened fit whose residual exceeds that of least squares by this factor has given the data up [-].
    pub given_up: f64,
    /// Part of the cost below which a step ends the first least-squares fit [-].
    pub baseline_tolerance: f64,
    // certainty of estimates
    /// Singular values of the columns, each made of length one, below this part of the largest are not determined [-].
    pub undetermined: f64,
    /// A column shorter than this part of the longest is rounding [-]: its unknown has no influence.
    pub no_column: f64,
    /// Smallest component of a unit vector without influence that counts [-]: below it may be rounding of the determined ones.
    pub component: f64,
    /// Secant steps towards an end of a profile interval.
    pub profile_steps: usize,
    /// Fits at fixed values of one unknown: they start next to their optimum.
    pub profile_fit: FitOptions,
    /// Least rise of the deviance that a secant step divides by [-].
    pub profile_least_rise: f64,
    /// Bounds of a secant step's factor [-].
    pub profile_stretch: (f64, f64),
    /// Change of the reach, relative, that ends them [-].
    pub profile_settled: f64,
    // score tests
    /// Fewest records for which sign flips resolve a family of a dozen causes.
    pub flip_records: usize,
    /// Random sign patterns.
    pub flip_draws: usize,
    /// Time blocks of a record for variances robust to a wrong noise model.
    pub score_blocks: usize,
    /// Fewest samples of such a block.
    pub score_block: usize,
    /// A number of a cause that moves the readings by less than this part of its others moves none [-].
    pub dead_number: f64,
    // selection by refits
    /// Level of tests and comparisons [-].
    pub level: f64,
    /// Refits per round, best scores first.
    pub refits: usize,
    /// A score of at least this part of the best is refitted at any rank [-].
    pub close: f64,
    /// Part of its one-step estimate that a cause whose law is silent at zero starts from [-]: at zero its refit
    /// would say nothing of its size.
    pub start_part: f64,
    /// Standard error of the logarithms of a nuisance grid's parameters below which they are freed [-].
    pub shape_error: f64,
    /// A refit that leaves less than this part of the error needs no second try [-].
    pub half_way: f64,
    /// A second try that leaves more than this part of the first one's error is none [-].
    pub nearer: f64,
    /// A second try that leaves this many times the error of another cause's refit is not followed [-]: it will not be the best.
    pub far_behind: f64,
    /// The second try, by least squares.
    pub second_try: FitOptions,
    /// Part of the cost below which a step ends a refit that may not be followed to its end [-].
    pub rough: f64,
    /// Refits that leave the deviance further than this behind the best, and gain less than `followed` of its gain, are not followed to
    /// their end [-]: with Δ between two deviances and G the best's gain, the inequality's left side is at least Δ/(2 (1 + √½) √G), which
    /// is above any bar in use from Δ = G/2 = 400 on.
    pub reach: f64,
    /// Part of the best gain from which on a refit is followed to its end [-].
    pub followed: f64,
    /// Whitened distance of two predictions below which they are the same [-]: their costs then differ by their numbers of parameters
    /// alone.
    pub indistinct: f64,
    /// Smallest principal cosine from which on one cause contains another [-].
    pub contained: f64,
    /// Rivals of a cause that a report lists.
    pub listed_rivals: usize,
    // coloured-noise test
    /// Residual over the sensors' noise below which the test is not made [-].
    pub coloured_excess: f64,
    /// Level [-]. It comes on top of the first test's, which is five times as high.
    pub coloured_level: f64,
    /// Most readings that are looked at, of whole records.
    pub coloured_readings: usize,
    // constancy of sizes
    /// Level of the test, per diagnosis [-].
    pub constancy_level: f64,
    /// Parts of each record.
    pub constancy_parts: usize,
    /// A part with less than this share of the mean information says nothing [-].
    pub constancy_feeble: f64,
    /// Singular values below this are zero when other unknowns are projected out [-].
    pub singular: f64,
    // gain on held-out records
    /// Fewest samples that an initial state is estimated from.
    pub lead_in_samples: usize,
    /// Iterations of that estimate.
    pub lead_in_iterations: usize,
    /// Horizons \[s\] beside one step and the whole record.
    pub horizons: [f64; 3],
    /// Level of the gain's interval [-].
    pub gain_level: f64,
    /// Draws of its bootstrap.
    pub gain_draws: usize,
    /// Blocks that a single held-out record is cut into for it.
    pub gain_blocks: usize,
    /// Fewest samples of such a block.
    pub gain_block: usize,
    /// Least mean squared error that a logarithm is taken of [squared unit of the readings].
    pub least_square: f64,
    /// Times closer than this are the same [s; relative for horizons]: rounding of time stamps.
    pub same_time: f64,
    /// Time by which a sample may lie behind a horizon \[s\].
    pub horizon_slack: f64,
    /// Records that a report shows curves of.
    pub picture_records: usize,
    /// Samples of such a curve.
    pub picture_samples: usize,
    // regression without physics
    /// Lags at which it reads the inputs \[s\].
    pub ceiling_lags: [f64; 5],
    /// Fewest parts of the fitted records that are left out in turn to choose its weight.
    pub ceiling_groups: usize,
    /// Change of an error, relative, below which it is rounding [-].
    pub ceiling_rounding: f64,
    // remainder and verdict
    /// Family-wise level of the dependence of the residual on the inputs [-].
    pub remainder_level: f64,
    /// Longest lag looked at \[s\].
    pub remainder_lag: f64,
    /// Most lags.
    pub remainder_lags: usize,
    /// Change of an input from sample to sample below which it is constant [unit of the input].
    pub remainder_still: f64,
    /// Times the sensors' own noise above which a residual without a cause is said to be larger [-].
    pub larger: f64,
    /// Times the sensors' own noise above which a residual is not noise [-]: were all of it coloured, by 0.98 from one sample to the
    /// next, it would be 9.3.
    pub no_noise: f64,
    /// Part of the explainable error above which equal causes are no imitation merely because their size varies [-]: real things vary.
    /// (Tosses of one cube take scales that differ by more than their noise, and a scale takes 0.8. Good imitations pass: viscous
    /// friction in place of quadratic takes 0.9.)
    pub imitation: f64,
    /// Part of the explainable error that the accepted causes must take if something significant remains [-]: below it, they may be an
    /// imitation of something outside the library. (In blind batches effects of the library leave nothing significant; winds and offsets
    /// that imitate others took up to 0.72.)
    pub enough: f64,
    /// The same where the size of an accepted cause surely differs between parts of the records [-]. Viscous friction takes 0.95 of the
    /// error that damping by the square of the speed leaves, but never with one coefficient; a sensor's delay of pieces whose first
    /// readings were extrapolated took 0.999.
    pub enough_though_varying: f64,
    /// p below which a size surely differs [-]. Every hundredth cause that is really there seems to at the test's own level (in blind
    /// batches two, p = 0.0065 and 0.009); of imitations of quadratic damping it was 1e-4 and less.
    pub surely: f64,
}

/// The values in use.
pub(super) const DIAGNOSE: DiagnoseConstants = DiagnoseConstants {
    declared_size: 0.1,
    sensor_size: 0.01,
    no_influence: 1e-24,
    given_up: 1.05,
    baseline_tolerance: 1e-3,
    undetermined: 1e-6,
    no_column: 1e-10,
    component: 0.01,
    profile_steps: 5,
    profile_fit: FitOptions { max_iterations: 6, rounds: 0, tolerance: 1e-5 },
    profile_least_rise: 1e-3,
    profile_stretch: (0.4, 2.5),
    profile_settled: 0.05,
    flip_records: 10,
    flip_draws: 4000,
    score_blocks: 8,
    score_block: 10,
    dead_number: 1e-9,
    level: 0.05,
    refits: 6,
    close: 0.5,
    start_part: 0.5,
    shape_error: 1.0,
    half_way: 0.5,
    nearer: 0.8,
    far_behind: 1.5,
    second_try: FitOptions { max_iterations: 12, rounds: 0, tolerance: 1e-2 },
    rough: 1e-3,
    reach: 400.0,
    followed: 0.5,
    indistinct: 1.0,
    contained: 0.9995,
    listed_rivals: 4,
    coloured_excess: 1.5,
    coloured_level: 0.01,
    coloured_readings: 40_000,
    constancy_level: 0.01,
    constancy_parts: 16,
    constancy_feeble: 1e-3,
    singular: 1e-12,
    lead_in_samples: 4,
    lead_in_iterations: 8,
    horizons: [0.1, 0.5, 1.0],
    gain_level: 0.90,
    gain_draws: 4000,
    gain_blocks: 8,
    gain_block: 4,
    least_square: 1e-24,
    same_time: 1e-9,
    horizon_slack: 1e-6,
    picture_records: 3,
    picture_samples: 400,
    ceiling_lags: [0.0, 0.05, 0.1, 0.2, 0.4],
    ceiling_groups: 8,
    ceiling_rounding: 1e-9,
    remainder_level: 0.01,
    remainder_lag: 0.25,
    remainder_lags: 20,
    remainder_still: 1e-12,
    larger: 2.0,
    no_noise: 10.0,
    imitation: 0.6,
    enough: 0.9,
    enough_though_varying: 0.98,
    surely: 1e-3,
};
