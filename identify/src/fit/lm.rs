//! Bounded Levenberg–Marquardt over all fitted records.

use super::arrow::{Share, decrease, solve};
use super::constants::FIT;
use super::noise::{first_noise, fit_noise};
use crate::error::IdentifyError;
use crate::shooting::{Plan, RecordPlan, Shot, ShotWants, own_squares, own_unknowns, pieces_by_record, shoot};
use crate::stats::ar::ArModel;
use crate::unknown::{Unknown, Values};
use nalgebra::DVector;
use rayon::prelude::*;
use std::ops::Range;

/// Options of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Most iterations per round.
    pub max_iterations: usize,
    /// Rounds of re-estimating the noise model.
    pub rounds: usize,
    /// An accepted step that lowers the cost by less than this part ends the last round; rounds before it end earlier.
    pub tolerance: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { max_iterations: 30, rounds: 3, tolerance: 1e-6 }
    }
}

/// A converged fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The free unknowns.
    pub unknowns: Vec<Unknown>,
    /// Values at the optimum.
    pub values: Values,
    /// Records with their estimated initial states.
    pub records: Vec<RecordPlan>,
    /// Measured − simulated of each record, rows (time, channel).
    pub residuals: Vec<Vec<f64>>,
    /// Noise model of the residuals.
    pub noise: ArModel,
    /// −2 log likelihood under the noise model.
    pub deviance: f64,
    /// Root mean square of the residuals in the reported unit.
    pub rmse: f64,
    /// Iterations in all.
    pub iterations: usize,
    /// Whether the last round converged.
    pub converged: bool,
}

impl Fitted {
    /// The fit seen on so many of its measured records at most, evenly chosen; its values are what they were.
    pub fn of_some(&self, most: usize) -> Self {
        let keep = evenly(&self.records, most);
        let kept = |k: &usize| keep[*k];
        let all = 0..self.records.len();
        let records = all.clone().filter(kept).map(|k| self.records[k].clone()).collect();
        let residuals = all.filter(kept).map(|k| self.residuals[k].clone()).collect();
        Self { records, residuals, ..self.clone() }
    }
}

/// Which of the records belong to so many measured ones at most, evenly chosen.
pub fn evenly(records: &[RecordPlan], most: usize) -> Vec<bool> {
    let mut parents: Vec<usize> = records.iter().map(|rec| rec.parent).collect();
    parents.dedup();
    let all = parents.len();
    let chosen = |k: usize| (2 * k + 1) * all / (2 * most);
    let kept: Vec<usize> = if all <= most { parents } else { (0..most).map(|k| parents[chosen(k)]).collect() };
    records.iter().map(|rec| kept.contains(&rec.parent)).collect()
}

/// One evaluation of all records.
struct Point {
    values: Values,
    records: Vec<RecordPlan>,
    cost: f64,
    /// Residuals as they are measured, empty before the first evaluation.
    residuals: Vec<Vec<f64>>,
}

/// Fits `unknowns` and the initial states from `start`, with the noise model `noise` in the first round (white with the
/// floor if `None`); with `rounds` = 0 the given noise model is kept.
pub fn fit(
    plan: &Plan,
    records: &[RecordPlan],
    start: &Values,
    unknowns: &[Unknown],
    noise: Option<&ArModel>,
    options: &FitOptions,
) -> Result<Fitted, IdentifyError> {
    let mut noise = match noise {
        Some(model) => model.clone(),
        None => first_noise(plan)?,
    };
    let mut point = Point { values: start.clone(), records: records.to_vec(), cost: f64::INFINITY, residuals: Vec::new() };
    let mut iterations = 0;
    let loose = FitOptions { tolerance: options.tolerance.max(FIT.loose), ..*options };
    for round in 0..options.rounds {
        iterations = minimise(plan, &mut point, unknowns, &noise, &loose, iterations)?.1;
        let next = noise_of(plan, &point, unknowns)?;
        let settled = round > 0 && alike(&noise, &next);
        noise = next;
        if settled {
            break;
        }
    }
    let converged;
    (converged, iterations) = minimise(plan, &mut point, unknowns, &noise, options, iterations)?;
    if options.rounds > 0 {
        noise = noise_of(plan, &point, unknowns)?;
    }
    let residuals = match point.cost.is_finite() {
        true => point.residuals,
        false => residuals(plan, &point)?,
    };
    let slices: Vec<&[f64]> = residuals.iter().map(Vec::as_slice).collect();
    let deviance = noise.minus_two_log_likelihood(&slices)?;
    let rmse = plan.rms(&residuals);
    Ok(Fitted {
        unknowns: unknowns.to_vec(),
        values: point.values,
        records: point.records,
        residuals,
        noise,
        deviance,
        rmse,
        iterations,
        converged,
    })
}

