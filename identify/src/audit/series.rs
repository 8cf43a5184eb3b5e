//! Robust descriptions of short series. Empty input gives zero, never a panic.

use crate::stats::MAD_TO_SIGMA;

/// Quantile with linear interpolation.
pub(crate) fn quantile(values: &[f64], p: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = p * (sorted.len() - 1) as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + (place - low as f64) * (sorted[high] - sorted[low])
}

pub(crate) fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Robust standard deviation: MAD · 1.4826.
pub(crate) fn spread(values: &[f64]) -> f64 {
    let center = median(values);
    MAD_TO_SIGMA * median(&values.iter().map(|x| (x - center).abs()).collect::<Vec<_>>())
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt() }
}

/// σ of white noise on a smooth signal from fourth differences, √70 = |(1, −4, 6, −4, 1)|: robust (MAD) unless most
/// differences vanish on a quantised channel, then by their rms.
pub(crate) fn noise_sigma(series: &[f64]) -> f64 {
    let fourth: Vec<f64> = series.windows(5).map(|w| w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).collect();
    let robust = MAD_TO_SIGMA * median(&fourth.iter().map(|x| x.abs()).collect::<Vec<_>>());
    let sigma = if robust > 0.0 { robust } else { rms(&fourth) };
    sigma / 70.0_f64.sqrt()
}

/// Runs of consecutive indices (start, end inclusive), where gaps of at most `bridge` indices are bridged.
pub(crate) fn runs(indices: &[usize], bridge: usize) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for &i in indices {
        match out.last_mut() {
            Some(last) if i <= last.1 + 1 + bridge => last.1 = i,
            _ => out.push((i, i)),
        }
    }
    out
}

pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::testing::gaussians;

    #[test]
    fn noise_on_a_smooth_signal() {
        let x: Vec<f64> = gaussians(2000, 1).iter().enumerate().map(|(t, e)| (t as f64 * 0.05).sin() + 1e-3 * e).collect();
        assert!((noise_sigma(&x) / 1e-3 - 1.0).abs() < 0.1);
        assert_eq!(noise_sigma(&[]), 0.0);
    }

    #[test]
    fn robust_numbers() {
        assert_eq!(median(&[3.0, 1.0, 2.0, 10.0]), 2.5);
        assert_eq!(quantile(&[0.0, 1.0], 0.25), 0.25);
        assert_eq!(spread(&[1.0, 1.0, 1.0, 50.0]), 0.0);
        assert_eq!(runs(&[1, 2, 5, 9, 10], 2), vec![(1, 5), (9, 10)]);
    }
}
