//! Models of the data: the scene with some causes added, fitted by least squares in units of the sensors' scatter.

use super::super::policy::POLICY;
use super::apart::{carried, spread_of, with_common};
use super::coarse::Coarse;
use super::unseen::{counted, even, sought_on_some};
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, approach, fit};
use crate::shooting::{Plan, RecordPlan, ShotWants, own_squares, shoot};
use crate::stats::ar::ArModel;
use crate::unknown::{Target, Unknown, Values};
use rayon::prelude::*;

/// The scene with some causes added, and its fit.
#[derive(Clone, Debug)]
pub(in super::super) struct Hypothesis {
    /// In the order of their acceptance, each with every unknown that was freed for it.
    pub causes: Vec<Cause>,
    /// Least squares over all fitted records, the noise white with the sensors' scatter.
    pub fitted: Fitted,
    /// The same with the first cause, the first two and so on; the last is `fitted`.
    pub trail: Vec<Fitted>,
}

impl Hypothesis {
    /// The scene as it is declared.
    pub fn baseline(fitted: Fitted) -> Self {
        Self { causes: Vec::new(), fitted, trail: Vec::new() }
    }

    /// With one more cause.
    pub fn and(&self, cause: Cause, fitted: Fitted) -> Self {
        let causes = self.causes.iter().cloned().chain([cause]).collect();
        let trail = self.trail.iter().cloned().chain([fitted.clone()]).collect();
        Self { causes, fitted, trail }
    }

    /// Led on to `records` by at most two steps, each counted by what is left in it where that is no noise; where it may be noise a contest fits it to
    /// the end. The models on the way to it keep their
    /// values, as they were found.
    pub fn on(&self, bench: &Bench, records: &[RecordPlan]) -> Result<Self, IdentifyError> {
        let here =
            fit(bench.plan, &carried(&self.fitted, records), &self.fitted.values, &[], Some(&bench.white), &POLICY.coarse)?;
        let here = Fitted { unknowns: self.fitted.unknowns.clone(), ..here };
        let here = if bench.no_noise(&here) { counted(bench, &here) } else { here };
        let fitted = even(bench.plan, &bench.led(&here, &here.records)?);
        self.fitted_as(fitted, |before| fit(bench.plan, records, &before.values, &[], Some(&bench.white), &POLICY.coarse))
    }

    /// The same causes with another fit. `there`: a fit of the models on the way to it, in which nothing but the records' beginnings is free.
    pub fn fitted_as(
        &self,
        fitted: Fitted,
        there: impl Fn(&Fitted) -> Result<Fitted, IdentifyError>,
    ) -> Result<Self, IdentifyError> {
        let starts = |before: &Fitted| -> Result<Fitted, IdentifyError> {
            let unknowns = before.unknowns.clone();
            Ok(Fitted { unknowns, ..there(&Fitted { unknowns: Vec::new(), ..before.clone() })? })
        };
        let mut trail: Vec<Fitted> = self.trail.iter().rev().skip(1).rev().map(starts).collect::<Result<_, _>>()?;
        trail.extend(self.trail.last().map(|_| fitted.clone()));
        Ok(Self { fitted, trail, ..self.clone() })
    }

    /// Numbers freed for its causes.
    pub fn numbers(&self) -> usize {
        self.causes.iter().map(|cause| cause.unknowns.len()).sum()
    }

    /// Whether a cause of it has sizes of its own in every record.
    pub fn varies(&self, k: usize) -> bool {
        spread_of(&self.fitted, &self.causes[k].unknowns) > 0.0
    }

    /// Titles of its causes in the order of the alphabet: the same for the same model however it was found.
    pub fn key(&self) -> Vec<String> {
        let mut titles: Vec<String> = self.causes.iter().map(Cause::title).collect();
        titles.sort();
        titles
    }

    /// The same with one cause more.
    pub fn key_with(&self, cause: &Cause) -> Vec<String> {
        let mut titles = self.key();
        titles.push(cause.title());
        titles.sort();
        titles
    }
}

