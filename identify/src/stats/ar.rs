//! Autoregressive noise: fitted by pooled Burg recursion, whitened exactly from the first sample on.
//!
//! x_{t,c} = Σ_{i=1..p} φ_i x_{t−i,c} + σ_c e_{t,c},  e independent, mean 0, variance 1.
//!
//! φ is common to all channels c of all records (records are not joined), σ_c [unit of channel c] is the innovation
//! standard deviation. A residual of exactly 0 says that nothing was measured: it counts neither for σ_c nor for the likelihood. The model lives in its reflection coefficients (partial autocorrelations) k_1..k_p: |k_i| < 1 is
//! stationarity, and Levinson's recursion gives from them the predictors of every lower order, which is the Cholesky factor
//! of the stationary covariance without ever forming it.
//!
//! Why it matters: a test that takes noise of φ = 0.9 for white raises a false alarm nearly always.
//! Reference: Burg (1967); Brockwell & Davis, Time Series (1991), §5.2 and §8.2; pooled over segments: de Waele & Broersen (2000).

use super::constants::STATS;
use super::dist::gaussian;
use super::error::{StatsError, check_slice};
use rand::RngExt;

/// Choice of the model's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Given.
    Fixed(usize),
    /// The smallest BIC among orders 0 to `max`, from the exact Gaussian likelihood.
    Bic {
        /// Largest order tried.
        max: usize,
    },
}

/// Options of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct ArOptions {
    /// Order of the model.
    pub order: Order,
    /// Floor of σ_c [unit of the channel]: one number for all channels, one per channel, or none.
    /// A marker quantised in steps Δ cannot have less noise than Δ/√12.
    pub sigma_floor: Vec<f64>,
    /// Degrees of freedom that an earlier fit took out of the residual: σ² is multiplied by N / (N − lost).
    pub lost_dof: usize,
}

impl Default for ArOptions {
    fn default() -> Self {
        Self { order: Order::Bic { max: STATS.noise_order }, sigma_floor: Vec::new(), lost_dof: 0 }
    }
}

/// A stationary AR(p) model with a common φ and one σ per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ArModel {
    /// k_1..k_p, dimensionless, |k| ≤ 0.999 when fitted.
    reflection: Vec<f64>,
    /// `predictors[m]` = coefficients of the best linear prediction from the last m samples, m = 0..=p.
    predictors: Vec<Vec<f64>>,
    /// `spread[m]` = standard deviation of that prediction's error over σ; `spread[p]` = 1.
    spread: Vec<f64>,
    sigma: Vec<f64>,
}

