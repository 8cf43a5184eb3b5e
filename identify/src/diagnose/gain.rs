//! Step 8: the error on records that were not fitted.

use super::policy::POLICY;
use super::procedure::carried;
use super::result::{Curve, Gain, HorizonError, Snapshot};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, fit, followable};
use crate::log::LEAD_IN;
use crate::shooting::{Observed, Plan, RecordPlan, ShotWants, pieces_by_record, shoot};
use crate::stats::bootstrap::{LogRmseGain, RecordError, log_rmse_gain, log_rmse_gain_of_blocks};
use crate::unknown::Values;
use pliant_engine::model::{ClothSpan, Model};
use rayon::prelude::*;
use std::ops::Range;

/// Records with their initial states estimated from the lead-in under a fit.
pub(super) fn prepared(
    plan: &Plan,
    records: &[RecordPlan],
    by: &Fitted,
    options: &FitOptions,
) -> Result<Vec<RecordPlan>, IdentifyError> {
    begun(plan, records, by, options, plan.lead_in.unwrap_or(LEAD_IN))
}

/// Records with the initial states that fit their readings best under a fit, in their first seconds, and with the sizes of their own that do.
fn begun(
    plan: &Plan,
    records: &[RecordPlan],
    by: &Fitted,
    options: &FitOptions,
    seconds: f64,
) -> Result<Vec<RecordPlan>, IdentifyError> {
    if plan.at_rest || plan.given {
        return Ok(records.to_vec());
    }
    let short = |rec: &RecordPlan| {
        let mut short = rec.clone();
        let keep = short.record.time.partition_point(|t| *t <= seconds + POLICY.same_time).max(POLICY.lead_in_samples);
        short.record.truncate(keep);
        let steps = ((short.record.duration() / plan.model.step_length()).ceil() as usize).max(1);
        short.inputs.truncate(steps);
        short
    };
    let one = |parts: Range<usize>| -> Result<Vec<RecordPlan>, IdentifyError> {
        let fixed = FitOptions { rounds: 0, max_iterations: POLICY.lead_in_iterations, ..*options };
        let white = crate::stats::ar::ArModel::white(by.noise.sigma().to_vec())?;
        let begun: Vec<RecordPlan> = records[parts.clone()].iter().map(short).collect();
        let fitted = fit(plan, &begun, &by.values, &[], Some(&white), &fixed)?;
        let known =
            |(rec, known): (&RecordPlan, RecordPlan)| RecordPlan { start: known.start, sizes: known.sizes, ..rec.clone() };
        Ok(records[parts].iter().zip(fitted.records).map(known).collect())
    };
    Ok(pieces_by_record(records).into_par_iter().map(one).collect::<Result<Vec<_>, _>>()?.concat())
}

/// How a fit follows the records held out, horizon by horizon, the whole of the records last.
pub(super) struct Judged<'a> {
    pub by: &'a Fitted,
    pub horizons: Vec<Horizon>,
}

/// The records that a fit is judged on, and how far it is from them within a horizon.
pub(super) struct Horizon {
    /// Time from the beginning of the records \[s\].
    pub seconds: f64,
    /// The records from where they begin.
    pub records: Vec<RecordPlan>,
    /// What is left of the samples up to the horizon: rows (time, channel).
    pub residuals: Vec<Vec<f64>>,
}

impl Judged<'_> {
    /// The whole of the records, from where they begin for it.
    pub(super) fn records(&self) -> &[RecordPlan] {
        self.horizons.last().map_or(&[], |whole| &whole.records)
    }

    /// What is left of them.
    pub(super) fn residuals(&self) -> &[Vec<f64>] {
        self.horizons.last().map_or(&[], |whole| &whole.residuals)
    }
}

/// A fit on the records held out, as far as they can be followed; where none is held out, on the fitted ones.
///
/// Each record begins where the fit itself follows it best up to that horizon: a start read from a few samples is off by more than a small
/// cause does, and the same freedom is given to every model that is compared. Where a size differs between records, these have one of their own. With an `experiment.lead_in` they begin as it says.
pub(super) fn judged<'a>(plan: &Plan, by: &'a Fitted, options: &FitOptions) -> Result<Judged<'a>, IdentifyError> {
    let known = plan.held_out.is_empty();
    let mut records =
        if known { by.records.clone() } else { prepared(plan, &carried(by, &followable(plan, &plan.held_out)?), by, options)? };
    let mut out = Vec::new();
    for seconds in horizons(plan, &records) {
        // the next start is sought from the last one: of long records a poor one leads astray
        if !known && plan.lead_in.is_none() {
            records = begun(plan, &records, by, options, seconds)?;
        }
        let residuals = until(plan, &records, &residuals(plan, &records, &by.values)?, seconds);
        out.push(Horizon { seconds, records: records.clone(), residuals });
    }
    Ok(Judged { by, horizons: out })
}

