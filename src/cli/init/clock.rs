//! The unit of a log's clock, its period, and the step of a simulation that fits it.

/// Longest step that is chosen [s]: joint dynamics of arms stay well resolved, and a period of 10 ms has four steps.
pub const LONGEST_STEP: f64 = 2.5e-3;
/// Periods from which a clock without a unit is taken to count milliseconds, microseconds, nanoseconds [counts]: logs of more than a
/// second or less than a millisecond between samples are rare.
pub const COUNTS: [(f64, f64); 3] = [(1e6, 1e-9), (1e3, 1e-6), (1.0, 1e-3)];

/// Units of clocks, as scenes write them, and their size [s].
pub const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Seconds per count of the clock: by the unit of its name, or by the size of its period in counts.
pub fn seconds(unit: Option<&str>, period: f64) -> f64 {
    let named = UNITS.iter().find(|(name, _)| Some(*name) == unit);
    let counted = || COUNTS.iter().find(|(least, _)| period.abs() >= *least);
    named.map(|(_, seconds)| *seconds).or_else(|| counted().map(|(_, seconds)| *seconds)).unwrap_or(1.0)
}

/// The largest step [s] of which a period [s] is a whole number, up to [`LONGEST_STEP`].
pub fn step(period: f64) -> f64 {
    // less a rounding error, so that 10 ms are four steps and not five
    period / (period / LONGEST_STEP - 1e-9).ceil().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_names_or_sizes() {
        assert_eq!(seconds(Some("ms"), 0.01), 1e-3);
        let by_size = [(0.01, 1.0), (10.0, 1e-3), (1e4, 1e-6), (1e7, 1e-9)];
        assert!(by_size.into_iter().all(|(period, unit)| seconds(None, period) == unit));
    }

    #[test]
    fn steps_divide_the_period() {
        for (period, steps) in [(0.01, 4.0), (0.001, 1.0), (1.0 / 60.0, 7.0), (0.0025, 1.0)] {
            assert!((period / step(period) - steps).abs() < 1e-9, "{period}");
        }
    }
}