impl ArModel {
    /// The model with the given partial autocorrelations and innovation standard deviations.
    ///
    /// # Errors
    /// |k| ≥ 1, or a σ that is not positive.
    pub fn from_reflection(reflection: &[f64], sigma: Vec<f64>) -> Result<Self, StatsError> {
        if let Some(&value) = reflection.iter().find(|k| k.is_nan() || k.abs() >= 1.0) {
            return Err(StatsError::OutOfRange { what: "reflection coefficient", value, range: "(-1, 1)" });
        }
        if let Some(&value) = sigma.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
            return Err(StatsError::OutOfRange { what: "innovation sigma", value, range: "positive" });
        }
        let mut predictors = vec![Vec::new()];
        for (m, &k) in reflection.iter().enumerate() {
            let last = &predictors[m];
            let mut next: Vec<f64> = (0..m).map(|i| last[i] - k * last[m - 1 - i]).collect();
            next.push(k);
            predictors.push(next);
        }
        let mut spread = vec![1.0; reflection.len() + 1];
        for m in (0..reflection.len()).rev() {
            spread[m] = spread[m + 1] / (1.0 - reflection[m] * reflection[m]).sqrt();
        }
        Ok(Self { reflection: reflection.to_vec(), predictors, spread, sigma })
    }

    /// White noise of the given standard deviations.
    ///
    /// # Errors
    /// A σ that is not positive.
    pub fn white(sigma: Vec<f64>) -> Result<Self, StatsError> {
        Self::from_reflection(&[], sigma)
    }

    /// Fits the model to residuals; `records[r]` is row-major time × channel.
    ///
    /// The mean is *not* taken out: a residual with a mean is model error, and is counted as slow noise.
    ///
    /// # Errors
    /// Lengths that are no multiple of `channels`, numbers that are not finite, no data, a floor list of the wrong length,
    /// or a channel of zeros without a floor.
    pub fn fit(records: &[&[f64]], channels: usize, options: &ArOptions) -> Result<Self, StatsError> {
        check_records(records, channels)?;
        let seen = seen(records, channels);
        let floor = floors(&options.sigma_floor, channels)?;
        let mut scale = channel_rms(records, channels, &seen, &floor)?;
        let orders = match options.order {
            Order::Fixed(p) => p..=p,
            Order::Bic { max } => 0..=max,
        };
        let total = seen.iter().sum::<f64>().max(1.0);
        let inflate = (total / (total - options.lost_dof as f64).max(1.0)).sqrt();
        let mut best: Option<(f64, Self)> = None;
        for p in orders {
            let model = Self::fit_order(records, &seen, p, &floor, &mut scale)?;
            let bic = model.minus_two_log_likelihood(records)? + p as f64 * total.ln();
            if best.as_ref().is_none_or(|(b, _)| bic < *b) {
                best = Some((bic, model));
            }
        }
        let (_, mut model) = best.ok_or(StatsError::TooFew { what: "orders", found: 0, needed: 1 })?;
        model.sigma.iter_mut().zip(&floor).for_each(|(s, f)| *s = (*s * inflate).max(*f));
        Ok(model)
    }

    /// One order: reflection coefficients with channels weighted by 1/scale², then σ_c, twice so that the weights settle.
    fn fit_order(records: &[&[f64]], seen: &[f64], p: usize, floor: &[f64], scale: &mut [f64]) -> Result<Self, StatsError> {
        let channels = seen.len();
        let mut model = Self::white(scale.to_vec())?;
        for _ in 0..STATS.weight_passes {
            let reflection = burg(records, channels, p, scale);
            model = Self::from_reflection(&reflection, vec![1.0; channels])?;
            let mut sum = vec![0.0; channels];
            for record in records {
                let mut white = record.to_vec();
                model.whiten(&mut white, channels)?;
                white.chunks_exact(channels).for_each(|row| row.iter().zip(&mut sum).for_each(|(x, s)| *s += x * x));
            }
            for (((s, f), q), n) in scale.iter_mut().zip(floor).zip(&sum).zip(seen) {
                *s = (q / n.max(1.0)).sqrt().max(*f).max(f64::MIN_POSITIVE.sqrt());
            }
            model.sigma = scale.to_vec();
        }
        Ok(model)
    }

    /// p.
    pub fn order(&self) -> usize {
        self.reflection.len()
    }

    /// Partial autocorrelations k_1..k_p.
    pub fn reflection(&self) -> &[f64] {
        &self.reflection
    }

    /// φ_1..φ_p.
    pub fn coefficients(&self) -> &[f64] {
        &self.predictors[self.order()]
    }

    /// Innovation standard deviations σ_c [unit of the channel].
    pub fn sigma(&self) -> &[f64] {
        &self.sigma
    }

    /// Stationary standard deviation over σ_c, ≥ 1.
    pub fn stationary_ratio(&self) -> f64 {
        self.spread[0]
    }

    /// Stationary autocorrelations at lags 0..=`lags`.
    pub fn autocorrelation(&self, lags: usize) -> Vec<f64> {
        let mut rho = vec![1.0; lags + 1];
        for lag in 1..=lags {
            // Yule–Walker with the predictor of order min(lag, p): exact also below p.
            let phi = &self.predictors[lag.min(self.order())];
            rho[lag] = phi.iter().enumerate().map(|(i, f)| f * rho[lag - 1 - i]).sum();
        }
        rho
    }

    /// Number of independent samples whose mean is as uncertain as that of `n` correlated ones:
    /// n_eff = n · Var(x) (1 − Σφ)² / σ², for n much longer than the correlation. It speaks of slow signals only; it
    /// exceeds n where the noise alternates.
    pub fn effective_samples(&self, n: usize) -> f64 {
        let gain = 1.0 - self.coefficients().iter().sum::<f64>();
        n as f64 * (self.spread[0] * gain).powi(2)
    }

    /// Whitens a record (row-major time × channel) in place: afterwards every entry has variance 1 under the model and none
    /// is correlated with another, the first p included (their stationary prediction errors).
    ///
    /// # Errors
    /// A length that is no multiple of `channels`, or `channels` other than the model's.
    pub fn whiten(&self, series: &mut [f64], channels: usize) -> Result<(), StatsError> {
        self.whiten_columns(series, channels, 1)
    }

    /// Whitens each column of a row-major (time · channel) × `columns` matrix in place, e.g. a Jacobian of one record.
    ///
    /// # Errors
    /// As [`ArModel::whiten`].
    pub fn whiten_columns(&self, matrix: &mut [f64], channels: usize, columns: usize) -> Result<(), StatsError> {
        if channels != self.sigma.len() {
            return Err(StatsError::Length { what: "channels of the noise model", found: self.sigma.len(), expected: channels });
        }
        let stride = channels * columns;
        if stride == 0 || !matrix.len().is_multiple_of(stride) {
            return Err(StatsError::Length { what: "series to whiten", found: matrix.len(), expected: stride });
        }
        // Backwards in time, so that the samples a prediction needs are still the measured ones.
        for t in (0..matrix.len() / stride).rev() {
            let m = t.min(self.order());
            let (past, rest) = matrix.split_at_mut(t * stride);
            let row = &mut rest[..stride];
            for (i, &phi) in self.predictors[m].iter().enumerate() {
                let earlier = &past[(t - 1 - i) * stride..(t - i) * stride];
                row.iter_mut().zip(earlier).for_each(|(x, e)| *x -= phi * e);
            }
            for (block, sigma) in row.chunks_exact_mut(columns).zip(&self.sigma) {
                let weight = 1.0 / (sigma * self.spread[m]);
                block.iter_mut().for_each(|x| *x *= weight);
            }
        }
        Ok(())
    }

    /// A stationary series of `times` samples, row-major time × channel.
    pub fn sample(&self, times: usize, rng: &mut impl RngExt) -> Vec<f64> {
        let channels = self.sigma.len();
        let mut x: Vec<f64> = Vec::with_capacity(times * channels);
        for t in 0..times {
            let m = t.min(self.order());
            for (c, sigma) in self.sigma.iter().enumerate() {
                let memory: f64 = self.predictors[m].iter().enumerate().map(|(i, phi)| phi * x[(t - 1 - i) * channels + c]).sum();
                x.push(memory + sigma * self.spread[m] * gaussian(rng));
            }
        }
        x
    }

    /// −2 log L of records (row-major time × channel) up to the constant N log 2π, exact Gaussian likelihood.
    ///
    /// # Errors
    /// As [`ArModel::whiten`].
    pub fn minus_two_log_likelihood(&self, records: &[&[f64]]) -> Result<f64, StatsError> {
        let channels = self.sigma.len();
        let log_sigma =
            |record: &[f64]| -> f64 { seen(&[record], channels).iter().zip(&self.sigma).map(|(n, s)| n * s.ln()).sum() };
        let mut total = 0.0;
        for record in records {
            let mut white = record.to_vec();
            self.whiten(&mut white, channels)?;
            total += white.iter().map(|x| x * x).sum::<f64>();
            let rows = record.len() / channels;
            let start: f64 = self.spread.iter().take(rows.min(self.order())).map(|s| s.ln()).sum();
            total += 2.0 * (log_sigma(record) + channels as f64 * start);
        }
        Ok(total)
    }
}

