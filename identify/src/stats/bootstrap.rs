//! The gain on held-out records: paired difference of log RMSE, with an interval over records.
//!
//! d_r = ln RMSE_after(r) − ln RMSE_before(r) per record; the gain is the mean of d_r (negative: better after).
//! Records, not samples, are resampled: samples within a record are far from independent.

use super::constants::STATS;
use super::dist::{normal_cdf, t_quantile};
use super::error::StatsError;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;

/// Squared errors of one held-out record under both models, over the same samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordError {
    /// Mean squared error before the extension.
    pub before: f64,
    /// Mean squared error after.
    pub after: f64,
}

/// Method that an interval comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum IntervalKind {
    /// Percentiles of the bootstrap over records.
    Bootstrap,
    /// Student's t on the records' differences: fewer than five records.
    StudentT,
    /// Bootstrap over blocks of the only record: says nothing about other records.
    Blocks,
    /// One record: no interval.
    None,
}

/// Mean difference of log RMSE (after − before) and its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LogRmseGain {
    /// Mean over records of ln(RMSE_after/RMSE_before); exp of it is the factor on the RMSE.
    pub difference: f64,
    /// Lower end; −∞ with one record.
    pub lower: f64,
    /// Upper end; +∞ with one record.
    pub upper: f64,
    /// Where the interval comes from.
    pub kind: IntervalKind,
    /// Number of records.
    pub records: usize,
    /// Records with a smaller error after.
    pub improved: usize,
}

impl LogRmseGain {
    /// Whether the whole interval is on the side of improvement.
    pub fn is_gain(&self) -> bool {
        self.upper < 0.0
    }
}

/// Paired difference of log RMSE over records with a two-sided interval at `level` (0.90 for the reports).
///
/// With at least five records: bootstrap percentiles at the *expanded* levels Φ(±√(R/(R−1)) t_{R−1}), without which
/// percentiles are too narrow at small R (a 90 % interval of 8 records would cover 84 %; Hesterberg 2015). With two to four:
/// mean ± t_{R−1} s/√R, and `kind` says so. Same seed, same interval.
///
/// # Errors
/// No record, an error that is not positive and finite, or a level outside (0, 1).
pub fn log_rmse_gain(records: &[RecordError], level: f64, draws: usize, seed: u64) -> Result<LogRmseGain, StatsError> {
    if records.is_empty() {
        return Err(StatsError::TooFew { what: "held-out records", found: 0, needed: 1 });
    }
    if !(level > 0.0 && level < 1.0) {
        return Err(StatsError::OutOfRange { what: "level", value: level, range: "(0, 1)" });
    }
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if let Some(bad) = records.iter().find(|r| !positive(r.before) || !positive(r.after)) {
        let value = if positive(bad.before) { bad.after } else { bad.before };
        return Err(StatsError::OutOfRange { what: "mean squared error", value, range: "positive" });
    }
    let d: Vec<f64> = records.iter().map(|r| 0.5 * (r.after / r.before).ln()).collect();
    let n = d.len();
    let mean = d.iter().sum::<f64>() / n as f64;
    let (lower, upper, kind) = match n {
        1 => (f64::NEG_INFINITY, f64::INFINITY, IntervalKind::None),
        2.. if n < STATS.bootstrap_records => {
            let half = t_half_width(&d, mean, level);
            (mean - half, mean + half, IntervalKind::StudentT)
        }
        _ => {
            let (lower, upper) = bootstrap_mean(&d, level, draws, seed);
            (lower, upper, IntervalKind::Bootstrap)
        }
    };
    Ok(LogRmseGain { difference: mean, lower, upper, kind, records: n, improved: d.iter().filter(|x| **x < 0.0).count() })
}

/// The gain on a single record from the squared errors of its consecutive, equally long blocks, which are resampled: its
/// interval covers the choice of stretches within the record. (Errors are correlated over a block, hence blocks and not samples. The
/// interval says nothing about other records.)
///
/// # Errors
/// Fewer than four blocks; errors as in [`log_rmse_gain`].
pub fn log_rmse_gain_of_blocks(blocks: &[RecordError], level: f64, draws: usize, seed: u64) -> Result<LogRmseGain, StatsError> {
    let n = blocks.len();
    if n < STATS.bootstrap_blocks {
        return Err(StatsError::TooFew { what: "blocks of a record", found: n, needed: STATS.bootstrap_blocks });
    }
    let ratio = |chosen: &mut dyn Iterator<Item = usize>| {
        let sums = chosen.fold((0.0, 0.0), |s, k| (s.0 + blocks[k].before, s.1 + blocks[k].after));
        0.5 * (sums.1 / sums.0).ln()
    };
    let difference = ratio(&mut (0..n));
    if !difference.is_finite() {
        return Err(StatsError::OutOfRange { what: "mean squared error", value: difference, range: "positive" });
    }
    let mut rng = Pcg64::seed_from_u64(seed);
    let draw = |_| ratio(&mut (0..n).map(|_| rng.random_range(0..n)).collect::<Vec<_>>().into_iter());
    let mut ratios: Vec<f64> = (0..draws.max(STATS.bootstrap_draws)).map(draw).collect();
    let (lower, upper) = expanded_percentiles(&mut ratios, n, level);
    let improved = blocks.iter().filter(|b| b.after < b.before).count();
    Ok(LogRmseGain { difference, lower, upper, kind: IntervalKind::Blocks, records: 1, improved })
}

