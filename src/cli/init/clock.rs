//! The unit of a log's clock, its period, and the step of a simulation that fits it.

/// Longest step that is chosen [s]: joint dynamics of arms stay well resolved, and a period of 10 ms has four steps.
pub const LONGEST_STEP: f64 = 2.5e-3;
/// Periods from which a clock without a unit is taken to count milliseconds, microseconds, nanoseconds [counts]: logs of more than a
/// second or less than a millisecond between samples are rare.
pub const COUNTS: [(f64, f64); 3] = [(1e6, 1e-9), (1e3, 1e-6), (1.0, 1e-3)];

/// Units that a clock's name may end in, and their size [s].
pub const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Median difference of the times, in their unit; 0 for fewer than two.
pub fn median_difference(times: &[f64]) -> f64 {
    let mut differences: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    differences.sort_by(f64::total_cmp);
    differences.get(differences.len() / 2).copied().unwrap_or(0.0)
}

/// Seconds per count of the clock: by the unit of its name, or by the size of the median difference.
pub fn seconds(unit: Option<&str>, difference: f64) -> f64 {
    let named = UNITS.iter().find(|(name, _)| Some(*name) == unit);
    let counted = || COUNTS.iter().find(|(least, _)| difference >= *least);
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
        assert!(by_size.into_iter().all(|(difference, unit)| seconds(None, difference) == unit));
    }

    #[test]
    fn steps_divide_the_period() {
        assert_eq!(median_difference(&[0.0, 1.0, 2.0, 7.0]), 1.0);
        for (period, steps) in [(0.01, 4.0), (0.001, 1.0), (1.0 / 60.0, 7.0), (0.0025, 1.0)] {
            assert!((period / step(period) - steps).abs() < 1e-9, "{period}");
        }
    }
}