/// The noise model of a point's residuals.
fn noise_of(plan: &Plan, point: &Point, unknowns: &[Unknown]) -> Result<ArModel, IdentifyError> {
    let lost = unknowns.len() + own_unknowns(&point.records);
    fit_noise(plan, &point.residuals, lost)
}

fn alike(a: &ArModel, b: &ArModel) -> bool {
    let close = |x: &f64, y: &f64| (x - y).abs() <= FIT.same_coefficients * x.abs().max(y.abs()).max(FIT.least_coefficient);
    a.order() == b.order()
        && a.coefficients().iter().zip(b.coefficients()).all(|(x, y)| close(x, y))
        && a.sigma().iter().zip(b.sigma()).all(|(x, y)| (x / y).ln().abs() < FIT.same_coefficients)
}

fn simulation(rec: &RecordPlan) -> impl Fn(pliant_engine::step::StepError) -> IdentifyError + '_ {
    |source| IdentifyError::Simulation { record: rec.record.name.clone(), source }
}

fn residuals(plan: &Plan, point: &Point) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let one =
        |rec: &RecordPlan| shoot(plan, rec, &point.values, ShotWants::default()).map(|s| s.residual).map_err(simulation(rec));
    point.records.par_iter().map(one).collect()
}

/// Whitened squares of a record and its defects, and its residuals; infinite if it cannot be simulated there.
fn squares(plan: &Plan, rec: &RecordPlan, values: &Values, noise: &ArModel) -> (f64, Vec<f64>) {
    let Ok(shot) = shoot(plan, rec, values, ShotWants::default()) else { return (f64::INFINITY, Vec::new()) };
    let mut r = shot.residual.clone();
    match noise.whiten(&mut r, plan.channels()) {
        Ok(()) => (r.iter().map(|a| a * a).sum::<f64>() + (shot.defect / FIT.defect_sigma).powi(2), shot.residual),
        Err(_) => (f64::INFINITY, Vec::new()),
    }
}

/// Whitened cost of a point, and its residuals; infinite if a record cannot be simulated there.
fn cost(plan: &Plan, values: &Values, records: &[RecordPlan], unknowns: &[Unknown], noise: &ArModel) -> (f64, Vec<Vec<f64>>) {
    let (parts, residuals): (Vec<f64>, Vec<Vec<f64>>) = records.par_iter().map(|rec| squares(plan, rec, values, noise)).unzip();
    (parts.iter().sum::<f64>() + own_squares(records) + prior_cost(values, unknowns), residuals)
}

fn prior_cost(values: &Values, unknowns: &[Unknown]) -> f64 {
    unknowns.iter().filter_map(|u| u.prior.map(|(mean, std)| ((u.value(values) - mean) / std).powi(2))).sum()
}

/// Descends until no record is nearer to its readings from where they say that it begins than from where the descent has taken it: the start of a
/// record imitates what a model lacks, and when the model has it no slope may lead back (where friction holds a joint, its velocity at
/// the start counts for nothing).
fn minimise(
    plan: &Plan,
    point: &mut Point,
    unknowns: &[Unknown],
    noise: &ArModel,
    options: &FitOptions,
    mut iterations: usize,
) -> Result<(bool, usize), IdentifyError> {
    loop {
        let converged;
        (converged, iterations) = descend(plan, point, unknowns, noise, options, iterations)?;
        if !begin_as_read(plan, point, noise, options.tolerance) {
            return Ok((converged, iterations));
        }
    }
}

/// Takes the records back to the starts that their readings tell where that lowers the cost by more than a part of it; whether any was.
fn begin_as_read(plan: &Plan, point: &mut Point, noise: &ArModel, tolerance: f64) -> bool {
    let one = |rec: &RecordPlan| -> Option<(RecordPlan, f64)> {
        let away: f64 = rec.start.z.iter().map(|z| z * z).sum();
        if away == 0.0 || !rec.nodes.is_empty() {
            return None;
        }
        let mut back = rec.clone();
        back.start.z.fill(0.0);
        let now = squares(plan, rec, &point.values, noise).0 + away;
        let drop = now - squares(plan, &back, &point.values, noise).0;
        (drop > 0.0).then_some((back, drop))
    };
    let back: Vec<Option<(RecordPlan, f64)>> = point.records.par_iter().map(one).collect();
    let drop: f64 = back.iter().flatten().map(|(_, drop)| drop).sum();
    let any = drop > tolerance.max(FIT.cost_rounding) * point.cost;
    if any {
        point.records.iter_mut().zip(back).for_each(|(rec, back)| back.into_iter().for_each(|(back, _)| *rec = back));
    }
    any
}