/// Whitened squares of a fit under a noise model, its records' own unknowns counted by their prior.
pub(super) fn squares(plan: &Plan, fitted: &Fitted, noise: &ArModel) -> Result<f64, IdentifyError> {
    let mut sum = own_squares(&fitted.records);
    for residual in &fitted.residuals {
        let mut r = residual.clone();
        noise.whiten(&mut r, plan.channels())?;
        sum += r.iter().map(|x| x * x).sum::<f64>();
    }
    let prior = |u: &Unknown| u.prior.map(|(mean, std)| ((u.value(&fitted.values) - mean) / std).powi(2));
    Ok(sum + fitted.unknowns.iter().filter_map(prior).sum::<f64>())
}

/// The experiment, the declared unknowns and the scatter, which all models share.
pub(in super::super) struct Bench<'a> {
    pub plan: &'a Plan,
    /// Unknowns that are free without any cause.
    pub declared: Vec<Unknown>,
    /// White noise with the sensors' scatter.
    pub white: ArModel,
}

impl Bench<'_> {
    /// The bench with another plan of the experiment.
    pub fn on<'a>(&self, plan: &'a Plan) -> Bench<'a> {
        Bench { plan, declared: self.declared.clone(), white: self.white.clone() }
    }

    /// Root mean square residual over the scatter, of all channels.
    pub fn over(&self, fitted: &Fitted) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        let sigma = self.white.sigma();
        for row in fitted.residuals.iter().flat_map(|r| r.chunks_exact(sigma.len())) {
            for (r, s) in row.iter().zip(sigma).filter(|(r, _)| **r != 0.0) {
                (sum, count) = (sum + (r / s) * (r / s), count + 1.0);
            }
        }
        (sum / f64::max(count, 1.0)).sqrt()
    }

    /// Whether what a fit leaves is no noise.
    pub fn no_noise(&self, fitted: &Fitted) -> bool {
        self.over(fitted) > POLICY.no_noise
    }

    /// Least squares.
    pub fn fit(
        &self,
        records: &[RecordPlan],
        start: &Values,
        unknowns: &[Unknown],
        options: &FitOptions,
    ) -> Result<Fitted, IdentifyError> {
        let unknowns = self.plan.tied(unknowns.to_vec());
        let records: Vec<RecordPlan> = records.iter().map(|rec| rec.tied(&unknowns)).collect();
        let mut values = start.clone();
        self.plan.followers.iter().for_each(|&(leader, follower)| {
            if unknowns.iter().any(|u| u.target == Target::Theta(vec![leader, follower])) {
                values.theta[follower] = values.theta[leader];
            }
        });
        fit(self.plan, &records, &values, &unknowns, Some(&self.white), options)
    }

    /// `parent` with a cause freed as well (and `beside` it its unmeasured companions), from the start that comes nearest to the data;
    /// the cause with everything that was freed for it.
    pub fn with(
        &self,
        parent: &Fitted,
        cause: &Cause,
        step: &[f64],
        beside: &[Unknown],
    ) -> Result<(Fitted, Cause), IdentifyError> {
        let known = &parent.unknowns;
        let new = |u: &&Unknown| !known.iter().any(|k| k.target.same(&u.target) && k.path == u.path);
        let own: Vec<Unknown> = cause.unknowns.iter().chain(beside).filter(new).cloned().collect();
        let unknowns: Vec<Unknown> = known.iter().chain(&own).cloned().collect();
        let plain = vec![Vec::new()];
        let starts = cause.starts_beside(beside).unwrap_or(&plain);
        let mut best: Option<(f64, Values, Vec<RecordPlan>)> = None;
        for start in starts {
            let mut nearest: Option<(f64, Values)> = None;
            for part in std::iter::once(0.0).chain(POLICY.starts) {
                let values = opened(parent, cause, step, start, part);
                let squares = self.squares_at(&parent.records, &values);
                if nearest.as_ref().is_none_or(|(least, _)| squares < *least) {
                    nearest = Some((squares, values));
                }
            }
            let Some((squares, values)) = nearest else { continue };
            let tied = self.plan.tied(unknowns.clone());
            let led = approach(self.plan, &parent.records, &values, &tied, &POLICY.rough.pieces).ok();
            let led = led.map(|(values, records)| (self.squares_at(&records, &values), values, records));
            for one in led.into_iter().chain([(squares, values, parent.records.clone())]) {
                if best.as_ref().is_none_or(|(least, ..)| one.0 < *least) {
                    best = Some(one);
                }
            }
        }
        let (_, values, records) = best.unwrap_or_else(|| (0.0, parent.values.clone(), parent.records.clone()));
        let fitted = self.fit(&records, &values, &unknowns, &POLICY.rough.options)?;
        Ok((fitted, Cause { unknowns: own, ..cause.clone() }))
    }

    /// `parent` with a cause freed as well, at so many parts of its one-step estimate and not refitted; the cause with what was freed for it.
    /// `beside`: the step of what is free without it.
    pub fn moved(&self, parent: &Fitted, cause: &Cause, step: &[f64], beside: &[f64], part: f64) -> (Fitted, Cause) {
        let new = |u: &&Unknown| !parent.unknowns.iter().any(|k| k.target.same(&u.target) && k.path == u.path);
        let own: Vec<Unknown> = cause.unknowns.iter().filter(new).cloned().collect();
        let unknowns = parent.unknowns.iter().chain(&own).cloned().collect();
        let mut values = opened(parent, cause, step, &[], part);
        parent
            .unknowns
            .iter()
            .zip(beside)
            .for_each(|(u, step)| u.set(&mut values, u.moved(u.value(&parent.values), part * step)));
        (Fitted { unknowns, values, ..parent.clone() }, Cause { unknowns: own, ..cause.clone() })
    }

    /// The model without one of its causes.
    pub fn without(&self, whole: &Hypothesis, k: usize) -> Result<Hypothesis, IdentifyError> {
        let mut values = whole.fitted.values.clone();
        let mut causes = whole.causes.clone();
        let out = causes.remove(k);
        for &(entry, _) in out.nuisance_grid.iter().flatten() {
            values.theta[entry] = self.plan.scene_values.theta[entry];
        }
        let unknowns = self.plan.taken_out(&self.declared, &whole.fitted.unknowns, &out.unknowns, &mut values);
        let begun = with_common(&whole.fitted, &out.unknowns);
        let fitted = if sought_on_some(self.plan, &begun) && self.no_noise(&begun) {
            self.led(&Fitted { unknowns, values, ..begun.clone() }, &begun.records)?
        } else {
            let coarse = Coarse::of(self, &begun)?;
            let rough = coarse.bench(self).fit(&coarse.fitted.records, &values, &unknowns, &POLICY.coarse)?;
            match coarse.is_fine() {
                true => rough,
                false => self.finished(&rough, &coarse.back(&rough.records, &begun.records))?,
            }
        };
        let mut trail = whole.trail.clone();
        trail.remove(k);
        if let Some(last) = trail.last_mut() {
            last.clone_from(&fitted);
        }
        Ok(Hypothesis { causes, fitted, trail })
    }

    /// Squares of the residuals in units of the scatter; infinite where a record cannot be simulated.
    pub fn squares_at(&self, records: &[RecordPlan], values: &Values) -> f64 {
        let one = |rec: &RecordPlan| -> f64 {
            let Ok(mut shot) = shoot(self.plan, rec, values, ShotWants::default()) else { return f64::INFINITY };
            if self.white.whiten(&mut shot.residual, self.plan.channels()).is_err() {
                return f64::INFINITY;
            }
            shot.residual.iter().map(|r| r * r).sum::<f64>()
        };
        let parts: Vec<f64> = records.par_iter().map(one).collect();
        let sum: f64 = parts.iter().sum();
        if sum.is_finite() { sum } else { f64::INFINITY }
    }
}

/// The parent's values with a cause opened by so many parts of its one-step estimate. A law that is silent at zero begins at its probe.
fn opened(parent: &Fitted, cause: &Cause, step: &[f64], start: &[(usize, f64)], part: f64) -> Values {
    let mut values = parent.values.clone();
    cause.nuisance_grid.iter().flatten().chain(start).for_each(|&(entry, value)| values.theta[entry] = value);
    for (u, step) in cause.unknowns.iter().zip(step) {
        // a point of the nuisance grid may be a value of the cause itself
        let value = u.value(&values);
        let moved = if step.is_finite() { u.moved(value, part * step) } else { value };
        match u.silent(&parent.values) {
            Some(probe) => u.set(&mut values, if moved > probe.small { moved } else { probe.start }),
            None if part > 0.0 => u.set(&mut values, moved),
            None => {}
        }
    }
    values
}
