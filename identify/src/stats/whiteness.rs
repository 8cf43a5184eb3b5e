//! Is a residual white, and does it depend on an input?
//!
//! Colour alone may be the sensor; dependence on the *input* is the evidence for missing dynamics. Both tests pool records
//! without joining them.
//!
//! References: Ljung & Box (1978); Bartlett (1946) for the variance of a cross-correlation of two coloured series.

use super::ar::{ArModel, ArOptions, Order};
use super::constants::STATS;
use super::dist::{chi2_sf, normal_sf};
use super::error::{StatsError, check_slice};
use serde::Serialize;

/// One channel's Ljung–Box test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LjungBox {
    /// Q.
    pub statistic: f64,
    /// lags − fitted AR coefficients.
    pub dof: usize,
    /// P(χ²_dof > Q).
    pub p: f64,
    /// ρ_1..ρ_lags of the channel.
    pub autocorrelation: Vec<f64>,
}

/// Ljung–Box test per channel; `records[r]` row-major time × channel, `fitted` the AR order already taken out.
///
/// Q = N (N + 2)/N · Σ_k ρ_k² N / Σ_r (n_r − k), which is the usual n(n+2) Σ ρ_k²/(n − k) for one record; ~ χ² with
/// lags − fitted degrees of freedom for white noise. The mean is *not* subtracted: a mean counts as colour.
///
/// # Errors
/// Shapes that do not fit, lags ≤ fitted, or no record longer than the lags.
pub fn ljung_box(records: &[&[f64]], channels: usize, lags: usize, fitted: usize) -> Result<Vec<LjungBox>, StatsError> {
    if channels == 0 || lags <= fitted {
        return Err(StatsError::TooFew { what: "lags", found: lags, needed: fitted + 1 });
    }
    let mut total = 0;
    for record in records {
        check_slice("record", record, record.len().div_ceil(channels) * channels)?;
        total += record.len() / channels;
    }
    let longest = records.iter().map(|r| r.len() / channels).max().unwrap_or(0);
    if longest <= lags {
        return Err(StatsError::TooFew { what: "samples", found: longest, needed: lags + 1 });
    }
    let pairs = |k: usize| records.iter().map(|r| (r.len() / channels).saturating_sub(k)).sum::<usize>() as f64;
    let n = total as f64;
    let test = |c: usize| {
        let series: Vec<Vec<f64>> = records.iter().map(|r| channel(r, channels, c)).collect();
        let power = autocovariance(&series, 0);
        let rho: Vec<f64> = (1..=lags).map(|k| if power > 0.0 { autocovariance(&series, k) / power } else { 0.0 }).collect();
        let weighted: f64 = rho.iter().enumerate().map(|(i, r)| r * r / pairs(i + 1).max(1.0)).sum();
        let statistic = n * (n + 2.0) * weighted;
        let dof = lags - fitted;
        LjungBox { statistic, dof, p: chi2_sf(statistic, dof as f64), autocorrelation: rho }
    };
    Ok((0..channels).map(test).collect())
}

/// One channel of a row-major time × channel record.
pub fn channel(record: &[f64], channels: usize, c: usize) -> Vec<f64> {
    record.iter().skip(c).step_by(channels.max(1)).copied().collect()
}

/// Σ over records and times of x_t x_{t+k} (not divided).
fn autocovariance(series: &[Vec<f64>], k: usize) -> f64 {
    series.iter().map(|x| x.iter().zip(x.iter().skip(k)).map(|(a, b)| a * b).sum::<f64>()).sum()
}

/// Cross-correlation of a residual with the past of an input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrossCorrelation {
    /// Correlation of residual(t) with input(t − k), k = 0..=lags.
    pub values: Vec<f64>,
    /// Standard deviation of a value if residual and input were independent, colour of both included.
    pub sd: f64,
    /// Lag of the largest |value|.
    pub peak_lag: usize,
    /// That value / sd.
    pub peak_z: f64,
    /// Two-sided p of the peak, Bonferroni over the lags.
    pub p: f64,
}

impl CrossCorrelation {
    /// Half width of the 99 % band of one lag.
    pub fn bound_99(&self) -> f64 {
        2.575_829_303_548_901 * self.sd
    }
}

/// Cross-correlation of a residual channel with an input channel, over records given as (residual, input) series.
///
/// Means are subtracted per record. Bartlett: Var(ρ_eu(k)) ≈ Σ_j ρ_ee(j) ρ_uu(j) Σ_r (n_r − |j|)₊ / N²; ρ_ee from an AR
/// model fitted to the residual (BIC, order ≤ 8), ρ_uu as measured. With white residual this is 1/N; with residual and
/// input both slow it is many times wider, and a plain 1/√N band would nearly always be crossed.
/// Limits: an input that is constant within every record tells nothing (p = 1).
///
/// # Errors
/// Residual and input of different length, numbers that are not finite, or no record longer than the lags.
pub fn cross_correlation(records: &[(&[f64], &[f64])], lags: usize) -> Result<CrossCorrelation, StatsError> {
    for (residual, input) in records {
        check_slice("residual", residual, residual.len())?;
        check_slice("input", input, residual.len())?;
    }
    let longest = records.iter().map(|r| r.0.len()).max().unwrap_or(0);
    if longest <= lags {
        return Err(StatsError::TooFew { what: "samples", found: longest, needed: lags + 1 });
    }
    let residual: Vec<Vec<f64>> = records.iter().map(|r| centred(r.0)).collect();
    let input: Vec<Vec<f64>> = records.iter().map(|r| centred(r.1)).collect();
    let norm = (autocovariance(&residual, 0) * autocovariance(&input, 0)).sqrt();
    if norm <= 0.0 {
        return Ok(CrossCorrelation { values: vec![0.0; lags + 1], sd: f64::INFINITY, peak_lag: 0, peak_z: 0.0, p: 1.0 });
    }
    let value = |k: usize| {
        let sum: f64 = residual.iter().zip(&input).map(|(e, u)| e.iter().skip(k).zip(u).map(|(a, b)| a * b).sum::<f64>()).sum();
        sum / norm
    };
    let values: Vec<f64> = (0..=lags).map(value).collect();
    let sd = bartlett_sd(&residual, &input)?;
    let peak_lag = (0..=lags).max_by(|&a, &b| values[a].abs().total_cmp(&values[b].abs())).unwrap_or(0);
    let peak_z = values[peak_lag] / sd;
    let p = (2.0 * normal_sf(peak_z.abs()) * (lags + 1) as f64).min(1.0);
    Ok(CrossCorrelation { values, sd, peak_lag, peak_z, p })
}