/// Checks every record, and that there are samples.
fn check_records(records: &[&[f64]], channels: usize) -> Result<(), StatsError> {
    if channels == 0 {
        return Err(StatsError::TooFew { what: "channels", found: 0, needed: 1 });
    }
    let mut rows = 0;
    for record in records {
        check_slice("record", record, record.len().div_ceil(channels) * channels)?;
        rows += record.len() / channels;
    }
    if rows == 0 {
        return Err(StatsError::TooFew { what: "samples", found: 0, needed: 1 });
    }
    Ok(())
}

fn floors(given: &[f64], channels: usize) -> Result<Vec<f64>, StatsError> {
    match given.len() {
        0 => Ok(vec![0.0; channels]),
        1 => Ok(vec![given[0].max(0.0); channels]),
        n if n == channels => Ok(given.iter().map(|f| f.max(0.0)).collect()),
        found => Err(StatsError::Length { what: "sigma_floor", found, expected: channels }),
    }
}

/// Number of measured samples of each channel.
fn seen(records: &[&[f64]], channels: usize) -> Vec<f64> {
    let mut count = vec![0.0; channels];
    for row in records.iter().flat_map(|r| r.chunks_exact(channels)) {
        row.iter().zip(&mut count).for_each(|(x, n)| *n += f64::from(u8::from(*x != 0.0)));
    }
    count
}

fn channel_rms(records: &[&[f64]], channels: usize, seen: &[f64], floor: &[f64]) -> Result<Vec<f64>, StatsError> {
    let mut sum = vec![0.0; channels];
    for row in records.iter().flat_map(|r| r.chunks_exact(channels)) {
        row.iter().zip(&mut sum).for_each(|(x, s)| *s += x * x);
    }
    let rms = |channel: usize| (sum[channel] / seen[channel].max(1.0)).sqrt().max(floor[channel]);
    (0..channels).map(|c| if rms(c) > 0.0 { Ok(rms(c)) } else { Err(StatsError::DeadChannel { channel: c }) }).collect()
}