/// The fitted records from where they begin under a fit, as those held out do: where it follows them best, or as an `experiment.lead_in` says.
pub(super) fn learnt_on(plan: &Plan, by: &Fitted, options: &FitOptions) -> Result<Vec<RecordPlan>, IdentifyError> {
    if plan.lead_in.is_some() { prepared(plan, &by.records, by, options) } else { Ok(by.records.clone()) }
}

/// Residuals of `records` at `values`.
pub(super) fn residuals(plan: &Plan, records: &[RecordPlan], values: &Values) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let one = |rec: &RecordPlan| {
        let shot = shoot(plan, rec, values, ShotWants::default());
        shot.map(|s| s.residual).map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })
    };
    records.par_iter().map(one).collect()
}

/// Errors at horizons of one step, 0.1 s, 1 s and the whole record; intervals by bootstrap over records.
pub(super) fn gains(plan: &Plan, [before, after]: [&Judged; 2], noise: f64, seed: u64) -> Result<Vec<Gain>, IdentifyError> {
    before.horizons.iter().zip(&after.horizons).map(|both| gain(plan, both, noise, seed)).collect()
}

/// One step, 0.1, 0.5 and 1 s, and the longest record \[s\].
fn horizons(plan: &Plan, records: &[RecordPlan]) -> Vec<f64> {
    let longest = records.iter().map(|r| r.record.duration()).fold(0.0, f64::max);
    let mut horizons = vec![plan.model.step_length()];
    horizons.extend(POLICY.horizons.into_iter().filter(|h| *h < longest - POLICY.same_time));
    horizons.push(longest);
    horizons
}

/// Residuals of the samples up to a horizon.
fn until(plan: &Plan, records: &[RecordPlan], all: &[Vec<f64>], horizon: f64) -> Vec<Vec<f64>> {
    let channels = plan.channels();
    let cut = |(r, rec): (&Vec<f64>, &RecordPlan)| {
        let n = rec.record.time.partition_point(|t| *t <= horizon * (1.0 + POLICY.same_time) + POLICY.horizon_slack).max(2);
        r[..(n * channels).min(r.len())].to_vec()
    };
    all.iter().zip(records).map(cut).collect()
}

/// Mean errors over all records, of the median one, and without the worst.
pub(super) fn horizon_errors(plan: &Plan, judged: &Judged) -> Vec<HorizonError> {
    let one = |Horizon { seconds, residuals: part, .. }: &Horizon| {
        let mut each: Vec<f64> = part.iter().map(|r| plan.mean_abs(std::slice::from_ref(r))).collect();
        let worst = (0..each.len()).max_by(|a, b| each[*a].total_cmp(&each[*b])).unwrap_or(0);
        let others: Vec<Vec<f64>> = part.iter().enumerate().filter(|(k, _)| *k != worst).map(|(_, r)| r.clone()).collect();
        let mean_abs = plan.mean_abs(part);
        let without_worst = if others.is_empty() { mean_abs } else { plan.mean_abs(&others) };
        each.sort_by(f64::total_cmp);
        let middle = each.len() / 2;
        let median = if each.len() % 2 == 1 { each[middle] } else { 0.5 * (each[middle - 1] + each[middle]) };
        HorizonError { horizon_s: *seconds, mean_abs, median_record: median, without_worst }
    };
    judged.horizons.iter().filter(|horizon| !horizon.residuals.is_empty()).map(one).collect()
}

/// Samples up to the horizon; the error *at* the horizon would be one noisy sample per record.
fn gain(plan: &Plan, (before, after): (&Horizon, &Horizon), noise: f64, seed: u64) -> Result<Gain, IdentifyError> {
    let (b, a) = (&before.residuals, &after.residuals);
    let (rb, ra, mean_abs) = (plan.rms(b), plan.rms(a), [plan.mean_abs(b), plan.mean_abs(a)]);
    // pieces of one record are no records of their own
    let measured = pieces_by_record(&before.records);
    let kept = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
        measured.iter().map(|of| all[of.clone()].iter().flat_map(|r| plan.reported_errors(r)).collect()).collect()
    };
    let per_sample = plan.reported().iter().filter(|r| **r).count();
    let interval = interval(&kept(b), &kept(a), per_sample, seed)?;
    let explainable = rb * rb - noise * noise;
    Ok(Gain {
        horizon_s: before.seconds,
        rmse_before: rb,
        rmse_after: ra,
        unit: plan.unit.to_owned(),
        interval: ends(&interval),
        explained_fraction: if explainable > 0.0 { (rb * rb - ra * ra) / explainable } else { 0.0 },
        mean_abs,
    })
}

