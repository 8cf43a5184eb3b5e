//! Schedules of κ during a solve or an optimization: large κ gives gradients that reach contacts not yet made.

use thiserror::Error;

/// Inputs a schedule cannot be made of.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ScheduleError {
    /// κ must be finite and positive at both ends.
    #[error("annealing: {end} kappa is {value} J, must be finite and positive")]
    NotPositive {
        /// `start` or `end`.
        end: &'static str,
        /// The given value \[J\].
        value: f64,
    },
    /// κ may only fall.
    #[error("annealing: kappa must not rise, but starts at {start} J and ends at {end} J")]
    Rises {
        /// Given κ at the start \[J\].
        start: f64,
        /// Given κ at the end \[J\].
        end: f64,
    },
    /// There must be at least one stage, and two if κ is to change.
    #[error("annealing: {stages} stages cannot lead from {start} J to {end} J")]
    TooFewStages {
        /// Given number of stages.
        stages: usize,
        /// Given κ at the start \[J\].
        start: f64,
        /// Given κ at the end \[J\].
        end: f64,
    },
}

/// A geometric sequence of κ \[J\]: κ_i = κ_start (κ_end/κ_start)^(i/(n−1)), i = 0 … n−1, both ends exact.
///
/// Two uses: *within a solve*, iterate over the stages and solve at each, warm from the last; *across an optimisation*, ask for
/// [`Annealing::at`] the iteration's number, which stays at κ_end after the last stage.
///
/// A larger κ increases the [`reach`] and the [`hover`]:
/// ```
/// use pliant_smoothing::{Annealing, hover, reach};
/// let annealing = Annealing::new(1e-4, 1e-10, 7)?;
/// assert_eq!(annealing.iter().count(), 7);
/// assert!((annealing.at(1) / 1e-5 - 1.0).abs() < 1e-12);
/// assert_eq!(annealing.at(1000), 1e-10);
/// assert!((reach(1e-4, 4e4) - 0.05).abs() < 1e-12);     // felt 5 cm away beside a stiffness of 4e4 N/m
/// assert!(hover(1e-4, 0.5) > 1e-4);                     // but 0.5 N floats 0.2 mm above the floor
/// # Ok::<(), pliant_smoothing::ScheduleError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annealing {
    start: f64,
    end: f64,
    stages: usize,
}

impl Annealing {
    /// From `start` to `end` \[J\] in `stages` values, both included. One stage is allowed where start = end.
    pub fn new(start: f64, end: f64, stages: usize) -> Result<Self, ScheduleError> {
        for (name, value) in [("start", start), ("end", end)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ScheduleError::NotPositive { end: name, value });
            }
        }
        if end > start {
            return Err(ScheduleError::Rises { start, end });
        }
        if stages == 0 || (stages == 1 && start != end) {
            return Err(ScheduleError::TooFewStages { stages, start, end });
        }
        Ok(Self { start, end, stages })
    }

    /// The same κ always.
    pub fn constant(kappa: f64) -> Result<Self, ScheduleError> {
        Self::new(kappa, kappa, 1)
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.stages
    }

    /// κ \[J\] of stage (or optimiser iteration) `i`; κ_end from the last stage on.
    pub fn at(&self, i: usize) -> f64 {
        match i {
            0 => self.start,
            i if i + 1 >= self.stages => self.end,
            i => self.start * (self.end / self.start).powf(i as f64 / (self.stages - 1) as f64),
        }
    }

    /// The stages' κ \[J\] in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f64> + use<> {
        let annealing = *self;
        (0..self.stages).map(move |i| annealing.at(i))
    }
}

/// Distance \[m\] at which a contact still acts: the force κ/gap has the slope κ/gap², which falls below 1e-6 of a `stiffness`
/// k [N/m] at gap = 10³ √(κ/k).
pub fn reach(kappa: f64, stiffness: f64) -> f64 {
    1e3 * (kappa / stiffness).sqrt()
}

/// The price: a `weight` m g \[N\] rests at the gap κ/(m g) \[m\] above its support.
pub fn hover(kappa: f64, weight: f64) -> f64 {
    kappa / weight
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn falls_geometrically_between_exact_ends() {
        let annealing = Annealing::new(1e-3, 3e-9, 9).unwrap();
        let kappas: Vec<f64> = annealing.iter().collect();
        assert_eq!((kappas.len(), kappas[0], kappas[8]), (9, 1e-3, 3e-9));
        for pair in kappas.windows(3) {
            assert_relative_eq!(pair[1] * pair[1], pair[0] * pair[2], max_relative = 1e-12);
        }
        assert_eq!(annealing.at(usize::MAX - 1), 3e-9);
        assert_eq!(Annealing::constant(1e-9).unwrap().iter().collect::<Vec<_>>(), [1e-9]);
    }

    #[test]
    fn refuses_what_it_cannot_follow() {
        assert_eq!(Annealing::new(0.0, 1e-9, 3), Err(ScheduleError::NotPositive { end: "start", value: 0.0 }));
        assert!(matches!(Annealing::new(1.0, f64::NAN, 3), Err(ScheduleError::NotPositive { end: "end", .. })));
        assert_eq!(Annealing::new(1e-9, 1e-3, 3), Err(ScheduleError::Rises { start: 1e-9, end: 1e-3 }));
        assert!(matches!(Annealing::new(1e-3, 1e-9, 1), Err(ScheduleError::TooFewStages { stages: 1, .. })));
        assert!(matches!(Annealing::new(1e-3, 1e-3, 0), Err(ScheduleError::TooFewStages { stages: 0, .. })));
    }
}
