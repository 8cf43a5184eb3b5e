//! Cutting records into shooting segments.

use super::constants::FIT;
use super::lm::{FitOptions, fit};
use crate::error::IdentifyError;
use crate::log::Record;
use crate::shooting::{OtherInputs, Plan, RecordPlan, ShotWants, pieces_by_record, shoot, state_at};
use crate::unknown::{Unknown, Values};
use pliant_math::State;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Segmentation of the fitted records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// Segments joined by continuity constraints: the statistics are those of whole records. A small disturbance of the initial state grows
    /// this much over them [-].
    Joined(f64),
    /// Pieces of this length \[s\] on their own, each with an unknown initial state: the simulation is too sensitive to its
    /// initial state to be followed for longer.
    Pieces(f64),
}

/// Gives every record its segments: of `length` \[s\] if given, else of at most half a second. Records that start at rest have one. The
/// states of joined segments are left to [`approach`].
///
/// Where a disturbance of the initial state grows more than `most`-fold within a record, and no length is given, all records are cut into pieces
/// without constraints instead, as long as it takes to grow e-fold: joined, every cause would look like every other, and like the initial state.
/// The plan keeps the records as they were beside their pieces.
pub fn cut(plan: &mut Plan, values: &Values, length: Option<f64>, most: f64) -> Result<Cut, IdentifyError> {
    let fitted = std::mem::take(&mut plan.fitted);
    let (mut e_fold, mut wildest) = (f64::INFINITY, 1.0f64);
    for rec in fitted.iter().filter(|rec| length.is_none() && !rec.start.is_fixed()) {
        let whole = rec.inputs.len() as f64 * plan.model.step_length();
        let grown = growth(plan, rec, values)?;
        e_fold = e_fold.min(if grown <= FIT.growth { whole } else { whole / grown.ln() });
        wildest = wildest.max(grown);
    }
    let segment = length.unwrap_or(e_fold.min(FIT.longest_segment)).max(FIT.shortest_segment);
    let pieces = wildest > most;
    if pieces {
        plan.fitted = fitted.iter().map(|rec| split(plan, rec, segment)).collect::<Result<Vec<_>, _>>()?.concat();
        (plan.wholes, plan.followed) = (Arc::new(fitted), followed(plan, values)?);
    } else {
        plan.fitted = fitted.into_iter().map(|rec| joined(plan, rec, segment)).collect();
        (plan.wholes, plan.followed) = (Arc::default(), f64::INFINITY);
    }
    Ok(if pieces { Cut::Pieces(segment) } else { Cut::Joined(wildest) })
}

/// Records as far as a model can be asked to follow them: as they are, or in parts over which a disturbance grows a thousandfold where the fitted ones are
/// in pieces. The rest of a longer one says how a disturbance grew, of any model.
pub fn followable(plan: &Plan, records: &[RecordPlan]) -> Result<Vec<RecordPlan>, IdentifyError> {
    let one = |rec: &RecordPlan| {
        let (whole, parts) = (rec.record.duration(), (rec.record.duration() / plan.followed).ceil());
        if parts > 1.0 { split(plan, rec, whole / parts) } else { Ok(vec![rec.clone()]) }
    };
    Ok(records.iter().map(one).collect::<Result<Vec<_>, _>>()?.concat())
}

/// Time in which a disturbance of a plan in pieces grows a thousandfold \[s\], in the record where it does so first. Its growth is that along the pieces,
/// which lie at the readings: what was balanced and is simulated as a whole lies at the bottom soon, where nothing grows.
fn followed(plan: &Plan, values: &Values) -> Result<f64, IdentifyError> {
    let growths = plan.fitted.par_iter().map(|rec| growth(plan, rec, values)).collect::<Result<Vec<_>, _>>()?;
    let rate = |of: Range<usize>| {
        let steps: usize = plan.fitted[of.clone()].iter().map(|rec| rec.inputs.len()).sum();
        growths[of].iter().map(|grown| grown.ln()).sum::<f64>() / (steps as f64 * plan.model.step_length())
    };
    let fastest = pieces_by_record(&plan.fitted).into_iter().map(rate).fold(0.0, f64::max);
    Ok(FIT.growth_followed.ln() / fastest)
}

/// Growth of a small disturbance of the initial state over a record.
pub fn growth(plan: &Plan, rec: &RecordPlan, values: &Values) -> Result<f64, IdentifyError> {
    let mut moved = rec.clone();
    moved.start.z.iter_mut().enumerate().for_each(|(i, z)| *z += FIT.disturbance * (i as f64 * 2.399).cos());
    let (states, other) = (states(plan, rec, values)?, states(plan, &moved, values)?);
    let distance = |k: usize| difference(&states[k], &other[k], plan.model.step_length());
    Ok(distance(states.len() - 1) / distance(0).max(1e-300))
}

/// The record with joined segments of about `seconds`.
fn joined(plan: &Plan, mut rec: RecordPlan, seconds: f64) -> RecordPlan {
    let (h, steps) = (plan.model.step_length(), rec.inputs.len());
    let per_segment = (seconds / h).round().clamp(2.0, steps.max(2) as f64) as usize;
    let segments = if rec.start.is_fixed() { 1 } else { steps.div_ceil(per_segment).max(1) };
    rec.nodes = (1..segments).map(|s| (s * steps / segments, rec.start.mean.clone())).collect();
    rec
}

