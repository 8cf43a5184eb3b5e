//! Test whether the residual after all accepted causes is more than noise.

use super::constants::DIAGNOSE;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::whiteness::{channel, cross_correlation};

/// Smallest Bonferroni p of a correlation between the whitened residual of any channel and the rate of any input. Colour
/// alone may be the sensor; dependence on the input is missing dynamics.
pub(super) fn depends_on_input(plan: &Plan, fitted: &Fitted) -> Result<f64, IdentifyError> {
    let (channels, inputs) = (plan.channels(), plan.model.nu());
    let whitened: Vec<Vec<f64>> = fitted
        .residuals
        .iter()
        .map(|r| {
            let mut r = r.clone();
            fitted.noise.whiten(&mut r, channels).map(|()| r)
        })
        .collect::<Result<_, _>>()?;
    let period = fitted.records[0].record.period().max(1e-6);
    let lags = ((DIAGNOSE.remainder_lag / period) as usize).clamp(1, DIAGNOSE.remainder_lags);
    let (mut smallest, mut tests) = (1.0f64, 0usize);
    for input in 0..inputs {
        let rates: Vec<Vec<f64>> =
            fitted.records.iter().zip(&whitened).map(|(rec, r)| rate(&rec.record.inputs, input, r.len() / channels)).collect();
        if rates.iter().flatten().all(|x| x.abs() < DIAGNOSE.remainder_still) {
            continue;
        }
        for c in 0..channels {
            let residuals: Vec<Vec<f64>> = whitened.iter().map(|r| channel(r, channels, c)).collect();
            let pairs: Vec<(&[f64], &[f64])> = residuals.iter().zip(&rates).map(|(r, u)| (r.as_slice(), u.as_slice())).collect();
            tests += 1;
            smallest = smallest.min(cross_correlation(&pairs, lags)?.p);
        }
    }
    Ok((smallest * tests.max(1) as f64).min(1.0))
}

/// Whether that p is evidence.
pub(super) fn is_significant(p: f64) -> bool {
    p < DIAGNOSE.remainder_level
}

/// Differences of an input from sample to sample.
fn rate(inputs: &[Vec<f64>], k: usize, n: usize) -> Vec<f64> {
    (0..n).map(|t| inputs[t.min(inputs.len() - 1)][k] - inputs[t.saturating_sub(1)][k]).collect()
}
