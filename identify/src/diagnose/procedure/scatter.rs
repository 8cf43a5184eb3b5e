//! Scatter of the readings from one to the next: the least noise that they can have.
//!
//! Of a residual e at its true stamps t, the divided difference of order k over k + 1 samples in a row,
//! ```text
//! d = Σ_i w_i e_i / |w|,     w_i = 1 / Π_{j ≠ i} (t_i − t_j)
//! ```
//! is zero for a polynomial of degree below k, and has the variance of white noise. The scatter is the least of the medians of |d| over
//! the orders, nowhere below what quantisation alone makes and the declared floor. It is a *lower bound*: slow noise is invisible to it
//! (a scatter is 0.24 of the noise of an AR(1) of 0.9), so it is a unit, and never a limit on what may remain.

use super::super::policy::POLICY;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::MAD_TO_SIGMA;
use crate::stats::whiteness::channel;

/// Scatter of every channel [unit of the channel]; `grids`: the noise that the channels' quantisation makes.
pub(in super::super) fn scatter(plan: &Plan, base: &Fitted, grids: &[f64]) -> Vec<f64> {
    let channels = plan.channels();
    let floors = crate::fit::floors(plan, 1.0);
    let one = |c: usize| {
        let series: Vec<(Vec<f64>, Vec<f64>)> = base
            .records
            .iter()
            .zip(&base.residuals)
            .map(|(rec, r)| {
                let seen = rec.record.time.iter().zip(channel(r, channels, c)).filter(|(_, e)| *e != 0.0);
                seen.map(|(t, e)| (*t, e)).unzip()
            })
            .collect();
        let orders = POLICY.scatter_orders.clone().filter_map(|order| of_order(&series, order));
        let least = orders.fold(f64::INFINITY, f64::min);
        let floor = floors[c].max(grids.get(c).copied().unwrap_or(0.0));
        if least.is_finite() { least.max(floor) } else { rms(&series).max(floor) }
    };
    (0..channels).map(one).collect()
}

/// Standard deviation from differences of one order; `None` where there are too few.
fn of_order(series: &[(Vec<f64>, Vec<f64>)], order: usize) -> Option<f64> {
    let mut sizes = Vec::new();
    for (time, error) in series {
        let mut periods: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        periods.sort_by(f64::total_cmp);
        let period = periods.get(periods.len() / 2).copied().unwrap_or(1.0);
        let runs = time.windows(order + 1).zip(error.windows(order + 1));
        sizes.extend(runs.filter(|(t, _)| t[order] - t[0] < POLICY.scatter_gap * order as f64 * period).map(|(t, e)| {
            let weight = |i: usize| {
                let others = (0..=order).filter(|j| *j != i);
                1.0 / others.map(|j| (t[i] - t[j]) / period).product::<f64>()
            };
            let w: Vec<f64> = (0..=order).map(weight).collect();
            let length = w.iter().map(|w| w * w).sum::<f64>().sqrt();
            (w.iter().zip(e).map(|(w, e)| w * e).sum::<f64>() / length).abs()
        }));
    }
    sizes.retain(|d| d.is_finite());
    sizes.sort_by(f64::total_cmp);
    (sizes.len() >= POLICY.scatter_samples).then(|| MAD_TO_SIGMA * sizes[sizes.len() / 2])
}

fn rms(series: &[(Vec<f64>, Vec<f64>)]) -> f64 {
    let all = || series.iter().flat_map(|(_, e)| e);
    (all().map(|e| e * e).sum::<f64>() / all().count().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::gaussians;

    #[test]
    fn motion_and_uneven_stamps_do_not_count() {
        let jitter = gaussians(2000, 1);
        let time: Vec<f64> = (0..2000).map(|k| 0.01 * k as f64 + 1e-3 * jitter[k]).collect();
        let error: Vec<f64> = time.iter().zip(gaussians(2000, 2)).map(|(t, e)| 0.1 * (3.0 * t).sin() + 1e-3 * e).collect();
        let least = POLICY.scatter_orders.clone().filter_map(|k| of_order(&[(time.clone(), error.clone())], k));
        let sigma = least.fold(f64::INFINITY, f64::min);
        assert!((sigma / 1e-3 - 1.0).abs() < 0.15, "{sigma}");
    }

    #[test]
    fn few_samples_have_no_scatter() {
        assert_eq!(of_order(&[(vec![0.0, 1.0, 2.0], vec![0.1, 0.2, 0.1])], 2), None);
    }
}