/// The record as pieces of about `seconds` that start at a sample, each a record of its own. All but the first begin to be read `FIT.lead`
/// later, and the one before is read until then; with ropes or cloth they are read at once, since the first reading tells how the ends are held.
fn split(plan: &Plan, rec: &RecordPlan, seconds: f64) -> Result<Vec<RecordPlan>, IdentifyError> {
    let (h, steps) = (plan.model.step_length(), rec.inputs.len());
    let per_piece = (seconds / h).round().clamp(2.0, steps.max(2) as f64) as usize;
    let sample_at = |step: usize| {
        let t = step as f64 * h;
        let k = rec.record.time.partition_point(|x| *x < t - FIT.same_time * h);
        rec.record.time.get(k).filter(|x| (*x - t).abs() <= FIT.same_time * h).map(|_| k)
    };
    let mut starts: Vec<(usize, usize)> = vec![(0, 0)];
    let mut wanted = per_piece;
    while wanted + per_piece / 2 < steps {
        // a piece has to start at a sample: there the inputs are known
        match (wanted..steps).find_map(|s| sample_at(s).map(|k| (s, k))) {
            Some(start) => starts.push(start),
            None => break,
        }
        wanted = starts[starts.len() - 1].0 + per_piece;
    }
    let time = &rec.record.time;
    let lead = if plan.model.n_nodes() == 0 { FIT.lead } else { 0.0 };
    let first_read = |start: (usize, usize)| match start {
        (0, _) => 0,
        (_, sample) => time.partition_point(|t| *t < time[sample] + lead - FIT.same_time * h).min(time.len() - 1),
    };
    let mut pieces = Vec::with_capacity(starts.len());
    for (i, &(step, sample)) in starts.iter().enumerate() {
        let end_sample = starts.get(i + 1).map_or(time.len(), |next| first_read(*next) + 1);
        let end_step = (time[end_sample - 1] / h - FIT.same_time).ceil().clamp(step as f64 + 1.0, steps as f64) as usize;
        let start = state_at(plan, &rec.record, sample)?;
        let name = format!("{} from {:.2} s", rec.record.name, time[sample]);
        let record = Record { name, ..rec.record.piece(first_read((step, sample))..end_sample, step as f64 * h) };
        let back = (FIT.past / h).round() as usize;
        // of the inputs as they are, and as other readings of the log have them
        let cut = |inputs: &[Vec<f64>], past: &[Vec<f64>]| {
            let past = if step == 0 { past } else { &inputs[step.saturating_sub(back)..step] };
            (inputs[step..end_step].to_vec(), past.to_vec())
        };
        let (inputs, past) = cut(&rec.inputs, &rec.past);
        let other = |way: usize| {
            let (inputs, past) = cut(&rec.others[way].inputs, &rec.others[way].past);
            OtherInputs { inputs, past }
        };
        pieces.push(RecordPlan {
            record,
            inputs,
            past,
            others: Arc::new([0, 1].map(other)),
            start,
            sizes: rec.sizes.clone(),
            nodes: Vec::new(),
            parent: rec.parent,
            correction: Arc::default(),
            weight: 1.0,
        });
    }
    Ok(pieces)
}

/// Values of `unknowns` and records from which a fit over whole records converges.
///
/// A parameter far off bends a long trajectory out of the range of its linearization, but not short pieces that start at the data.
/// Such pieces (of many records, those of every second, third ...) are fitted first, with white noise; then the whole records are
/// simulated with the values found. Pieces and records at rest stay as they are.
pub fn approach(
    plan: &Plan,
    records: &[RecordPlan],
    values: &Values,
    unknowns: &[Unknown],
    options: &FitOptions,
) -> Result<(Values, Vec<RecordPlan>), IdentifyError> {
    let whole = |rec: &RecordPlan| plan.given || !rec.nodes.is_empty();
    if !records.iter().all(whole) {
        return Ok((values.clone(), records.to_vec()));
    }
    let every = records.len().div_ceil(FIT.approached);
    let pieces =
        records.iter().step_by(every).map(|rec| split(plan, rec, FIT.longest_segment)).collect::<Result<Vec<_>, _>>()?.concat();
    let short = FitOptions { rounds: 0, tolerance: FIT.approach_tolerance, ..*options };
    let values = fit(plan, &pieces, values, unknowns, None, &short)?.values;
    let follow = |rec: &RecordPlan| -> Result<RecordPlan, IdentifyError> {
        let mut rec = rec.clone();
        rec.start.z.fill(0.0);
        let steps: Vec<usize> = rec.nodes.drain(..).map(|(step, _)| step).collect();
        let states = states(plan, &rec, &values)?;
        rec.nodes = steps.into_iter().map(|step| (step, states[step].clone())).collect();
        Ok(rec)
    };
    let records = records.par_iter().map(follow).collect::<Result<_, _>>()?;
    Ok((values, records))
}

fn states(plan: &Plan, rec: &RecordPlan, values: &Values) -> Result<Vec<State>, IdentifyError> {
    let wants = ShotWants { states: true, ..ShotWants::default() };
    let shot = shoot(plan, rec, values, wants);
    shot.map(|s| s.states).map_err(|e| IdentifyError::Simulation { record: rec.record.name.clone(), source: e })
}

fn difference(a: &State, b: &State, h: f64) -> f64 {
    let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
    (sum(&a.q, &b.q) + h * h * sum(&a.v, &b.v)).sqrt()
}
