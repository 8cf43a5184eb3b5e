//! Whether what is left after all accepted causes, and beyond the simulation's own error, is more than noise.

use super::numerics::Shift;
use super::policy::POLICY;
use super::procedure::{Bench, Found};
use super::result::{Noise, Numerics, Remainder, RemainderForm};
use super::{ceiling, constancy};
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::reduced::Reduced;
use crate::stats::whiteness::{channel, cross_correlation};

/// The remainder of the model that was found, as it is judged (`fitted`); `parts`: what the constancy of its sizes is told from; `numerics` belong
/// to `shifts`; `base_rmse`: what the baseline left.
pub(super) fn remainder(
    bench: &Bench,
    fitted: &Fitted,
    (found, parts): (&Found, &Reduced),
    (shifts, numerics): (&[Shift], &[Numerics]),
    base_rmse: f64,
    noise: &Noise,
) -> Result<Remainder, IdentifyError> {
    let plan = bench.plan;
    // the simulation's own error is no missing dynamics
    let mut beyond = fitted.clone();
    for (shift, _) in shifts.iter().zip(numerics).filter(|(_, n)| n.gain > POLICY.per_number) {
        for (r, d) in beyond.residuals.iter_mut().zip(&shift.change) {
            r.iter_mut().zip(d).filter(|(r, _)| **r != 0.0).for_each(|(r, d)| *r -= d);
        }
    }
    let over_scatter = bench.over(&beyond);
    let by_motion = ceiling::by_motion(plan, &beyond, &beyond.residuals)?;
    let base = base_rmse * base_rmse;
    // a scatter that the baseline is below is none of its errors
    let explainable = if noise.sensor_sigma < base_rmse { base - noise.sensor_sigma * noise.sensor_sigma } else { base };
    let large = over_scatter > POLICY.no_noise;
    let squares = (fitted.rmse / noise.sensor_sigma.max(f64::MIN_POSITIVE)).powi(2).min(1.0);
    let moves = by_motion.filter(|part| part * squares > POLICY.by_motion);
    // of a size that differs between records its own law is no better known than the size is
    let causes = &found.best.causes;
    let constant: Vec<&Cause> = (0..causes.len()).filter(|k| !found.best.varies(*k)).map(|k| &causes[k]).collect();
    let mut forms = super::forms::forms(bench, fitted, &constant, shifts)?;
    forms.extend(constancy::forms(parts, fitted, &constant));
    let statistics: Vec<f64> = found.evidence.iter().map(|e| e.statistic).collect();
    let counts = !forms.is_empty() && stand_ins(&statistics, &forms).into_iter().all(|may| may);
    let note = match (large, moves) {
        (true, _) => format!("what is left is {over_scatter:.0} times what the readings scatter: too much for noise"),
        (false, _) if counts => "what is left is no noise".to_owned(),
        (false, Some(part)) => format!(
            "a regression on motion and inputs foretells {:.0} % of what is left on other records: dynamics are missing",
            100.0 * part
        ),
        (false, None) if !forms.is_empty() => "what is left is small beside what was found, and not quite noise".to_owned(),
        (false, None) => "what is left does not differ from noise".to_owned(),
    };
    let looks = forms.iter().take(POLICY.told_forms).map(|form| form.what.as_str()).collect::<Vec<_>>().join(", or ");
    let note = if looks.is_empty() { note } else { format!("{note}; it looks like {looks}") };
    Ok(Remainder {
        significant: large || moves.is_some() || counts,
        over_scatter,
        by_motion,
        input_p: depends_on_input(plan, fitted)?,
        rmse: fitted.rmse,
        unit: plan.unit.to_owned(),
        explained_fraction: if explainable > 0.0 { (base - fitted.rmse * fitted.rmse) / explainable } else { 0.0 },
        note,
        forms,
    })
}

/// Of causes with these statistics those that may stand in for something else: from the weakest on, each to which what is left and all that
/// may are a fiftieth or more ([`POLICY`]`.stands_in`): a law that stands in for another leaves a part of it.
pub(super) fn stand_ins(statistics: &[f64], forms: &[RemainderForm]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..statistics.len()).collect();
    order.sort_by(|a, b| statistics[*a].total_cmp(&statistics[*b]));
    let mut unknown = forms.iter().map(|form| form.taken).fold(0.0, f64::max);
    let mut out = vec![false; statistics.len()];
    for k in order {
        if unknown <= POLICY.stands_in * statistics[k] {
            break;
        }
        out[k] = true;
        unknown += statistics[k];
    }
    out
}

/// Smallest Bonferroni p of a correlation between the whitened residual of any channel and the rate of any input. Colour
/// alone may be the sensor; dependence on the input is missing dynamics.
fn depends_on_input(plan: &Plan, fitted: &Fitted) -> Result<f64, IdentifyError> {
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
    let longest = whitened.iter().map(|r| r.len() / channels).max().unwrap_or(0);
    let lags = ((POLICY.remainder_lag / period) as usize).min(longest.saturating_sub(1)).clamp(1, POLICY.remainder_lags);
    let (mut smallest, mut tests) = (1.0f64, 0usize);
    for input in 0..inputs {
        let rates: Vec<Vec<f64>> =
            fitted.records.iter().zip(&whitened).map(|(rec, r)| rate(&rec.record.inputs, input, r.len() / channels)).collect();
        if rates.iter().flatten().all(|x| x.abs() < POLICY.remainder_still) {
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

/// Differences of an input from sample to sample.
fn rate(inputs: &[Vec<f64>], k: usize, n: usize) -> Vec<f64> {
    (0..n).map(|t| inputs[t.min(inputs.len() - 1)][k] - inputs[t.saturating_sub(1)][k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weak_causes_may_stand_in_for_what_is_left() {
        let left = |taken: f64| vec![RemainderForm { taken, ..RemainderForm::default() }];
        // a cubic spring that is there beyond doubt, and a damping that is as large as what is left
        assert_eq!(stand_ins(&[1.7e6, 1193.0], &left(825.0)), [false, true]);
        assert_eq!(stand_ins(&[1.7e6, 1193.0], &[]), [false, false]);
        assert_eq!(stand_ins(&[1000.0], &left(600.0)), [true]);
        // the stronger one is 250 times what is left: but the weaker two together are not to be told from it
        assert_eq!(stand_ins(&[2e4, 3000.0, 9e6], &left(80.0)), [true, true, false]);
    }
}
