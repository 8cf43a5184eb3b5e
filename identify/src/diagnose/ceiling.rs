//! The yardstick of step 8: the part of the held-out error that a flexible correction *without physics* takes.
//!
//! Per marker (and per sensor at a joint), a ridge regression of the open-loop residual on the variables of any force: the
//! simulated position and velocity, speed times velocity, and the inputs over the last 0.4 s. It is learnt on the fitted
//! records, under the same protocol as held-out ones (begun where the model follows them best). It names nothing. Where it takes much
//! more than the named causes, something is left to find; where it takes less, the causes carry over better than statistics.

use super::gain::{self, Judged};
use super::policy::POLICY;
use super::result::Ceiling;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::{Observed, Plan, RecordPlan, ShotWants, shoot};
use crate::stats::ridge::{Group, cross_validated, foretold};
use crate::unknown::Values;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// The ceiling over the whole of the held-out records, for the baseline and for the final model; `None` where nothing is
/// held out.
pub(super) fn ceiling(
    plan: &Plan,
    [base, last]: [&Judged; 2],
    sensor_sigma: f64,
    options: &FitOptions,
) -> Result<Option<Ceiling>, IdentifyError> {
    if plan.held_out.is_empty() {
        return Ok(None);
    }
    let on_top = |judged: &Judged| {
        let training = gain::learnt_on(plan, judged.by, options)?;
        corrected(plan, &training, judged.records(), &judged.by.values)
    };
    let (before, after, flexible) = (plan.rms(base.residuals()), plan.rms(last.residuals()), on_top(base)?);
    let explainable = before * before - sensor_sigma * sensor_sigma;
    // rounding of the same sum taken twice is no gain
    let takes = |rmse: f64| explainable > 0.0 && (rmse - before).abs() > POLICY.rounding * before;
    let taken = |rmse: f64| if takes(rmse) { (before * before - rmse * rmse) / explainable } else { 0.0 };
    Ok(Some(Ceiling {
        rmse: flexible,
        explained_fraction: taken(flexible),
        rmse_on_top: on_top(last)?,
        unit: plan.unit.to_owned(),
        share: (taken(flexible) > 0.0).then(|| taken(after) / taken(flexible)),
    }))
}

/// Part of the squares of `residuals` (of the fitted records) that the correction takes on measured records left out: a force of position,
/// speed or inputs that the model lacks. With a single record, on blocks left out.
pub(super) fn by_motion(plan: &Plan, fitted: &Fitted, residuals: &[Vec<f64>]) -> Result<Option<f64>, IdentifyError> {
    let one = |(rec, residual): (&RecordPlan, &Vec<f64>)| rows_of(plan, rec, &fitted.values, Some(residual.as_slice()));
    let all: Vec<Vec<Rows>> = fitted.records.par_iter().zip(residuals).map(one).collect::<Result<_, _>>()?;
    let single = plan.fitted_records() < 2;
    let mut groups: Vec<Vec<Group>> = vec![Vec::new(); groups_of(plan).len()];
    for (k, record) in all.iter().enumerate() {
        for (m, rows) in record.iter().enumerate() {
            if single {
                groups[m].extend(rows.groups(POLICY.ceiling_groups.div_ceil(all.len())));
            } else if let Some(whole) = rows.groups(1).pop() {
                let same = k > 0 && fitted.records[k - 1].parent == fitted.records[k].parent;
                match groups[m].last_mut().filter(|_| same) {
                    Some(last) => *last = last.plus(&whole, 1.0),
                    None => groups[m].push(whole),
                }
            }
        }
    }
    Ok(foretold(&groups))
}

/// RMSE \[m\] over `judged` after the correction learnt on `training`.
fn corrected(plan: &Plan, training: &[RecordPlan], judged: &[RecordPlan], values: &Values) -> Result<f64, IdentifyError> {
    let learnt: Vec<Vec<Rows>> = training.par_iter().map(|rec| rows(plan, rec, values)).collect::<Result<_, _>>()?;
    let blocks = POLICY.ceiling_groups.div_ceil(training.len().max(1));
    let groups: Vec<Vec<Group>> =
        (0..groups_of(plan).len()).map(|m| learnt.iter().flat_map(|record| record[m].groups(blocks)).collect()).collect();
    let b = cross_validated(&groups);
    let seen: Vec<Vec<Rows>> = judged.par_iter().map(|rec| rows(plan, rec, values)).collect::<Result<_, _>>()?;
    let (mut sum, mut count) = (0.0, 0);
    for record in &seen {
        for (m, rows) in record.iter().enumerate() {
            sum += rows.squares(b.as_ref().map(|b| &b[m]));
            count += rows.y.iter().map(Vec::len).sum::<usize>();
        }
    }
    Ok((sum / count.max(1) as f64).sqrt())
}

/// Observed quantities with a correction of their own: those whose errors are reported.
fn groups_of(plan: &Plan) -> Vec<Observed> {
    plan.observed().into_iter().filter(|o| plan.unit_of(*o) == plan.unit).collect()
}

/// Features and residuals of one of them in one record.
#[derive(Default)]
struct Rows {
    x: Vec<Vec<f64>>,
    y: Vec<Vec<f64>>,
}

