//! Numbers that decide in the search by cross-validation. Units and reasons; the values are our own choice.

use crate::fit::FitOptions;

/// See the module; one value, [`SEARCH`].
pub(super) struct SearchConstants {
    /// Fewest fitted records: half of them have to be enough to fit, and the others to judge.
    pub records: usize,
    /// Most records that causes are fitted to.
    pub fitted: usize,
    /// Most records that they are judged by.
    pub judged: usize,
    /// Level of a round [-].
    pub level: f64,
    /// Part of the squares that a cause has to take at least [-].
    pub worth: f64,
    /// Most causes that are refitted in a round.
    pub refits: usize,
    /// A cause that, linearized, takes less than this part of the squares where it is fitted is not refitted [-].
    pub promising: f64,
    /// Causes tried roughly that are followed to their end.
    pub finalists: usize,
    /// A cause that takes less than this part of the squares that the best one takes is not followed [-].
    pub far_behind: f64,
    /// Part of its one-step estimate that a cause whose law is silent at zero starts from [-].
    pub start_part: f64,
    /// A one-step estimate is followed so far at most, in typical sizes [-]: beyond it a linearization says little.
    pub longest_step: f64,
    /// First refits.
    pub rough: FitOptions,
    /// Fits over short pieces before them.
    pub pieces: FitOptions,
    /// Refits of causes that may be accepted.
    pub coarse: FitOptions,
    /// Fits of all records.
    pub fine: FitOptions,
}

/// The values in use.
pub(super) const SEARCH: SearchConstants = SearchConstants {
    records: 12,
    fitted: 8,
    judged: 40,
    level: 0.05,
    worth: 0.03,
    refits: 8,
    promising: 0.01,
    finalists: 3,
    far_behind: 0.3,
    start_part: 0.5,
    longest_step: 3.0,
    rough: FitOptions { max_iterations: 4, rounds: 0, tolerance: 1e-2 },
    pieces: FitOptions { max_iterations: 8, rounds: 0, tolerance: 1e-3 },
    coarse: FitOptions { max_iterations: 12, rounds: 0, tolerance: 3e-3 },
    fine: FitOptions { max_iterations: 15, rounds: 0, tolerance: 1e-3 },
};
