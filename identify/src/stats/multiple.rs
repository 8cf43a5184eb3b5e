//! Many tests at once, and bounds on a proportion.

use super::dist::beta_quantile;
use super::error::StatsError;

/// Holm's step-down adjusted p-values, in the order given.
///
/// With p₍₁₎ ≤ … ≤ p₍ₘ₎: p̃₍ᵢ₎ = max_{l ≤ i} min(1, (m − l + 1) p₍ₗ₎). Rejecting where p̃ ≤ α keeps the family-wise error
/// at α under any dependence (Holm 1979). A NaN counts as 1: a test that could not be made rejects nothing, yet counts in m.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let clean: Vec<f64> = p.iter().map(|&x| if x.is_nan() { 1.0 } else { x.clamp(0.0, 1.0) }).collect();
    let mut order: Vec<usize> = (0..clean.len()).collect();
    order.sort_by(|&a, &b| clean[a].total_cmp(&clean[b]).then(a.cmp(&b)));
    let mut adjusted = vec![1.0; clean.len()];
    let mut running = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        let remaining = (clean.len() - rank) as f64;
        running = running.max((remaining * clean[index]).min(1.0));
        adjusted[index] = running;
    }
    adjusted
}

/// Clopper–Pearson interval (lower, upper) of a proportion after `successes` in `trials`, two-sided at `level`.
///
/// lower = Beta⁻¹(α/2; k, n−k+1), upper = Beta⁻¹(1−α/2; k+1, n−k), α = 1 − level; 0 at k = 0 and 1 at k = n.
/// Coverage is at least `level` (Clopper & Pearson 1934). For a one-sided bound at 95 % ask for level 0.90.
///
/// # Errors
/// `trials` = 0, `successes` > `trials`, or `level` outside (0, 1).
pub fn clopper_pearson(successes: u64, trials: u64, level: f64) -> Result<(f64, f64), StatsError> {
    if trials == 0 {
        return Err(StatsError::TooFew { what: "trials", found: 0, needed: 1 });
    }
    if successes > trials {
        return Err(StatsError::OutOfRange { what: "successes", value: successes as f64, range: "0..=trials" });
    }
    if !(level > 0.0 && level < 1.0) {
        return Err(StatsError::OutOfRange { what: "level", value: level, range: "(0, 1)" });
    }
    let tail = 0.5 * (1.0 - level);
    let (k, n) = (successes as f64, trials as f64);
    let lower = if successes == 0 { 0.0 } else { beta_quantile(tail, k, n - k + 1.0) };
    let upper = if successes == trials { 1.0 } else { beta_quantile(1.0 - tail, k + 1.0, n - k) };
    Ok((lower, upper))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn holm_textbook() {
        // 0.01·4, 0.013·3 (raised to 0.04), 0.03·2, 0.04·1 (raised to 0.06)
        let p = holm(&[0.04, 0.01, 0.03, 0.013]);
        for (found, expected) in p.iter().zip([0.06, 0.04, 0.06, 0.04]) {
            assert_relative_eq!(*found, expected, max_relative = 1e-12);
        }
        assert_eq!(holm(&[]), Vec::<f64>::new());
        assert_eq!(holm(&[f64::NAN, 0.02]), vec![1.0, 0.04]);
    }

    #[test]
    fn clopper_pearson_known() {
        // n = 200, k = 0: 1 − 0.025^{1/200}
        let (lo, hi) = clopper_pearson(0, 200, 0.95).unwrap();
        assert_eq!(lo, 0.0);
        assert_relative_eq!(hi, 1.0 - 0.025_f64.powf(1.0 / 200.0), max_relative = 1e-8);
        // R: binom.test(5, 100)$conf.int = 0.01643188 0.11283491
        let (lo, hi) = clopper_pearson(5, 100, 0.95).unwrap();
        assert_relative_eq!(lo, 0.016_431_88, max_relative = 1e-5);
        assert_relative_eq!(hi, 0.112_834_91, max_relative = 1e-5);
        let (lo, hi) = clopper_pearson(7, 7, 0.9).unwrap();
        assert_relative_eq!(lo, 0.05_f64.powf(1.0 / 7.0), max_relative = 1e-8);
        assert_eq!(hi, 1.0);
        assert!(clopper_pearson(3, 2, 0.9).is_err());
        assert!(clopper_pearson(0, 0, 0.9).is_err());
    }
}