/// Levenberg–Marquardt from a point on.
fn descend(
    plan: &Plan,
    point: &mut Point,
    unknowns: &[Unknown],
    noise: &ArModel,
    options: &FitOptions,
    mut iterations: usize,
) -> Result<(bool, usize), IdentifyError> {
    let mut damping = FIT.start_damping;
    (point.cost, point.residuals) = cost(plan, &point.values, &point.records, unknowns, noise);
    let free = |rec: &RecordPlan| !rec.z().is_empty() || !rec.nodes.is_empty();
    if unknowns.is_empty() && !point.records.iter().any(free) {
        return Ok((true, iterations));
    }
    for _ in 0..options.max_iterations {
        iterations += 1;
        let linear = Linear::new(plan, point, unknowns, noise)?;
        let mut accepted = None;
        while damping < FIT.largest_damping {
            let Some((trial, foretold)) = linear.step(plan, point, unknowns, noise, damping, 1.0) else {
                damping = (damping * FIT.raise_damping).max(FIT.start_damping);
                continue;
            };
            if trial.cost <= point.cost * (1.0 + FIT.cost_rounding) {
                accepted = Some((trial, foretold));
                break;
            }
            if (trial.cost - point.cost).abs() <= FIT.flat * point.cost {
                break;
            }
            damping = (damping * FIT.raise_damping).max(FIT.start_damping);
        }
        let Some((mut next, foretold)) = accepted else {
            return Ok((damping < FIT.largest_damping || point.cost.is_finite(), iterations));
        };
        // a step is too short where the cost falls by more than was foretold
        if point.cost - next.cost > foretold {
            linear.lengthen(plan, point, unknowns, noise, damping, &mut next);
        }
        let drop = point.cost - next.cost;
        let gain = drop / point.cost.max(f64::MIN_POSITIVE);
        *point = next;
        damping = (damping * FIT.lower_damping).max(FIT.least_damping);
        if gain <= options.tolerance || options.rounds > 0 && drop <= FIT.settled {
            return Ok((true, iterations));
        }
    }
    Ok((false, iterations))
}

/// The records' linearizations at a point.
struct Linear {
    /// Of every piece, or of all pieces of a record that share its sizes.
    shares: Vec<Share>,
    /// Tangents at the segments' starts.
    shots: Vec<Shot>,
}

impl Linear {
    fn new(plan: &Plan, point: &Point, unknowns: &[Unknown], noise: &ArModel) -> Result<Self, IdentifyError> {
        let one = |rec: &RecordPlan| -> Result<(Share, Shot), IdentifyError> {
            let wants = ShotWants { unknowns, tangents: true, ..ShotWants::default() };
            let mut shot = shoot(plan, rec, &point.values, wants).map_err(simulation(rec))?;
            let (m, k, channels) = (shot.own_columns, unknowns.len(), plan.channels());
            noise.whiten(&mut shot.residual, channels)?;
            if m > 0 {
                noise.whiten_columns(&mut shot.own, channels, m)?;
            }
            if k > 0 {
                noise.whiten_columns(&mut shot.global, channels, k)?;
            }
            let share = Share::new(&shot.residual, &shot.own, m, &shot.global, k, &rec.z());
            Ok((share, Shot { boundary: shot.boundary, own_columns: m, ..Shot::default() }))
        };
        let all: Vec<(Share, Shot)> = point.records.par_iter().map(one).collect::<Result<_, _>>()?;
        let (pieces, shots): (Vec<Share>, Vec<Shot>) = all.into_iter().unzip();
        let joined = |of: Range<usize>| {
            let rec = &point.records[of.start];
            Share::joined(&pieces[of], &rec.z()[rec.start.z.len()..])
        };
        Ok(Self { shares: sharing(&point.records).map(joined).collect(), shots })
    }

