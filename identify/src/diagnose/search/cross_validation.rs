//! The two parts of the fitted records: fits of one, errors on the other.

use super::super::baseline::coloured;
use super::super::gain;
use super::super::scores::Scores;
use super::Whole;
use super::constants::SEARCH;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, approach, fit};
use crate::shooting::{Plan, RecordPlan, ShotWants, shoot};
use crate::stats::ar::ArModel;
use crate::unknown::{Unknown, Values};
use rayon::prelude::*;

/// A fit of the first part, and its mean squares on every record of the second (in units of the channels' baseline errors).
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub fitted: Fitted,
    pub errors: Vec<f64>,
}

impl Trial {
    pub(super) fn total(&self) -> f64 {
        self.errors.iter().sum()
    }
}

/// Both parts.
pub(super) struct Bench<'a> {
    pub plan: &'a Plan,
    all: &'a [RecordPlan],
    train: Vec<RecordPlan>,
    check: Vec<RecordPlan>,
    noise: ArModel,
}

impl<'a> Bench<'a> {
    /// Deals out the records evenly. Those judged by start as held-out records do: from their lead-in, by the baseline.
    pub(super) fn new(plan: &'a Plan, base: &'a Fitted) -> Result<Self, IdentifyError> {
        let n = base.records.len();
        let size = (n / 2).min(SEARCH.fitted);
        let place = |k: usize| (2 * k + 1) * n / (2 * size);
        let fitted: Vec<usize> = (0..size).map(place).collect();
        let others: Vec<usize> = (0..n).filter(|k| !fitted.contains(k)).collect();
        let every = others.len().div_ceil(SEARCH.judged);
        let whole = |k: &usize| {
            let mut rec = base.records[*k].clone();
            rec.nodes.clear();
            rec
        };
        let judged: Vec<RecordPlan> = others.iter().step_by(every).map(whole).collect();
        let noise = ArModel::white(channel_errors(plan, base))?;
        Ok(Self {
            plan,
            all: &base.records,
            train: fitted.iter().map(|k| base.records[*k].clone()).collect(),
            check: gain::prepared(plan, &judged, base, &FitOptions::default())?,
            noise,
        })
    }

    /// Numbers of records fitted and judged by.
    pub(super) fn sizes(&self) -> [usize; 2] {
        [self.train.len(), self.check.len()]
    }

    /// Least squares on the first part.
    pub(super) fn refit(&self, start: &Values, unknowns: &[Unknown]) -> Result<Trial, IdentifyError> {
        self.fit(&self.train, start, unknowns, &SEARCH.coarse)
    }

    /// A first refit followed to its end, with the unknowns that have a meaning once the cause has a size ([`Cause::afterwards`]).
    pub(super) fn further(&self, rough: &Trial, cause: &Cause) -> Result<(Trial, Cause), IdentifyError> {
        let unknowns: Vec<Unknown> = rough.fitted.unknowns.iter().chain(&cause.afterwards).cloned().collect();
        let trial = self.fit(&rough.fitted.records, &rough.fitted.values, &unknowns, &SEARCH.coarse)?;
        let own = cause.unknowns.iter().chain(&cause.afterwards).cloned().collect();
        Ok((trial, Cause { unknowns: own, afterwards: Vec::new(), ..cause.clone() }))
    }

    fn fit(
        &self,
        records: &[RecordPlan],
        start: &Values,
        unknowns: &[Unknown],
        options: &FitOptions,
    ) -> Result<Trial, IdentifyError> {
        let unknowns = self.plan.tied(unknowns.to_vec());
        let fitted = fit(self.plan, records, start, &unknowns, Some(&self.noise), options)?;
        Ok(Trial { errors: self.judge(&fitted.values), fitted })
    }

    /// The same model fitted to all records, from where it is.
    pub(super) fn whole(&self, from: &Fitted) -> Result<Whole, IdentifyError> {
        self.of_all(fit(self.plan, self.all, &from.values, &from.unknowns, Some(&self.noise), &SEARCH.fine)?)
    }

    /// A least-squares fit of all records with its two noise models.
    pub(super) fn of_all(&self, plain: Fitted) -> Result<Whole, IdentifyError> {
        let (coloured, spread) = coloured(self.plan, plain)?;
        Ok(Whole { coloured, spread })
    }

    /// Mean squares on each record of the second part.
    fn judge(&self, values: &Values) -> Vec<f64> {
        self.errors(&self.check, values)
    }

    /// Mean squares on each of these records; infinite where it cannot be simulated.
    fn errors(&self, records: &[RecordPlan], values: &Values) -> Vec<f64> {
        let one = |rec: &RecordPlan| -> f64 {
            let Ok(mut shot) = shoot(self.plan, rec, values, ShotWants::default()) else { return f64::INFINITY };
            if self.noise.whiten(&mut shot.residual, self.plan.channels()).is_err() {
                return f64::INFINITY;
            }
            shot.residual.iter().map(|r| r * r).sum::<f64>() / shot.residual.len().max(1) as f64
        };
        records.par_iter().map(one).collect()
    }