/// Ends of an interval, if it is known. The statistic is after − before; the report counts improvement positive.
fn ends(interval: &LogRmseGain) -> Option<[f64; 2]> {
    Some([-interval.upper, -interval.lower]).filter(|ends| ends.iter().all(|x| x.is_finite()))
}

/// 90 % interval of the difference of log RMSE: over records, or over blocks of the only one if it is long enough.
fn interval(before: &[Vec<f64>], after: &[Vec<f64>], channels: usize, seed: u64) -> Result<LogRmseGain, IdentifyError> {
    let square = |r: &[f64]| (r.iter().map(|x| x * x).sum::<f64>() / r.len().max(1) as f64).max(POLICY.least_square);
    let pair = |(b, a): (&[f64], &[f64])| RecordError { before: square(b), after: square(a) };
    if let ([b], [a]) = (before, after) {
        let samples = b.len() / channels;
        if samples >= POLICY.gain_blocks * POLICY.gain_block {
            let rows = samples / POLICY.gain_blocks * channels;
            let blocks: Vec<RecordError> = b.chunks_exact(rows).zip(a.chunks_exact(rows)).map(pair).collect();
            return Ok(log_rmse_gain_of_blocks(&blocks, POLICY.gain_level, POLICY.gain_draws, seed)?);
        }
    }
    let pairs: Vec<RecordError> = before.iter().zip(after).map(|(b, a)| pair((b, a))).collect();
    Ok(log_rmse_gain(&pairs, POLICY.gain_level, POLICY.gain_draws, seed)?)
}

/// Curves and shapes for the pictures: up to three records, the marker of the largest baseline error in each.
pub(super) fn pictures(plan: &Plan, [before, after]: [&Judged; 2]) -> Result<(Vec<Curve>, Vec<Snapshot>), IdentifyError> {
    let (mut curves, mut snapshots) = (Vec::new(), Vec::new());
    for (rec, again) in before.records().iter().zip(after.records()).take(POLICY.picture_records) {
        let run = |rec: &RecordPlan, values: &Values| {
            let wants = ShotWants { states: true, ..ShotWants::default() };
            shoot(plan, rec, values, wants)
                .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })
        };
        let (b, a) = (run(rec, &before.by.values)?, run(again, &after.by.values)?);
        let channels = plan.channels();
        let size = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>();
        let unit = plan.unit;
        let candidates = plan.observed().into_iter().filter(|o| plan.unit_of(*o) == unit);
        let worst = |o: &Observed| b.residual.chunks_exact(channels).map(|row| size(&row[plan.channels_of(*o)])).sum::<f64>();
        let Some(shown) = candidates.max_by(|x, y| worst(x).total_cmp(&worst(y))) else { continue };
        let range = plan.channels_of(shown);
        // of numbers and turns the first component, and nothing in the others
        let three =
            |row: &[f64]| [0, 1, 2].map(|a| row.get(range.start + a).copied().filter(|_| a < shown.width()).unwrap_or(0.0));
        let at = |s: &crate::shooting::Shot, k: usize| three(&s.predicted[k * channels..(k + 1) * channels]);
        let measured = |k: usize| match shown {
            Observed::Marker(m) => rec.record.markers[k][m],
            Observed::Joint(j) => [rec.record.joints[k][j], 0.0, 0.0],
            Observed::Orientation(_) => [0.0; 3],
        };
        // a clock that is late reads fewer samples than were simulated
        let samples = b.residual.len().min(a.residual.len()) / channels;
        let stride = samples.div_ceil(POLICY.picture_samples).max(1);
        let chosen = || (0..samples).step_by(stride);
        curves.push(Curve {
            record: rec.record.name.clone(),
            marker: if let Observed::Marker(m) = shown { m } else { 0 },
            quantity: if matches!(shown, Observed::Marker(_)) { String::new() } else { plan.name_of(shown) },
            unit: unit.to_owned(),
            time: chosen().map(|k| rec.record.time[k]).collect(),
            measured: chosen().map(measured).collect(),
            before: chosen().map(|k| at(&b, k)).collect(),
            after: chosen().map(|k| at(&a, k)).collect(),
        });
        if plan.model.n_nodes() == 0 || plan.markers.is_empty() {
            continue;
        }
        let late = (0..samples).max_by(|x, y| {
            let e = |k: usize| size(&b.residual[k * channels..(k + 1) * channels]);
            e(*x).total_cmp(&e(*y))
        });
        let k = late.unwrap_or(0);
        let step = ((rec.record.time[k] / plan.model.step_length()).round() as usize).min(b.states.len() - 1);
        let shape = |s: &crate::shooting::Shot| drawn(&plan.model, &s.states[step].q);
        snapshots.push(Snapshot {
            record: rec.record.name.clone(),
            time: rec.record.time[k],
            measured: rec.record.markers[k].clone(),
            before: shape(&b),
            after: shape(&a),
        });
    }
    Ok((curves, snapshots))
}