    /// Changes of each piece's own unknowns, from those of each share.
    fn by_piece(records: &[RecordPlan], own: &[DVector<f64>]) -> Vec<DVector<f64>> {
        let split = |(of, own): (Range<usize>, &DVector<f64>)| {
            let (starts, sizes) = own.as_slice().split_at(own.len() - records[of.start].own_sizes());
            let mut first = 0;
            let one = |rec: &RecordPlan| {
                let start = &starts[first..first + rec.start.z.len()];
                first += start.len();
                DVector::from_vec([start, sizes].concat())
            };
            records[of].iter().map(one).collect::<Vec<_>>()
        };
        sharing(records).zip(own).flat_map(split).collect()
    }

    /// Damped changes of the common unknowns and of each record's own.
    fn changes(&self, unknowns: &[Unknown], point: &Point, damping: f64) -> Option<(DVector<f64>, Vec<DVector<f64>>)> {
        let pulls = pulls(unknowns, point);
        let mut held = vec![false; unknowns.len()];
        loop {
            let (common, own) = solve(&self.shares, damping, &pulls, &held)?;
            // an unknown at a bound that wants to leave is held there, and the rest is solved again
            let leaving = unknowns.iter().zip(common.iter()).enumerate().find(|(j, (u, d))| {
                let value = u.value(&point.values);
                !held[*j] && u.leaves(value, **d)
            });
            match leaving {
                Some((j, _)) => held[j] = true,
                None => return Some((common, own)),
            }
        }
    }

    /// The point one damped step away, `length` times as far, and the decrease of the cost that is foretold of the step.
    fn step(
        &self,
        plan: &Plan,
        point: &Point,
        unknowns: &[Unknown],
        noise: &ArModel,
        damping: f64,
        length: f64,
    ) -> Option<(Point, f64)> {
        let (mut common, mut own) = self.changes(unknowns, point, damping)?;
        let foretold = decrease(&self.shares, &pulls(unknowns, point), &common, &own);
        common *= length;
        own.iter_mut().for_each(|dz| *dz *= length);
        let mut values = point.values.clone();
        for (u, delta) in unknowns.iter().zip(common.iter()) {
            u.set(&mut values, u.moved(u.value(&point.values), *delta));
        }
        let own = Self::by_piece(&point.records, &own);
        let moves = point.records.iter().zip(&own).zip(&self.shots);
        let mut records: Vec<RecordPlan> = moves.map(|((rec, dz), shot)| moved(plan, rec, dz, &common, shot)).collect();
        records.iter_mut().for_each(|rec| rec.keep_physical(&values));
        let (cost, residuals) = cost(plan, &values, &records, unknowns, noise);
        Some((Point { values, records, cost, residuals }, foretold))
    }

    /// Goes on along an accepted step, twice as far each time, while the cost falls: where the residual is large the curvature that
    /// Gauss–Newton leaves out makes its steps too short.
    fn lengthen(&self, plan: &Plan, point: &Point, unknowns: &[Unknown], noise: &ArModel, damping: f64, best: &mut Point) {
        if unknowns.is_empty() || point.records.iter().any(|rec| !rec.nodes.is_empty()) {
            return;
        }
        let mut length = 2.0;
        while length <= FIT.longest_step {
            match self.step(plan, point, unknowns, noise, damping, length) {
                Some((trial, _)) if trial.cost < best.cost => *best = trial,
                _ => return,
            }
            length *= 2.0;
        }
    }
}

/// The pieces that share unknowns of their own: those of a record with sizes, and each alone of all others.
fn sharing(records: &[RecordPlan]) -> impl Iterator<Item = Range<usize>> + '_ {
    pieces_by_record(records).into_iter().flat_map(|of| {
        let step = if records[of.start].own_sizes() > 0 { of.len() } else { 1 };
        of.clone().step_by(step).map(move |first| first..first + step)
    })
}

/// (weight, weighted pull) of the unknowns' priors.
fn pulls(unknowns: &[Unknown], point: &Point) -> Vec<(f64, f64)> {
    let one = |u: &Unknown| {
        let value = u.value(&point.values);
        u.prior.map_or((0.0, 0.0), |(mean, std)| {
            let slope = u.slope(value) / std;
            (slope * slope, slope * (mean - value) / std)
        })
    };
    unknowns.iter().map(one).collect()
}

