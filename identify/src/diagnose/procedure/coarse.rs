//! Refits on longer steps.
//!
//! The step that a verdict needs is far shorter than the one that directions need. So refits simulate with the longest step whose error is
//! no more than what is left, and take that error, as it is where they begin, off the data:
//! ```text
//! y' = y − (ŷ_h(θ₀) − ŷ_nh(θ₀))
//! ```
//! There the two residuals are the same, and changes from there are wrong by the step's part of the *change* alone. Taken again where a fit
//! on the long steps ends, until both agree, the residuals are those of the scene's step and the directions those of the longer one
//! ([`Bench::polished`]).

use super::super::policy::POLICY;
use super::hypothesis::{Bench, squares};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, approach, fit};
use crate::shooting::{OtherInputs, Plan, RecordPlan, Shot, ShotWants, shoot};
use crate::stats::ar::ArModel;
use crate::unknown::{Unknown, Values};
use pliant_math::State;
use rayon::prelude::*;
use std::sync::Arc;

/// A plan with longer steps, and a fit as it looks there.
pub(in super::super) struct Coarse {
    pub plan: Plan,
    pub fitted: Fitted,
    /// Steps in place of which it makes one.
    steps: usize,
}

impl Coarse {
    /// Of a fit at its optimum; as it is where no longer step is near enough.
    pub fn of(bench: &Bench, fitted: &Fitted) -> Result<Self, IdentifyError> {
        Self::beside(bench, fitted, None)
    }

    /// The same of a fit whose simulation is known.
    fn beside(bench: &Bench, fitted: &Fitted, now: Option<&[Shot]>) -> Result<Self, IdentifyError> {
        let plan = bench.plan;
        let many = plan.fitted_records() > POLICY.searched_records && bench.no_noise(fitted);
        let samples = if many { POLICY.samples_in_a_step } else { 1 };
        let mut steps = samples * longest(plan, &fitted.records);
        let corrected = fitted.records.iter().any(|rec| !rec.correction.is_empty());
        if steps == 1 || corrected {
            steps = 1;
            return Ok(Self { plan: plan.clone(), fitted: fitted.clone(), steps });
        }
        let shots;
        let now = match now {
            Some(now) => now,
            None => {
                shots = simulated(plan, &fitted.records, &fitted.values)?;
                &shots
            }
        };
        while steps > 1 {
            if let Some(coarse) = Self::with(bench, fitted, now, steps) {
                return Ok(coarse);
            }
            steps /= 2;
        }
        Ok(Self { plan: plan.clone(), fitted: fitted.clone(), steps })
    }

    /// With so many steps in one, if that is near enough. `now`: the simulation as it is.
    fn with(bench: &Bench, fitted: &Fitted, now: &[Shot], steps: usize) -> Option<Self> {
        let plan = bench.plan;
        let plan = on_steps(plan, steps);
        let mut records: Vec<RecordPlan> = fitted.records.iter().map(|rec| longer(&plan, rec, steps)).collect();
        let longer = simulated(&plan, &records, &fitted.values).ok()?;
        let mut change = fitted.residuals.clone();
        for (change, (now, longer)) in change.iter_mut().zip(now.iter().zip(&longer)) {
            // the end of the last step may read another sample
            let both = now.predicted.len().min(longer.predicted.len()).min(change.len());
            change.truncate(both);
            change.iter_mut().zip(now.predicted.iter().zip(&longer.predicted)).for_each(|(c, (now, longer))| {
                // nothing was measured where a residual is 0
                *c = if *c == 0.0 { 0.0 } else { longer - now };
            });
        }
        let counted = |(change, rec): (&Vec<f64>, &RecordPlan)| change.iter().map(|c| c * rec.weight).collect();
        let moved = Fitted { residuals: change.iter().zip(&records).map(counted).collect(), ..fitted.clone() };
        if !change.iter().flatten().all(|x| x.is_finite()) || bench.over(&moved) > POLICY.long_step * bench.over(fitted) {
            return None;
        }
        for ((rec, change), (shot, before)) in records.iter_mut().zip(change).zip(longer.iter().zip(&fitted.records)) {
            rec.correction = change.into();
            rec.nodes = before.nodes.iter().filter_map(|(step, _)| node(step / steps, &shot.states)).collect();
        }
        let slices = fitted.residuals.iter().zip(&records);
        let residuals = slices.map(|(r, rec)| r[..rec.correction.len()].to_vec()).collect();
        Some(Self { plan, fitted: Fitted { records, residuals, ..fitted.clone() }, steps })
    }

    /// Whether its steps are no longer than the scene's.
    pub fn is_fine(&self) -> bool {
        self.steps == 1
    }

