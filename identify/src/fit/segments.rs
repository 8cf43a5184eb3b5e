//! Cutting records into shooting segments.

use crate::error::IdentifyError;
use crate::shoot::{Plan, RecordPlan, ShotWants, shoot, state_at};
use crate::unknown::Values;
use pliant_engine::state::State;

/// Growth of a small disturbance over a segment that is still harmless: one Lyapunov time.
const GROWTH: f64 = std::f64::consts::E;

/// Longest segment of a record whose initial state is unknown [s]: short enough to stay near the data while parameters are wrong.
const LONGEST: f64 = 0.5;

/// Gives every record its segments: of `length` \[s\] if given, else as long as a disturbance of the initial state takes to
/// grow e-fold, at most half a second. Records that start at rest have one. Segment states start where the data have them,
/// so that a wrong parameter meets a trajectory that is right.
pub fn cut(plan: &mut Plan, values: &Values, length: Option<f64>) -> Result<usize, IdentifyError> {
    let mut fitted = std::mem::take(&mut plan.fitted);
    let mut most = 1;
    for rec in &mut fitted {
        most = most.max(cut_record(plan, rec, values, length)?);
    }
    plan.fitted = fitted;
    Ok(most)
}

fn cut_record(plan: &Plan, rec: &mut RecordPlan, values: &Values, length: Option<f64>) -> Result<usize, IdentifyError> {
    let h = plan.model.step_length();
    let steps = rec.inputs.len();
    let run = |rec: &RecordPlan| {
        let wants = ShotWants { states: true, ..ShotWants::default() };
        shoot(plan, rec, values, wants).map_err(|e| IdentifyError::Simulation { record: rec.record.name.clone(), source: e })
    };
    let states = run(rec)?.states;
    let per_segment = match length {
        Some(length) => ((length / h).round() as usize).max(2),
        None if rec.start.spread.is_empty() => steps,
        None => {
            let mut moved = rec.clone();
            moved.start.z.iter_mut().enumerate().for_each(|(i, z)| *z += 1e-4 * (i as f64 * 2.399).cos());
            let other = run(&moved)?.states;
            let distance = |k: usize| difference(&states[k], &other[k], h);
            let grown = distance(states.len() - 1) / distance(0).max(1e-300);
            let lyapunov = if grown <= GROWTH { steps } else { ((steps as f64 / grown.ln()) as usize).max(2) };
            lyapunov.min(((LONGEST / h).round() as usize).max(2))
        }
    };
    let segments = steps.div_ceil(per_segment).max(1);
    rec.nodes = (1..segments).map(|s| (s * steps / segments, states[s * steps / segments].clone())).collect();
    restart(plan, rec)?;
    Ok(segments)
}

/// Puts the segment states back to where the data have them.
pub fn restart(plan: &Plan, rec: &mut RecordPlan) -> Result<(), IdentifyError> {
    if rec.start.spread.is_empty() {
        return Ok(());
    }
    let h = plan.model.step_length();
    for (step, state) in &mut rec.nodes {
        let t = *step as f64 * h;
        let sample = rec.record.time.partition_point(|x| *x < t - 0.5 * h).min(rec.record.time.len() - 1);
        *state = state_at(plan, &rec.record, sample)?.0;
    }
    Ok(())
}

fn difference(a: &State, b: &State, h: f64) -> f64 {
    let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
    (sum(&a.q, &b.q) + h * h * sum(&a.v, &b.v)).sqrt()
}