/// A record's initial and segment states moved along the condensed step; history variables are those of the simulation.
fn moved(plan: &Plan, rec: &RecordPlan, dz: &DVector<f64>, dphi: &DVector<f64>, shot: &Shot) -> RecordPlan {
    let mut out = rec.clone();
    out.move_own(dz.as_slice());
    let step: Vec<f64> = dz.iter().chain(dphi.iter()).copied().chain([1.0]).collect();
    for ((_, state), tangent) in out.nodes.iter_mut().zip(&shot.boundary) {
        let change = |row: &[f64]| row.iter().zip(&step).map(|(t, s)| t * s).sum::<f64>();
        let rows = tangent.q.chunks_exact(step.len()).chain(tangent.v.chunks_exact(step.len()));
        let mut along: Vec<f64> = rows.map(change).collect();
        along.resize(plan.model.ndx(), 0.0);
        *state = plan.model.displaced(state, &along);
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::Record;
    use std::sync::Arc;

    fn record(parent: usize) -> RecordPlan {
        RecordPlan {
            record: Record::default(),
            inputs: Vec::new(),
            past: Vec::new(),
            others: Arc::default(),
            start: Default::default(),
            sizes: Vec::new(),
            nodes: Vec::new(),
            parent,
            correction: Arc::default(),
            weight: 1.0,
        }
    }

    #[test]
    fn pieces_are_solved_together_where_they_share_a_size() {
        let number = Unknown::of_sensor(0, 1.0, (-1.0, 1.0));
        let size = crate::shooting::OwnSize { of: vec![(number, 1.0)], beyond: 0.0, spread: Some(1.0) };
        let mut records = [0, 0, 1, 1, 1].map(record);
        assert_eq!(sharing(&records).collect::<Vec<_>>(), [0..1, 1..2, 2..3, 3..4, 4..5]);
        records[2..].iter_mut().for_each(|rec| rec.sizes.push(size.clone()));
        assert_eq!(sharing(&records).collect::<Vec<_>>(), [0..1, 1..2, 2..5]);
        let own = [vec![], vec![], vec![0.3]].map(DVector::from_vec);
        let by_piece = Linear::by_piece(&records, &own);
        assert_eq!(
            by_piece.iter().map(|d| d.as_slice().to_vec()).collect::<Vec<_>>(),
            [vec![], vec![], vec![0.3], vec![0.3], vec![0.3]]
        );
    }

    #[test]
    fn measured_records_are_chosen_evenly_with_all_their_pieces() {
        let of = |parents: &[usize]| parents.iter().map(|&p| record(p)).collect::<Vec<_>>();
        assert_eq!(evenly(&of(&[0, 0, 1, 2, 3, 3]), 2), [false, false, true, false, true, true]);
        assert_eq!(evenly(&of(&[0, 1]), 2), [true, true]);
        // some of some: their numbers are those of all
        assert_eq!(evenly(&of(&[7, 8, 8, 40, 41]), 2), [false, true, true, false, true]);
    }

    /// A start that a descent has left away from the readings goes back to them where they are right, and stays where the model asks for it.
    #[test]
    fn a_start_goes_back_to_the_readings_where_they_are_nearer() {
        use crate::diagnose::testing::{experiment, pendulum};
        let mut plan = experiment(&pendulum("measured"), &[vec![0.5; 40], vec![0.5; 40]]).0;
        let away = |plan: &Plan| {
            let mut rec = plan.fitted[0].clone();
            rec.start.z = vec![0.0, 3.0];
            rec
        };
        let white = ArModel::white(vec![1e-4]).unwrap();
        let read = |plan: &mut Plan, rec: &RecordPlan| {
            let seen = shoot(plan, rec, &plan.scene_values, ShotWants::default()).unwrap().predicted;
            plan.fitted[0].record.joints = seen.iter().map(|x| vec![*x]).collect();
        };
        let from_there = |plan: &Plan| {
            let cost = squares(plan, &away(plan), &plan.scene_values, &white).0 + 9.0;
            let mut point = Point { values: plan.scene_values.clone(), records: vec![away(plan)], cost, residuals: Vec::new() };
            let back = begin_as_read(plan, &mut point, &white, 1e-3);
            // a fit that takes no step of its own looks there too
            let options = FitOptions { max_iterations: 0, rounds: 0, tolerance: 1e-3 };
            let fitted = fit(plan, &[away(plan)], &plan.scene_values, &[], Some(&white), &options).unwrap();
            assert_eq!(fitted.records[0].start.z, point.records[0].start.z);
            (back, point.records[0].start.z.clone())
        };
        let rec = plan.fitted[0].clone();
        read(&mut plan, &rec);
        assert_eq!(from_there(&plan), (true, vec![0.0, 0.0]));
        let rec = away(&plan);
        read(&mut plan, &rec);
        assert_eq!(from_there(&plan), (false, vec![0.0, 3.0]));
    }
}