    /// The bench with this plan.
    pub fn bench(&self, of: &Bench) -> Bench<'_> {
        of.on(&self.plan)
    }

    /// Records of a fit of this plan on the steps of those that it was made from.
    pub fn back(&self, records: &[RecordPlan], from: &[RecordPlan]) -> Vec<RecordPlan> {
        let one = |(rec, from): (&RecordPlan, &RecordPlan)| {
            let nodes = rec.nodes.iter().map(|(step, x)| (step * self.steps, x.clone())).collect();
            RecordPlan { start: rec.start.clone(), sizes: rec.sizes.clone(), nodes, ..from.clone() }
        };
        records.iter().zip(from).map(one).collect()
    }
}

/// The plan with so many steps in one. Its measured records stay on their own steps: causes take typical sizes from what was measured.
fn on_steps(plan: &Plan, steps: usize) -> Plan {
    let h = steps as f64 * plan.model.step_length();
    Plan { model: Arc::new(plan.model.with_step(h)), held_out: Vec::new(), ..plan.clone() }
}

/// The largest power of two of steps that lie between two samples.
fn longest(plan: &Plan, records: &[RecordPlan]) -> usize {
    let sample = records.iter().map(|rec| rec.record.period()).fold(f64::INFINITY, f64::min);
    let longest = (sample / plan.model.step_length() * (1.0 + POLICY.same_time)).floor();
    if longest >= 2.0 { 1 << (longest.log2().floor() as usize) } else { 1 }
}