fn t_half_width(d: &[f64], mean: f64, level: f64) -> f64 {
    let n = d.len() as f64;
    let variance = d.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    t_quantile(0.5 + 0.5 * level, n - 1.0) * (variance / n).sqrt()
}

fn bootstrap_mean(d: &[f64], level: f64, draws: usize, seed: u64) -> (f64, f64) {
    let n = d.len();
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut means: Vec<f64> = (0..draws.max(STATS.bootstrap_draws))
        .map(|_| (0..n).map(|_| d[rng.random_range(0..n)]).sum::<f64>() / n as f64)
        .collect();
    expanded_percentiles(&mut means, n, level)
}

/// Percentiles of bootstrap draws from `n` units at the expanded levels of [`log_rmse_gain`].
fn expanded_percentiles(draws: &mut [f64], n: usize, level: f64) -> (f64, f64) {
    draws.sort_by(f64::total_cmp);
    let expand = (n as f64 / (n as f64 - 1.0)).sqrt();
    let tail = normal_cdf(-expand * t_quantile(0.5 + 0.5 * level, n as f64 - 1.0));
    (sorted_quantile(draws, tail), sorted_quantile(draws, 1.0 - tail))
}

/// Linear interpolation between order statistics.
fn sorted_quantile(sorted: &[f64], p: f64) -> f64 {
    let place = p.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + (place - low as f64) * (sorted[high] - sorted[low])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::gaussians;
    use approx::assert_relative_eq;

    fn from_differences(d: &[f64]) -> Vec<RecordError> {
        d.iter().map(|x| RecordError { before: 1.0, after: (2.0 * x).exp() }).collect()
    }

    #[test]
    fn few_records_use_student() {
        let gain = log_rmse_gain(&from_differences(&[-0.1, -0.2, -0.3]), 0.9, 1000, 1).unwrap();
        assert_eq!(gain.kind, IntervalKind::StudentT);
        assert_relative_eq!(gain.difference, -0.2, max_relative = 1e-12);
        // t_{0.95, 2} = 2.919986, s = 0.1
        assert_relative_eq!(gain.upper, -0.2 + 2.919_986 * 0.1 / 3.0_f64.sqrt(), max_relative = 1e-6);
        assert!(gain.is_gain());
        let one = log_rmse_gain(&from_differences(&[-0.1]), 0.9, 1000, 1).unwrap();
        assert_eq!(one.kind, IntervalKind::None);
        assert!(!one.is_gain());
    }

    #[test]
    fn blocks_of_one_record_are_resampled() {
        let blocks: Vec<RecordError> =
            gaussians(8, 3).iter().map(|x| RecordError { before: 1.0 + 0.1 * x, after: 0.25 * (1.0 - 0.1 * x) }).collect();
        let gain = log_rmse_gain_of_blocks(&blocks, 0.9, 1000, 1).unwrap();
        assert_eq!((gain.kind, gain.improved), (IntervalKind::Blocks, 8));
        assert!(gain.lower < gain.difference && gain.difference < gain.upper && gain.is_gain());
        assert!((gain.difference / 0.5_f64.ln() - 1.0).abs() < 0.2);
        assert!(log_rmse_gain_of_blocks(&blocks[..3], 0.9, 1000, 1).is_err());
    }

    #[test]
    fn same_seed_same_interval_and_bad_input() {
        let d = from_differences(&gaussians(14, 2));
        assert_eq!(log_rmse_gain(&d, 0.9, 500, 7).unwrap(), log_rmse_gain(&d, 0.9, 500, 7).unwrap());
        assert!(log_rmse_gain(&[RecordError { before: 0.0, after: 1.0 }], 0.9, 100, 1).is_err());
        assert!(log_rmse_gain(&[], 0.9, 100, 1).is_err());
    }

    #[test]
    fn covers_ninety_percent() {
        for n in [6, 14] {
            let covered = (0..600)
                .filter(|seed| {
                    let d: Vec<f64> = gaussians(n, 1000 + seed).iter().map(|x| 0.3 * x - 0.1).collect();
                    let gain = log_rmse_gain(&from_differences(&d), 0.9, 400, *seed).unwrap();
                    gain.lower < -0.1 && -0.1 < gain.upper
                })
                .count();
            assert!((505..=575).contains(&covered), "n = {n}: {covered}/600");
        }
    }
}