    /// The causes worth a refit, most promising first, each with the step that the linearization proposes. Those that bring companions
    /// along come first, independent of their own promise.
    pub(super) fn promising(&self, tested: &Scores, current: &Fitted) -> Vec<(Cause, Vec<f64>)> {
        let cost: f64 = current.residuals.iter().filter_map(|r| self.squares(r)).sum();
        let mut ranked: Vec<(f64, usize)> = (0..tested.tested.len())
            .filter(|&j| tested.score.candidates[j].rank > 0)
            .map(|j| {
                let together = !tested.causes[tested.tested[j]].companions.is_empty();
                let part = tested.score.candidates[j].lm / cost.max(f64::MIN_POSITIVE);
                (if together { f64::INFINITY } else { part }, j)
            })
            .filter(|(part, j)| *part > SEARCH.promising && (part.is_infinite() || tested.score.candidates[*j].admissible))
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked.truncate(SEARCH.refits);
        let one = |(_, j): &(f64, usize)| (tested.causes[tested.tested[*j]].clone(), tested.score.candidates[*j].theta.clone());
        ranked.iter().map(one).collect()
    }

    fn squares(&self, residual: &[f64]) -> Option<f64> {
        let mut r = residual.to_vec();
        self.noise.whiten(&mut r, self.plan.channels()).ok()?;
        Some(r.iter().map(|x| x * x).sum())
    }

    /// The current fit with a cause and its companions freed as well, from each of the cause's starts; the one that comes nearest to the
    /// fitted records, and the cause with everything that was freed for it.
    pub(super) fn with(&self, current: &Trial, cause: &Cause, step: &[f64]) -> Result<(Trial, Cause), IdentifyError> {
        let known = &current.fitted.unknowns;
        let new = |u: &&Unknown| !known.iter().any(|k| k.target.same(&u.target) && k.path == u.path);
        let own: Vec<Unknown> = cause.unknowns.iter().chain(&cause.companions).filter(new).cloned().collect();
        let unknowns: Vec<Unknown> = known.iter().chain(&own).cloned().collect();
        let opened = |start: &[(usize, f64)]| {
            let mut values = current.fitted.values.clone();
            cause.nuisance_grid.iter().flatten().chain(start).for_each(|&(entry, value)| values.theta[entry] = value);
            for (u, step) in cause.unknowns.iter().zip(step) {
                if let Some(probe) = u.silent(&values) {
                    let start = u.moved(0.0, SEARCH.start_part * step.clamp(-SEARCH.longest_step, SEARCH.longest_step));
                    u.set(&mut values, if start > probe.small { start } else { probe.start });
                }
            }
            values
        };
        let plain = vec![Vec::new()];
        let starts = if cause.starts.is_empty() { &plain } else { &cause.starts };
        let start = self.nearest(&current.fitted.records, starts.iter().map(|start| opened(start)), &unknowns);
        let trial = self.fit(&start.1, &start.0, &unknowns, &SEARCH.rough)?;
        Ok((trial, Cause { unknowns: own, nuisance_grid: Vec::new(), ..cause.clone() }))
    }

    /// Of these starts, and where each leads over short pieces that begin where the data are, the one that is nearest to the data: over a
    /// whole record a large change bends the simulation out of the range of its linearization.
    fn nearest(
        &self,
        records: &[RecordPlan],
        starts: impl Iterator<Item = Values>,
        unknowns: &[Unknown],
    ) -> (Values, Vec<RecordPlan>) {
        let unknowns = self.plan.tied(unknowns.to_vec());
        let led = |start: &Values| approach(self.plan, records, start, &unknowns, &SEARCH.pieces).ok();
        let all = starts.flat_map(|start| led(&start).into_iter().chain([(start, records.to_vec())]));
        let far = |(values, records): &(Values, Vec<RecordPlan>)| self.errors(records, values).iter().sum::<f64>();
        let measured = all.map(|start| (far(&start), start));
        let best = measured.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| (self.plan.scene_values.clone(), records.to_vec()), |(_, start)| start)
    }

    /// The current fit without a cause.
    pub(super) fn without(&self, current: &Trial, declared: &[Unknown], cause: &Cause) -> Result<Trial, IdentifyError> {
        let mut values = current.fitted.values.clone();
        let unknowns = self.plan.taken_out(declared, &current.fitted.unknowns, &cause.unknowns, &mut values);
        self.refit(&values, &unknowns)
    }
}

/// Root mean square of the residual of every channel, nowhere below its floor.
fn channel_errors(plan: &Plan, fitted: &Fitted) -> Vec<f64> {
    let channels = plan.channels();
    let rows: usize = fitted.residuals.iter().map(|r| r.len() / channels).sum();
    let square = |c: usize| fitted.residuals.iter().flat_map(|r| r.iter().skip(c).step_by(channels)).map(|x| x * x).sum::<f64>();
    let floors = plan.floors();
    (0..channels).map(|c| (square(c) / rows.max(1) as f64).sqrt().max(floors[c])).collect()
}
