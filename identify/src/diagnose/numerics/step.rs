//! The simulation's own error in time: how far a step of half the length moves the readings.

use crate::error::IdentifyError;
use crate::shooting::{Plan, RecordPlan, ShotWants, shoot};
use crate::unknown::Values;
use pliant_scene::Integrator;
use rayon::prelude::*;
use std::sync::Arc;

/// Order of the scene's integrator.
pub(super) fn order(plan: &Plan) -> i32 {
    match plan.model.integrator() {
        Integrator::Euler | Integrator::QuasiStatic => 1,
        Integrator::Midpoint | Integrator::Sdirk2 => 2,
    }
}

/// Readings at a vanishing step less those at the scene's, of every record: by Richardson's extrapolation (y(h/2) − y(h)) / (1 − 2^−order).
pub(super) fn shift(plan: &Plan, records: &[RecordPlan], values: &Values) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let h = plan.model.step_length();
    let fine = Plan { model: Arc::new(plan.model.with_step(0.5 * h)), fitted: Vec::new(), held_out: Vec::new(), ..plan.clone() };
    let extrapolated = 1.0 / (1.0 - 0.5f64.powi(order(plan)));
    let one = |rec: &RecordPlan| -> Result<Vec<f64>, IdentifyError> {
        let named = |source| IdentifyError::Simulation { record: rec.record.name.clone(), source };
        let plain = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let coarse = shoot(plan, &plain, values, ShotWants::default()).map_err(named)?.predicted;
        let inputs = halved(&plain, plan);
        let past = plain.past.iter().flat_map(|row| [row.clone(), row.clone()]).collect();
        let finer = shoot(&fine, &RecordPlan { inputs, past, others: Arc::default(), ..plain }, values, ShotWants::default())
            .map_err(named)?
            .predicted;
        Ok(coarse.iter().zip(&finer).map(|(a, b)| extrapolated * (b - a)).collect())
    };
    records.par_iter().map(one).collect()
}

/// The same piecewise-linear inputs on steps of half the length.
fn halved(rec: &RecordPlan, plan: &Plan) -> Vec<Vec<f64>> {
    let mut out = Vec::with_capacity(2 * rec.inputs.len());
    let mut before = rec.record.inputs[0].clone();
    let of_grippers = plan.model.drives().iter().flat_map(|d| std::iter::repeat_n(d.is_prescribed(), d.n_controls()));
    let prescribed: Vec<bool> = of_grippers.chain(std::iter::repeat(false)).take(plan.model.nu()).collect();
    for row in &rec.inputs {
        // positions are passed half-way, velocities are the same in both halves
        out.push(row.iter().zip(&before).zip(&prescribed).map(|((r, b), p)| if *p { 0.5 * (r + b) } else { *r }).collect());
        out.push(row.clone());
        before.clone_from(row);
    }
    out
}