impl Bench<'_> {
    /// A first fit, from values that are farther off than any step's error: on the longest steps as they are, then on the scene's. Longer steps
    /// that lead nowhere are left out.
    pub fn first(
        &self,
        records: &[RecordPlan],
        start: &Values,
        unknowns: &[Unknown],
        options: &FitOptions,
    ) -> Result<Fitted, IdentifyError> {
        let there = |plan: &Plan, records: &[RecordPlan]| {
            let (values, records) = approach(plan, records, start, unknowns, options)?;
            fit(plan, &records, &values, unknowns, Some(&self.white), options)
        };
        let steps = longest(self.plan, records);
        if steps > 1 {
            let plan = on_steps(self.plan, steps);
            let on_steps = |rec: &RecordPlan| {
                let nodes = rec.nodes.iter().map(|(step, x)| (step / steps, x.clone())).filter(|(step, _)| *step > 0);
                RecordPlan { nodes: nodes.collect(), ..longer(&plan, rec, steps) }
            };
            let longer: Vec<RecordPlan> = records.iter().map(on_steps).collect();
            let near = there(&plan, &longer).and_then(|near| {
                let starts = records.iter().zip(&near.records);
                let records: Vec<RecordPlan> = starts
                    .map(|(rec, near)| RecordPlan { start: near.start.clone(), sizes: near.sizes.clone(), ..rec.clone() })
                    .collect();
                self.polished(&records, &near.values, unknowns, &self.white, options)
            });
            if let Ok(near) = near {
                return Ok(near);
            }
        }
        there(self.plan, records)
    }

    /// A fit under `noise` from a point close to its end.
    pub fn polished(
        &self,
        records: &[RecordPlan],
        start: &Values,
        unknowns: &[Unknown],
        noise: &ArModel,
        options: &FitOptions,
    ) -> Result<Fitted, IdentifyError> {
        match self.corrected(records, start, unknowns, noise, options, POLICY.corrections)? {
            Some((at, true)) => Ok(at),
            Some((at, false)) => fit(self.plan, &at.records, &at.values, unknowns, Some(noise), options),
            None => fit(self.plan, records, start, unknowns, Some(noise), options),
        }
    }

    /// The same by least squares and without the last steps, where models are yet to be fitted again under one noise, or on more records.
    pub fn finished(&self, from: &Fitted, records: &[RecordPlan]) -> Result<Fitted, IdentifyError> {
        let to_go_on = records.len() < self.plan.fitted.len() && self.no_noise(from);
        if to_go_on { self.led(from, records) } else { self.least(from, records, &POLICY.coarse, POLICY.corrections) }
    }

    /// The same by a step or two.
    pub fn led(&self, from: &Fitted, records: &[RecordPlan]) -> Result<Fitted, IdentifyError> {
        self.least(from, records, &POLICY.widened, 1)
    }

    fn least(
        &self,
        from: &Fitted,
        records: &[RecordPlan],
        options: &FitOptions,
        corrections: usize,
    ) -> Result<Fitted, IdentifyError> {
        let (values, unknowns, white) = (&from.values, &from.unknowns, &self.white);
        match self.corrected(records, values, unknowns, white, options, corrections)? {
            Some((at, _)) => Ok(at),
            None => fit(self.plan, records, values, unknowns, Some(white), options),
        }
    }

    /// A fit on longer steps, their error taken off again where it ends, seen on the scene's step; and whether both agree there. None where no
    /// longer step is near enough.
    fn corrected(
        &self,
        records: &[RecordPlan],
        start: &Values,
        unknowns: &[Unknown],
        noise: &ArModel,
        options: &FitOptions,
        corrections: usize,
    ) -> Result<Option<(Fitted, bool)>, IdentifyError> {
        let Some((mut at, mut shots)) = self.followed(records, start, unknowns, noise)? else { return Ok(None) };
        let (mut before, mut apart, mut moved) = (squares(self.plan, &at, noise)?, f64::INFINITY, false);
        let mut enough = 0.0;
        let rows = at.residuals.iter().map(Vec::len).sum::<usize>() as f64;
        for _ in 0..corrections {
            let coarse = Coarse::beside(self, &at, Some(&shots))?;
            if coarse.steps == 1 {
                break;
            }
            let found = fit(&coarse.plan, &coarse.fitted.records, &at.values, unknowns, Some(noise), options)?;
            let foretold = squares(&coarse.plan, &found, noise)?;
            let next = self.followed(&coarse.back(&found.records, &at.records), &found.values, unknowns, noise)?;
            let Some((next, seen)) = next else { break };
            let now = squares(self.plan, &next, noise)?;
            if now > before {
                break;
            }
            let last = std::mem::replace(&mut apart, (now - foretold).abs());
            (at, shots, before, moved) = (Fitted { converged: found.converged, ..next }, seen, now, true);
            let unit = (now / rows).max(1.0);
            enough = (POLICY.agree * unit).max(options.tolerance * now);
            // what does not come nearer is an error without a direction: of friction that sticks and slips
            if apart <= (POLICY.agree_well * unit).max(options.tolerance * now) || apart > POLICY.nearer * last {
                break;
            }
        }
        Ok(moved.then_some((at, apart <= enough)))
    }

    /// These records simulated without a break, as a fit and as they are; none where they cannot be followed.
    fn followed(
        &self,
        records: &[RecordPlan],
        values: &Values,
        unknowns: &[Unknown],
        noise: &ArModel,
    ) -> Result<Option<(Fitted, Vec<Shot>)>, IdentifyError> {
        let Ok(shots) = simulated(self.plan, records, values) else { return Ok(None) };
        let residuals: Vec<Vec<f64>> = shots.iter().map(|shot| shot.residual.clone()).collect();
        let follow = |(rec, shot): (&RecordPlan, &Shot)| RecordPlan {
            nodes: rec.nodes.iter().filter_map(|(step, _)| node(*step, &shot.states)).collect(),
            ..rec.clone()
        };
        let records = records.iter().zip(&shots).map(follow).collect();
        let slices: Vec<&[f64]> = residuals.iter().map(Vec::as_slice).collect();
        let fitted = Fitted {
            unknowns: unknowns.to_vec(),
            values: values.clone(),
            records,
            deviance: noise.minus_two_log_likelihood(&slices)?,
            rmse: self.plan.rms(&residuals),
            residuals,
            noise: noise.clone(),
            iterations: 0,
            converged: false,
        };
        Ok(Some((fitted, shots)))
    }
}

/// A segment start where the simulation passes.
fn node(step: usize, states: &[State]) -> Option<(usize, State)> {
    let inside = step > 0 && step + 1 < states.len();
    inside.then(|| (step, states[step].clone()))
}

/// The records simulated without a break, with their states.
fn simulated(plan: &Plan, records: &[RecordPlan], values: &Values) -> Result<Vec<Shot>, IdentifyError> {
    let one = |rec: &RecordPlan| {
        let whole = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let wants = ShotWants { states: true, ..ShotWants::default() };
        shoot(plan, &whole, values, wants).map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })
    };
    records.par_iter().map(one).collect()
}