/// Reflection coefficients k_m = 2 Σ f b / Σ (f² + b²), the sums over channels and records with weight 1/scale_c².
/// Each lies in [−1, 1] by the inequality of the means, and is then held inside the limit.
fn burg(records: &[&[f64]], channels: usize, p: usize, scale: &[f64]) -> Vec<f64> {
    let normalised = |record: &&[f64]| -> Vec<f64> {
        record.chunks_exact(channels).flat_map(|row| row.iter().zip(scale).map(|(x, s)| x / s)).collect()
    };
    let mut forward: Vec<Vec<f64>> = records.iter().map(normalised).collect();
    let mut backward = forward.clone();
    let mut reflection = Vec::with_capacity(p);
    for m in 1..=p {
        let (mut cross, mut power) = (0.0, 0.0);
        for (f, b) in forward.iter().zip(&backward) {
            for (x, y) in f.iter().skip(m * channels).zip(b.iter().skip((m - 1) * channels)) {
                cross += x * y;
                power += x * x + y * y;
            }
        }
        let k = if power > 0.0 { (2.0 * cross / power).clamp(-STATS.reflection_limit, STATS.reflection_limit) } else { 0.0 };
        for (f, b) in forward.iter_mut().zip(&mut backward) {
            // b at t is made from b at t − 1, hence backwards in time.
            for i in (m * channels..f.len()).rev() {
                let (x, y) = (f[i], b[i - channels]);
                f[i] = x - k * y;
                b[i] = y - k * x;
            }
        }
        reflection.push(k);
    }
    reflection
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::{ar_series, gaussians};
    use approx::assert_relative_eq;
    use nalgebra::{Cholesky, DMatrix, DVector};
    use rand::SeedableRng;

    #[test]
    fn recovers_ar2_over_records_and_channels() {
        // φ = (1.2, −0.5): k_2 = −0.5, k_1 = 1.2 / 1.5 = 0.8
        let truth = ArModel::from_reflection(&[0.8, -0.5], vec![1.0]).unwrap();
        assert_relative_eq!(truth.coefficients()[0], 1.2, max_relative = 1e-14);
        let records: Vec<Vec<f64>> = (0..4).map(|seed| ar_series(&[1.2, -0.5], 400, &[0.3, 2.0], seed)).collect();
        let views: Vec<&[f64]> = records.iter().map(Vec::as_slice).collect();
        let model = ArModel::fit(&views, 2, &ArOptions::default()).unwrap();
        assert_eq!(model.order(), 2);
        assert_relative_eq!(model.coefficients()[0], 1.2, epsilon = 0.05);
        assert_relative_eq!(model.coefficients()[1], -0.5, epsilon = 0.05);
        assert_relative_eq!(model.sigma()[0], 0.3, max_relative = 0.05);
        assert_relative_eq!(model.sigma()[1], 2.0, max_relative = 0.05);
    }

    #[test]
    fn whitening_is_the_inverse_cholesky_factor() {
        let model = ArModel::from_reflection(&[0.7, -0.4, 0.2], vec![0.5]).unwrap();
        let n = 8;
        let rho = model.autocorrelation(n);
        let variance = (0.5 * model.stationary_ratio()).powi(2);
        let covariance = DMatrix::from_fn(n, n, |i, j| variance * rho[i.abs_diff(j)]);
        let factor = Cholesky::new(covariance).unwrap().l();
        let x = DVector::from_vec(gaussians(n, 5));
        let expected = factor.solve_lower_triangular(&x).unwrap();
        let mut found = x.as_slice().to_vec();
        model.whiten(&mut found, 1).unwrap();
        for (a, b) in found.iter().zip(expected.iter()) {
            assert_relative_eq!(*a, *b, epsilon = 1e-12);
        }
        // The likelihood's determinant is the same factor's.
        let log_det: f64 = 2.0 * factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let likelihood = model.minus_two_log_likelihood(&[x.as_slice()]).unwrap();
        assert_relative_eq!(likelihood, log_det + expected.norm_squared(), epsilon = 1e-11);
    }

    #[test]
    fn columns_are_whitened_as_series() {
        let model = ArModel::from_reflection(&[0.9, -0.3], vec![0.5, 2.0]).unwrap();
        let (times, channels, columns) = (7, 2, 3);
        let matrix = gaussians(times * channels * columns, 9);
        let mut white = matrix.clone();
        model.whiten_columns(&mut white, channels, columns).unwrap();
        for column in 0..columns {
            let mut series: Vec<f64> = matrix.iter().skip(column).step_by(columns).copied().collect();
            model.whiten(&mut series, channels).unwrap();
            for (a, b) in series.iter().zip(white.iter().skip(column).step_by(columns)) {
                assert_relative_eq!(*a, *b, epsilon = 1e-14);
            }
        }
    }

    #[test]
    fn near_unit_root_stays_stationary() {
        let ramp: Vec<f64> = (0..300).map(|t| f64::from(t) * 0.1).collect();
        let model = ArModel::fit(&[&ramp], 1, &ArOptions { order: Order::Fixed(2), ..Default::default() }).unwrap();
        assert!(model.reflection().iter().all(|k| k.abs() <= STATS.reflection_limit));
        let slow = ArModel::from_reflection(&[0.98], vec![1.0]).unwrap();
        assert_relative_eq!(slow.effective_samples(300), 300.0 * 0.02 / 1.98, max_relative = 1e-12);
    }

    #[test]
    fn bic_takes_white_for_white_and_floors_hold() {
        let x = gaussians(2000, 3);
        let options = ArOptions { sigma_floor: vec![3.0], ..Default::default() };
        let model = ArModel::fit(&[&x], 1, &options).unwrap();
        assert_eq!(model.order(), 0);
        assert_relative_eq!(model.sigma()[0], 3.0);
        let zeros = [0.0; 20];
        assert_eq!(ArModel::fit(&[&zeros], 2, &ArOptions::default()), Err(StatsError::DeadChannel { channel: 0 }));
        assert!(ArModel::fit(&[&zeros], 2, &options).is_ok());
        assert!(ArModel::fit(&[&x[..7]], 2, &options).is_err());
    }

    #[test]
    fn a_sample_has_the_models_own_covariance() {
        let model = ArModel::from_reflection(&[0.8, -0.3], vec![2.0]).unwrap();
        let mut rng = rand_pcg::Pcg64::seed_from_u64(7);
        let lag = |x: &[f64], k: usize| x[k..].iter().zip(x).map(|(a, b)| a * b).sum::<f64>() / (x.len() - k) as f64;
        let x = model.sample(200_000, &mut rng);
        let variance = (2.0 * model.stationary_ratio()).powi(2);
        assert_relative_eq!(lag(&x, 0), variance, max_relative = 0.03);
        for (k, rho) in model.autocorrelation(3).into_iter().enumerate() {
            assert!((lag(&x, k) / variance - rho).abs() < 0.03, "lag {k}");
        }
        // the first sample is as wide as any other
        let first = (0..20_000).map(|_| model.sample(1, &mut rng)[0].powi(2)).sum::<f64>() / 20_000.0;
        assert_relative_eq!(first, variance, max_relative = 0.05);
    }

    #[test]
    fn what_was_not_measured_is_not_taken_for_silence() {
        let (x, rare) = (gaussians(400, 6), 10);
        let missing: Vec<f64> = (0..800).map(|i| if i % 2 == 1 && i / 2 % rare > 0 { 0.0 } else { x[i / 2] }).collect();
        let options = ArOptions { order: Order::Fixed(0), ..Default::default() };
        let model = ArModel::fit(&[&missing], 2, &options).unwrap();
        let kept: Vec<f64> = x.iter().step_by(rare).copied().collect();
        let alone = ArModel::fit(&[&kept], 1, &options).unwrap();
        assert_relative_eq!(model.sigma()[1], alone.sigma()[0], max_relative = 1e-12);
        let full = ArModel::fit(&[&x], 1, &options).unwrap();
        let parts = full.minus_two_log_likelihood(&[&x]).unwrap() + alone.minus_two_log_likelihood(&[&kept]).unwrap();
        assert_relative_eq!(model.minus_two_log_likelihood(&[&missing]).unwrap(), parts, max_relative = 1e-12);
    }

    #[test]
    fn lost_degrees_of_freedom_widen_sigma() {
        let x = gaussians(100, 4);
        let plain = ArModel::fit(&[&x], 1, &ArOptions { order: Order::Fixed(0), ..Default::default() }).unwrap();
        let lost = ArModel::fit(&[&x], 1, &ArOptions { order: Order::Fixed(0), lost_dof: 19, ..Default::default() }).unwrap();
        assert_relative_eq!(lost.sigma()[0] / plain.sigma()[0], (100.0_f64 / 81.0).sqrt(), max_relative = 1e-12);
    }
}
