//! Cutting records into shooting segments.

use crate::error::IdentifyError;
use crate::shoot::{Plan, RecordPlan, ShotWants, shoot};
use crate::unknown::Values;
use pliant_engine::state::State;

/// Growth of a small disturbance over a segment that is still harmless: one Lyapunov time.
const GROWTH: f64 = std::f64::consts::E;

/// Gives every record its segments: of `length` [s] if given, else as long as a disturbance of the initial state takes to
/// grow e-fold (a damped rope: the whole record). Segment states start on the trajectory simulated with `values`.
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
            if grown <= GROWTH { steps } else { ((steps as f64 / grown.ln()) as usize).max(2) }
        }
    };
    let segments = steps.div_ceil(per_segment).max(1);
    rec.nodes = (1..segments).map(|s| (s * steps / segments, states[s * steps / segments].clone())).collect();
    Ok(segments)
}

fn difference(a: &State, b: &State, h: f64) -> f64 {
    let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
    (sum(&a.q, &b.q) + h * h * sum(&a.v, &b.v)).sqrt()
}