/// A record on steps so many times as long: forces are means over them, grippers are where they end.
fn longer(plan: &Plan, rec: &RecordPlan, steps: usize) -> RecordPlan {
    let of_grippers = plan.model.drives().iter().flat_map(|d| std::iter::repeat_n(d.is_prescribed(), d.n_controls()));
    let prescribed: Vec<bool> = of_grippers.chain(std::iter::repeat(false)).take(plan.model.nu()).collect();
    let one = |rows: &[Vec<f64>]| -> Vec<f64> {
        let mean = |j: usize| rows.iter().map(|row| row[j]).sum::<f64>() / rows.len() as f64;
        let last = |j: usize| rows[rows.len() - 1][j];
        prescribed.iter().enumerate().map(|(j, p)| if *p { last(j) } else { mean(j) }).collect()
    };
    let joined = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> { rows.chunks(steps).map(one).collect() };
    // what came before ends where the record begins
    let before = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> { rows.rchunks(steps).rev().map(one).collect() };
    let other = |way: usize| OtherInputs { inputs: joined(&rec.others[way].inputs), past: before(&rec.others[way].past) };
    let others = Arc::new([0, 1].map(other));
    RecordPlan { inputs: joined(&rec.inputs), past: before(&rec.past), others, nodes: Vec::new(), ..rec.clone() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::causes::{Situation, library};
    use crate::sensor::DELAY;

    /// A swinging pendulum with some damping, in readings of 0.4 s; the scene has none.
    fn swinging() -> Plan {
        let swing = |k: usize, a: f64| a * (5.7 * 0.01 * k as f64).cos() * (-0.5 * 0.01 * k as f64).exp();
        let readings: Vec<Vec<f64>> = [0.3, 0.5].iter().map(|a| (0..40).map(|k| swing(k, *a)).collect()).collect();
        let fine = pendulum("measured").replace("step = 0.005", "step = 0.00125");
        experiment(&fine, &readings).0
    }

    fn damping(plan: &Plan) -> Vec<Unknown> {
        vec![Unknown::of_theta(&plan.model, "pivot.damping", 0.1).unwrap()]
    }

    #[test]
    fn where_it_is_made_the_residuals_are_those_of_the_short_step() {
        let plan = swinging();
        let white = ArModel::white(vec![1e-3]).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white: white.clone() };
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let coarse = Coarse::of(&bench, &fitted).unwrap();
        assert_eq!(coarse.steps, 8);
        let seen = simulated(&coarse.plan, &coarse.fitted.records, &coarse.fitted.values).unwrap();
        for (a, b) in seen[0].residual.iter().zip(&fitted.residuals[0]) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        // made again from there it stays as it is
        assert_eq!(Coarse::of(&coarse.bench(&bench), &coarse.fitted).unwrap().steps, 1);
    }

    #[test]
    fn a_fit_on_long_steps_ends_where_that_of_the_short_ones_does() {
        let plan = swinging();
        let white = ArModel::white(vec![1e-4]).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white: white.clone() };
        let unknowns = damping(&plan);
        let path = |f: &Fitted| unknowns[0].value(&f.values);
        let short = fit(&plan, &plan.fitted, &plan.scene_values, &unknowns, Some(&white), &POLICY.fine).unwrap();
        let long = bench.polished(&plan.fitted, &plan.scene_values, &unknowns, &white, &POLICY.fine).unwrap();
        assert!(path(&short) > 1e-3, "{}", path(&short));
        assert!((path(&long) / path(&short) - 1.0).abs() < 1e-3, "{} {}", path(&long), path(&short));
        let [a, b] = [&long, &short].map(|f| squares(&plan, f, &white).unwrap());
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }

    /// Grids and scales of causes are those that the records call for, on whatever steps they are tried.
    #[test]
    fn causes_have_the_same_sizes_on_long_steps() {
        let plan = swinging();
        let white = ArModel::white(vec![1e-3]).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white: white.clone() };
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let coarse = Coarse::of(&bench, &fitted).unwrap();
        assert!(!coarse.is_fine());
        let sizes = |plan: &Plan| -> Vec<_> {
            let at = Situation { plan, values: &fitted.values, free: &[], together: true };
            library(&at).iter().map(|c| (c.title(), c.untestable.clone(), c.nuisance_grid.clone())).collect()
        };
        assert_eq!(sizes(&coarse.plan), sizes(&plan));
    }

    /// A clock that is ahead reads all samples, the last of them after the record's last input.
    #[test]
    fn a_reading_ahead_of_the_clock_loses_no_sample() {
        let plan = swinging();
        let (rec, mut values) = (&plan.fitted[0], plan.scene_values.clone());
        values.joints[0][DELAY] = -0.0231;
        let ahead = shoot(&plan, rec, &values, ShotWants::default()).unwrap().predicted;
        let mut longer = rec.clone();
        longer.inputs.extend(std::iter::repeat_n(rec.inputs[rec.inputs.len() - 1].clone(), 40));
        longer.record.time.iter_mut().for_each(|t| *t += 0.0231);
        let later = shoot(&plan, &longer, &plan.scene_values, ShotWants::default()).unwrap().predicted;
        assert!(ahead.len() == rec.record.time.len() && ahead.len() == later.len());
        assert!(ahead.iter().zip(&later).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
