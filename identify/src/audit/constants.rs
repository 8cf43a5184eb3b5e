//! Numbers that decide in an audit: from which size on a finding is reported, a warning, or makes a record faulty.
//! Units and reasons; where no source is named, a value is our own choice, meant for smooth motion sampled well above its bandwidth.

/// See the module; one value, [`AUDIT`].
pub(crate) struct AuditConstants {
    // time stamps
    /// Medians that an interval must exceed to be a gap [-]; it must exceed the next bound as well.
    pub gap: f64,
    /// Deviations of the jitter by which a gap exceeds the median interval [-].
    pub gap_over_jitter: f64,
    /// Share of intervals that are gaps above which a record is faulty [-].
    pub gaps_faulty: f64,
    /// Jitter, as a share of the median interval, above which it is reported [-].
    pub jitter_info: f64,
    /// The same above which it is a warning [-].
    pub jitter_warning: f64,
    /// Share of a point's samples missing above which a record is faulty [-].
    pub missing_faulty: f64,
    // missing and repeated frames
    /// Fewest points: one or two cannot tell a lost frame from a jump of their own.
    pub frame_points: usize,
    /// Steps to either side among which an ordinary one is looked for.
    pub frame_reach: usize,
    /// Quantile of these steps that stands for an ordinary one [-]: below the median, since several frames may be missing close together.
    pub frame_ordinary_quantile: f64,
    /// Bounds of an ordinary step, relative to that quantile [-].
    pub frame_ordinary: (f64, f64),
    /// Largest share of the excess that may lie across the ordinary step [-].
    pub frame_along: f64,
    /// Excess over the noise of a displacement [-].
    pub frame_over_noise: f64,
    /// Excess over the change of the ordinary step from one side to the other [-].
    pub frame_over_change: f64,
    /// Ordinary steps in one from which on frames are missing [-].
    pub frame_missing: f64,
    /// Ordinary steps in one below which a frame is written twice [-].
    pub frame_repeated: f64,
    /// Missing frames from which on a record is faulty.
    pub frames_faulty: f64,
    // frozen points
    /// Shortest frozen run \[steps\].
    pub frozen_run: usize,
    /// Frozen run from which on a record is faulty \[steps\].
    pub frozen_faulty: usize,
    /// Step out of a frozen run over the steps around it [-].
    pub frozen_catch_up: f64,
    /// That step over the larger of noise and grid [-].
    pub frozen_over_noise: f64,
    /// Last motion before a run to the record's end, as a part of that bar [-].
    pub frozen_last_over_noise: f64,
    /// Steps looked at on either side of a run.
    pub frozen_around: usize,
    // sensors that stand still over a record
    /// Simulated motion over the larger of noise floor, grid and rounding from which a reading should not be the same throughout [-].
    pub still_over_noise: f64,
    /// Simulated motion below which it may be rounding [unit of the reading].
    pub still_rounding: f64,
    // units
    /// How many times as far a joint must move in the scene's own simulation as was read, or the other way, for another unit to be likely [-]:
    /// below the 57.3 of degrees and radians, above what a missing effect does to a simulation.
    pub other_unit: f64,
    // jumps
    /// Third difference over its median in the record [-].
    pub jump_over_median: f64,
    /// Size of a jump over the noise [-].
    pub jump_over_noise: f64,
    /// Size over the spacing of neighbouring points above which a jump is a warning [-].
    pub jump_warning: f64,
    /// The same of a single point, in the least size of a jump [-].
    pub jump_warning_alone: f64,
    /// Size over the spacing above which a record is faulty [-].
    pub jump_faulty: f64,
    /// Share of a point's samples in jumps of warning size above which a record is faulty [-].
    pub jumps_faulty: f64,
    /// Samples to either side of a jump in which a lost or exchanged point explains it: the width of a third difference.
    pub jump_around: usize,
    /// Longer rough stretches are not measured against a curve across them \[samples\].
    pub jump_longest: usize,
    /// Quantile of an input's steps that stands for an ordinary one [-].
    pub input_ordinary_quantile: f64,
    /// An input's jump over its ordinary step [-].
    pub input_over_ordinary: f64,
    /// An input's jump over its range in the record [-].
    pub input_over_range: f64,
    // lengths
    /// Quantile of a chord that stands for its arc [-].
    pub straight: f64,
    /// A length seen in less than one of so many samples is not judged.
    pub hardly_seen: usize,
    /// Fewest records for a comparison.
    pub compared_records: usize,
    /// Robust z and relative deviation across records from which a length is faulty [-].
    pub length_faulty: (f64, f64),
    /// The same for a warning [-].
    pub length_warning: (f64, f64),
    /// Least spread across records, relative to the length [-].
    pub length_least_spread: f64,
    /// Half width of the windows either side of a step \[samples\].
    pub step_window: usize,
    /// Samples between a window and the step.
    pub step_apart: usize,
    /// Samples either side over which a step must last.
    pub step_lasting: usize,
    /// Fewest windows, with their distance from the step, that a record must hold.
    pub step_windows: usize,
    /// Step of a chord on a rope: relative to its length, and over ordinary changes [-].
    pub step_flexible: (f64, f64),
    /// The same of a fixed distance [-].
    pub step_rigid: (f64, f64),
    /// A step over the noise of the distance [-].
    pub step_over_noise: f64,
    /// Part of a step that must last [-].
    pub step_kept: f64,
    /// Drift of a fixed distance over the record, relative to it, above which it is reported [-]; it must exceed the next bound as well.
    pub drift_length: f64,
    /// Drift over the scatter about it [-].
    pub drift_rest: f64,
    /// Spread of a fixed distance, relative to it, above which it is reported [-]; it must exceed the next bound as well.
    pub rigid_varies: f64,
    /// Spread of a fixed distance over its noise [-].
    pub rigid_over_noise: f64,
    // records as a whole
    /// Robust z from which a record is unlike the others [-].
    pub unlike: f64,
    /// Least deviation of the total length that is reported, relative to the median [-].
    pub total_length_least: f64,
    // records that are said to begin at rest
    /// Samples from the start over which readings are compared with rest.
    pub start_samples: usize,
    /// Motion over these samples in its standard errors from which a reading moves [-]: in white noise one of a million channels seems to.
    pub start_errors: f64,
    /// Part of the largest simulated motion over these samples that readings may be off it [-]: inputs that move at once move the readings
    /// of a record that begins at rest too, and a scene that lacks something does not move them by the same amount.
    pub start_simulated: f64,
    // grids, flat tops, exchanged names
    /// Fewest distinct values of a channel whose grid is looked for.
    pub grid_distinct: usize,
    /// Share of differences between distinct values that must be multiples of the smallest [-].
    pub grid_share: f64,
    /// Deviation from a multiple, in smallest differences, beside the rounding of single precision [-].
    pub grid_tolerance: f64,
    /// Tolerance from which on multiples mean nothing [-].
    pub grid_loosest: f64,
    /// Fewest differences equal to the smallest.
    pub grid_repeats: usize,
    /// Finest grid in units of the noise [-]: a finer one is a number format, not a sensor.
    pub grid_finest: f64,
    /// Shortest flat run \[samples\].
    pub flat_run: usize,
    /// Step into the run over the typical step [-]: a smooth peak enters its top slowly.
    pub flat_over_moves: f64,
    /// Step into the run over the larger of noise and grid [-].
    pub flat_over_noise: f64,
    /// Misfit after exchanging the names of two markers, over that before [-].
    pub swap_better: f64,
    /// Misfit after exchanging, over the distance of the two markers [-].
    pub swap_close: f64,
    /// Misfit before, over that distance, from which on an exchange is looked for [-].
    pub swap_miss: f64,
}