impl Rows {
    /// So many consecutive blocks of the record, each to be left out once.
    fn groups(&self, blocks: usize) -> Vec<Group> {
        let length = self.x.len().div_ceil(blocks).max(1);
        let group = |(x, y): (&[Vec<f64>], &[Vec<f64>])| {
            let mut group = Group::new(x[0].len(), y[0].len());
            x.iter().zip(y).for_each(|(x, y)| group.add(x, y));
            group
        };
        self.x.chunks(length).zip(self.y.chunks(length)).map(group).collect()
    }

    /// Squared residuals after the correction `b`, or as they are.
    fn squares(&self, b: Option<&DMatrix<f64>>) -> f64 {
        let one = |(x, y): (&Vec<f64>, &Vec<f64>)| -> f64 {
            let by = |a: usize| b.map_or(0.0, |b| x.iter().zip(b.column(a).iter()).map(|(x, b)| x * b).sum::<f64>());
            y.iter().enumerate().map(|(a, y)| (y - by(a)).powi(2)).sum()
        };
        self.x.iter().zip(&self.y).map(one).sum()
    }
}

/// One entry per group; samples where it was not seen are left out.
fn rows(plan: &Plan, rec: &RecordPlan, values: &Values) -> Result<Vec<Rows>, IdentifyError> {
    rows_of(plan, rec, values, None)
}

/// The same with other residuals than the simulation's.
fn rows_of(plan: &Plan, rec: &RecordPlan, values: &Values, instead: Option<&[f64]>) -> Result<Vec<Rows>, IdentifyError> {
    let shot = shoot(plan, rec, values, ShotWants::default())
        .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })?;
    let (channels, period) = (plan.channels(), rec.record.period().max(1e-9));
    let back = POLICY.ceiling_lags.map(|lag| (lag / period).round() as usize);
    let groups = groups_of(plan);
    let mut out: Vec<Rows> = groups.iter().map(|_| Rows::default()).collect();
    for t in 0..shot.residual.len() / channels {
        let inputs = &rec.record.inputs;
        let moved = back.iter().flat_map(|&lag| {
            let then = &inputs[t.saturating_sub(lag).min(inputs.len() - 1)];
            then.iter().zip(&inputs[0]).map(|(now, start)| now - start)
        });
        let grippers: Vec<f64> = moved.collect();
        for (m, rows) in out.iter_mut().enumerate() {
            if plan.measured(&rec.record, t, groups[m]).iter().any(|x| !x.is_finite()) {
                continue;
            }
            let range = plan.channels_of(groups[m]);
            let row = |t: usize| t * channels + range.start..t * channels + range.end;
            let at = |t: usize| &shot.predicted[row(t)];
            let (here, before, start) = (at(t), at(t.saturating_sub(1)), at(0));
            let v: Vec<f64> = here.iter().zip(before).map(|(here, before)| (here - before) / period).collect();
            let speed = v.iter().map(|v| v * v).sum::<f64>().sqrt();
            let mut x = vec![1.0];
            x.extend(here.iter().zip(start).map(|(here, start)| here - start));
            x.extend(v.iter());
            x.extend(v.iter().map(|v| speed * v));
            x.extend_from_slice(&grippers);
            rows.y.push(instead.unwrap_or(&shot.residual)[row(t)].to_vec());
            rows.x.push(x);
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::Setup;

    /// The example's motions, with readings that are the simulation's plus `error(gripper displacement, sample, axis)`.
    fn plan(error: impl Fn(f64, usize, usize) -> f64) -> Plan {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/hidden_effect/scene.toml");
        let setup = Setup::read(scene).unwrap();
        let mut plan = Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap();
        let (model, values, channels) = (plan.clone(), plan.scene_values.clone(), plan.channels());
        for rec in plan.fitted.iter_mut().chain(&mut plan.held_out) {
            let predicted = shoot(&model, rec, &values, ShotWants::default()).unwrap().predicted;
            for (t, row) in rec.record.markers.iter_mut().enumerate() {
                let moved = rec.record.inputs[t][0] - rec.record.inputs[0][0];
                for (m, point) in row.iter_mut().enumerate() {
                    *point = [0, 1, 2].map(|a| predicted[t * channels + 3 * m + a] + error(moved, t, a));
                }
            }
        }
        plan
    }

    fn before_and_after(plan: &Plan) -> (f64, f64) {
        let values = &plan.scene_values;
        let before = plan.rms(&gain::residuals(plan, &plan.held_out, values).unwrap());
        (before, corrected(plan, &plan.fitted, &plan.held_out, values).unwrap())
    }

    #[test]
    fn takes_an_error_that_follows_the_grippers() {
        let (before, after) = before_and_after(&plan(|moved, _, a| if a == 2 { 0.05 * moved } else { 0.0 }));
        assert!(before > 1e-4 && after < 0.3 * before, "{before:e} {after:e}");
    }

    #[test]
    fn takes_nothing_from_noise() {
        let noise = |t: usize, a: usize| ((t * 7919 + a * 104_729) as f64 * 0.618).sin() * 1e-3;
        let (before, after) = before_and_after(&plan(|_, t, a| noise(t, a)));
        assert!((after / before - 1.0).abs() < 0.02, "{before:e} {after:e}");
    }
}
