//! Errors of the statistics, with the numbers.

use thiserror::Error;

/// Errors of [`crate::stats`].
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StatsError {
    /// A slice does not have the length its stated shape asks for.
    #[error("{what}: {found} numbers, but the shape asks for {expected}")]
    Length {
        /// Which argument.
        what: &'static str,
        /// Numbers found.
        found: usize,
        /// Numbers expected.
        expected: usize,
    },
    /// A number is not finite.
    #[error("{what}: entry {index} is not finite")]
    NotFinite {
        /// Which argument.
        what: &'static str,
        /// First offending flat index.
        index: usize,
    },
    /// Too few samples, records or blocks.
    #[error("{what}: {found} given, at least {needed} needed")]
    TooFew {
        /// Name of the samples, records or blocks.
        what: &'static str,
        /// Number given.
        found: usize,
        /// Number needed.
        needed: usize,
    },
    /// A channel that is exactly zero everywhere has no noise level, and none was given as a floor.
    #[error("channel {channel} is constant zero and has no noise floor")]
    DeadChannel {
        /// Channel number.
        channel: usize,
    },
    /// A parameter outside its range.
    #[error("{what} = {value} is outside {range}")]
    OutOfRange {
        /// Which argument.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The admissible range, in words.
        range: &'static str,
    },
}

/// Refuses a slice of the wrong length or with a number that is not finite.
pub(crate) fn check_slice(what: &'static str, slice: &[f64], expected: usize) -> Result<(), StatsError> {
    if slice.len() != expected {
        return Err(StatsError::Length { what, found: slice.len(), expected });
    }
    match slice.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(StatsError::NotFinite { what, index }),
        None => Ok(()),
    }
}