/// The values in use.
pub(crate) const AUDIT: AuditConstants = AuditConstants {
    gap: 1.5,
    gap_over_jitter: 5.0,
    gaps_faulty: 0.02,
    jitter_info: 0.01,
    jitter_warning: 0.1,
    missing_faulty: 0.2,
    frame_points: 3,
    frame_reach: 6,
    frame_ordinary_quantile: 0.4,
    frame_ordinary: (0.5, 1.5),
    frame_along: 0.4,
    frame_over_noise: 12.0,
    frame_over_change: 1.5,
    frame_missing: 1.7,
    frame_repeated: 0.15,
    frames_faulty: 3.0,
    frozen_run: 3,
    frozen_faulty: 10,
    frozen_catch_up: 2.5,
    frozen_over_noise: 10.0,
    frozen_last_over_noise: 0.5,
    frozen_around: 3,
    still_over_noise: 10.0,
    still_rounding: 1e-7,
    other_unit: 20.0,
    jump_over_median: 25.0,
    jump_over_noise: 10.0,
    jump_warning: 0.05,
    jump_warning_alone: 5.0,
    jump_faulty: 0.5,
    jumps_faulty: 0.1,
    jump_around: 3,
    jump_longest: 20,
    input_ordinary_quantile: 0.95,
    input_over_ordinary: 3.0,
    input_over_range: 0.01,
    straight: 0.9,
    hardly_seen: 10,
    compared_records: 5,
    length_faulty: (8.0, 0.05),
    length_warning: (6.0, 0.025),
    length_least_spread: 0.005,
    step_window: 10,
    step_apart: 3,
    step_lasting: 100,
    step_windows: 4,
    step_flexible: (0.15, 12.0),
    step_rigid: (0.1, 8.0),
    step_over_noise: 10.0,
    step_kept: 0.6,
    drift_length: 0.05,
    drift_rest: 4.0,
    rigid_varies: 0.01,
    rigid_over_noise: 5.0,
    unlike: 5.0,
    total_length_least: 0.02,
    start_samples: 5,
    start_errors: 5.0,
    start_simulated: 0.5,
    grid_distinct: 8,
    grid_share: 0.98,
    grid_tolerance: 0.05,
    grid_loosest: 0.2,
    grid_repeats: 3,
    grid_finest: 0.02,
    flat_run: 4,
    flat_over_moves: 0.3,
    flat_over_noise: 3.0,
    swap_better: 0.25,
    swap_close: 0.25,
    swap_miss: 0.5,
};
