//! The simulation's own error: how far halving the step moves the readings, against the residual.

use crate::error::IdentifyError;
use crate::shooting::{Plan, RecordPlan, ShotWants, shoot};
use crate::unknown::Values;
use rayon::prelude::*;
use std::sync::Arc;

/// A simulation error above this part of the residual is a cause of its own.
pub const TOLERATED: f64 = 0.1;

/// What halving the step changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Discretisation {
    /// Root mean square change of the readings, extrapolated to the error of the scene's step.
    pub rms: f64,
    /// The same over the residual's root mean square.
    pub ratio: f64,
    /// The step \[s\] that would bring it to [`TOLERATED`].
    pub step_needed: f64,
    /// Order of the integrator.
    pub order: i32,
}

/// Compares the readings at the scene's step h with those at h/2 on every record; `rmse` is the residual's.
pub fn discretisation(plan: &Plan, records: &[RecordPlan], values: &Values, rmse: f64) -> Result<Discretisation, IdentifyError> {
    let h = plan.model.step_length();
    let fine = Plan { model: Arc::new(plan.model.with_step(0.5 * h)), fitted: Vec::new(), held_out: Vec::new(), ..plan.clone() };
    let one = |rec: &RecordPlan| -> Result<Vec<f64>, IdentifyError> {
        let named = |source| IdentifyError::Simulation { record: rec.record.name.clone(), source };
        let plain = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let coarse = shoot(plan, &plain, values, ShotWants::default()).map_err(named)?.predicted;
        let inputs = halved(&plain, plan);
        let past = plain.past.iter().flat_map(|row| [row.clone(), row.clone()]).collect();
        let finer = shoot(&fine, &RecordPlan { inputs, past, other: Arc::default(), ..plain }, values, ShotWants::default())
            .map_err(named)?
            .predicted;
        Ok(coarse.iter().zip(&finer).map(|(a, b)| a - b).collect())
    };
    let changes: Vec<Vec<f64>> = records.par_iter().map(one).collect::<Result<_, _>>()?;
    let order = match plan.model.integrator() {
        pliant_scene::Integrator::Euler | pliant_scene::Integrator::QuasiStatic => 1,
        pliant_scene::Integrator::Midpoint | pliant_scene::Integrator::Sdirk2 => 2,
    };
    // Richardson: the error at h is the change over (1 − 2^−order)
    let rms = plan.rms(&changes) / (1.0 - 0.5f64.powi(order));
    let ratio = rms / rmse.max(f64::MIN_POSITIVE);
    let step_needed = if ratio > TOLERATED { h * (TOLERATED / ratio).powf(1.0 / f64::from(order)) } else { h };
    Ok(Discretisation { rms, ratio, step_needed, order })
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