fn centred(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter().map(|v| v - mean).collect()
}

fn bartlett_sd(residual: &[Vec<f64>], input: &[Vec<f64>]) -> Result<f64, StatsError> {
    let views: Vec<&[f64]> = residual.iter().map(Vec::as_slice).collect();
    let model = ArModel::fit(&views, 1, &ArOptions { order: Order::Bic { max: STATS.correlated_order }, ..Default::default() })?;
    let longest = residual.iter().map(Vec::len).max().unwrap_or(1);
    let rho_e = model.autocorrelation(longest - 1);
    let power = autocovariance(input, 0);
    let n: f64 = residual.iter().map(|r| r.len() as f64).sum();
    let mut sum = n;
    for (j, rho) in rho_e.iter().enumerate().skip(1) {
        // autocovariance(j) already carries the (n_r − j) pairs.
        sum += 2.0 * rho * autocovariance(input, j) / power * n;
        if rho.abs() < STATS.forgotten
            && rho_e[j.saturating_sub(STATS.correlated_order)..j].iter().all(|r| r.abs() < STATS.forgotten)
        {
            break;
        }
    }
    // Never below a tenth of the white variance: a sum of alternating terms is not trusted that far.
    Ok((sum.max(STATS.least_bartlett * n)).sqrt() / n)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::{ar_series, gaussians};
    use approx::assert_relative_eq;

    #[test]
    fn ljung_box_matches_the_textbook_form_and_its_level() {
        let x = gaussians(100, 1);
        let test = &ljung_box(&[&x], 1, 5, 0).unwrap()[0];
        let c = |k: usize| x.iter().zip(&x[k..]).map(|(a, b)| a * b).sum::<f64>();
        let q: f64 = (1..=5).map(|k| 100.0 * 102.0 * (c(k) / c(0)).powi(2) / (100 - k) as f64).sum();
        assert_relative_eq!(test.statistic, q, max_relative = 1e-12);
        let rejected = (0..1000).filter(|s| ljung_box(&[&gaussians(300, *s)], 1, 10, 0).unwrap()[0].p < 0.05).count();
        assert!((30..=75).contains(&rejected), "{rejected}/1000");
        let coloured = ar_series(&[0.3], 300, &[1.0, 1.0], 1);
        assert!(ljung_box(&[&coloured], 2, 10, 0).unwrap().iter().all(|t| t.p < 1e-3));
        assert!(ljung_box(&[&x], 1, 3, 3).is_err());
    }

    #[test]
    fn ljung_box_after_whitening_counts_the_fitted_order() {
        let rejected = (0..400)
            .filter(|s| {
                let mut x = ar_series(&[0.9], 400, &[1.0], *s);
                let fit = ArOptions { order: Order::Fixed(1), ..Default::default() };
                ArModel::fit(&[&x], 1, &fit).unwrap().whiten(&mut x, 1).unwrap();
                ljung_box(&[&x], 1, 6, 1).unwrap()[0].p < 0.05
            })
            .count();
        assert!((8..=34).contains(&rejected), "{rejected}/400");
    }

    #[test]
    fn cross_correlation_survives_colour_and_sees_dependence() {
        let mut false_alarms = 0;
        for seed in 0..300 {
            let e = ar_series(&[0.9], 500, &[1.0], seed);
            let u = ar_series(&[1.6, -0.64], 500, &[1.0], 10_000 + seed);
            false_alarms += usize::from(cross_correlation(&[(&e, &u)], 20).unwrap().p < 0.05);
        }
        assert!(false_alarms <= 24, "{false_alarms}/300");
        let e = ar_series(&[0.5], 500, &[1.0], 1);
        let u = ar_series(&[0.9], 500, &[1.0], 2);
        let prescribed: Vec<f64> = (0..500).map(|t| e[t] + if t >= 4 { 0.3 * u[t - 4] } else { 0.0 }).collect();
        let seen = cross_correlation(&[(&prescribed, &u)], 20).unwrap();
        assert!(seen.p < 1e-3 && seen.peak_lag.abs_diff(4) <= 1, "{} {}", seen.p, seen.peak_lag);
        assert_eq!(cross_correlation(&[(&e, &[1.0; 500])], 5).unwrap().p, 1.0);
    }
}