/// Points of the lines that show the nodes' shape, a point of no numbers after each: ropes from end to end, of sheets the rim.
fn drawn(model: &Model, q: &[f64]) -> Vec<[f64; 3]> {
    let ropes = model.ropes().iter().map(|rope| rope.nodes.clone().collect());
    let lines: Vec<Vec<usize>> = ropes.chain(model.cloths().iter().flat_map(rim)).collect();
    let points = |line: Vec<usize>| {
        let at = |node: usize| [q[3 * node], q[3 * node + 1], q[3 * node + 2]];
        line.into_iter().map(at).chain(std::iter::once([f64::NAN; 3])).collect::<Vec<_>>()
    };
    lines.into_iter().flat_map(points).collect()
}

/// The lines along the free edges of a sheet, by nodes of the model. Triangles of a piece are turned the same way, so that each such edge
/// begins where another one ends.
fn rim(sheet: &ClothSpan) -> Vec<Vec<usize>> {
    let sides: Vec<[usize; 2]> = sheet.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    let mut left: Vec<[usize; 2]> = sides.iter().copied().filter(|[a, b]| !sides.contains(&[*b, *a])).collect();
    let mut out = Vec::new();
    while let Some([first, second]) = left.pop() {
        let mut line = vec![first, second];
        while let Some(next) = left.iter().position(|[from, _]| line.last() == Some(from)) {
            line.push(left.swap_remove(next)[1]);
        }
        out.push(line.into_iter().map(|node| sheet.nodes.start + node).collect());
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;

    /// A start is read from all that is judged: from four samples of a swing its velocity is off by more than the noise makes of the whole.
    #[test]
    fn held_out_records_begin_where_they_are_followed_best() {
        let noise = 1e-3;
        let swing = |seed: u64| -> Vec<f64> {
            let at = |k: usize| 0.02 * (5.656 * 0.01 * k as f64).cos();
            gaussians(40, seed).iter().enumerate().map(|(k, e)| at(k) + noise * e).collect()
        };
        for seed in [1, 11, 21] {
            let mut plan = experiment(&pendulum("measured"), &[swing(seed), swing(seed + 1), swing(seed + 2)]).0;
            let white = ArModel::white(vec![noise]).unwrap();
            let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
            let errors = |plan: &Plan| {
                let judged = judged(plan, &fitted, &FitOptions::default()).unwrap();
                judged.horizons.iter().map(|horizon| (horizon.seconds, plan.rms(&horizon.residuals))).collect::<Vec<_>>()
            };
            let followed = errors(&plan);
            assert_eq!(followed.iter().map(|(horizon, _)| *horizon).collect::<Vec<_>>(), [0.005, 0.1, 0.39]);
            assert!(followed[2].1 < 1.3 * noise, "{followed:?}");
            plan.lead_in = Some(0.03);
            let foretold = errors(&plan);
            assert!(foretold[2].1 > 2.0 * noise, "{foretold:?}");
        }
    }

    #[test]
    fn a_sheet_is_drawn_by_its_rim() {
        let triangles = vec![[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2]];
        let sheet = ClothSpan { name: String::new(), nodes: 10..16, triangles, edges: Vec::new(), area: 0, radius: 0 };
        let [line] = &rim(&sheet)[..] else { panic!("{:?}", rim(&sheet)) };
        assert!(line.len() == 7 && line[0] == line[6] && (10..16).all(|node| line.contains(&node)), "{line:?}");
    }

    #[test]
    fn one_record_has_an_interval_only_if_it_is_long() {
        let record = |samples: u32| vec![(0..3 * samples).map(|k| 1e-3 * (1.0 + 0.1 * f64::from(k).sin())).collect::<Vec<f64>>()];
        let known = |samples: u32| {
            let gain = interval(&record(samples), &record(samples), 3, 1).unwrap();
            ends(&gain)
        };
        assert!(known(64).is_some_and(|[low, high]| low <= high));
        assert_eq!(known(20), None);
    }
}
