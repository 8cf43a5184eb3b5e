//! Step 2: refit of the declared free parameters.

use super::result::Estimate;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, approach, cut, fit};
use crate::log::{Logs, Setup};
use crate::shoot::{Plan, ShotWants, shoot};
use crate::unknown::{Target, Unknown};
use serde::Serialize;

/// Result of a plain system identification.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// Version of this object.
    pub schema_version: u32,
    /// Fitted parameters with 90 % intervals.
    pub parameters: Vec<Estimate>,
    /// Root mean square residual on the fitted records \[m\].
    pub rmse_fit: f64,
    /// On the held-out records \[m\], if there are any.
    pub rmse_held_out: Option<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Whether it converged.
    pub converged: bool,
    /// Numbers of records.
    pub records: super::RecordCount,
    /// Combinations of parameters that the data do not determine.
    pub unidentifiable: Vec<String>,
}

impl std::fmt::Display for FitReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for p in &self.parameters {
            writeln!(
                f,
                "{} = {:.6e} {}  (90 %: {:.6e} to {:.6e}; scene: {:.6e})",
                p.path, p.estimate, p.unit, p.interval[0], p.interval[1], p.scene_value
            )?;
        }
        writeln!(f, "residual {:.3e} m on {} fitted records", self.rmse_fit, self.records.fit)?;
        if let Some(held_out) = self.rmse_held_out {
            writeln!(f, "residual {:.3e} m on {} held-out records", held_out, self.records.held_out)?;
        }
        for line in &self.unidentifiable {
            writeln!(f, "not determined by these data: {line}")?;
        }
        Ok(())
    }
}

/// The declared free parameters as unknowns.
pub(super) fn declared(setup: &Setup, plan: &Plan) -> Result<Vec<Unknown>, IdentifyError> {
    let one = |free: &crate::log::Free| {
        let sensor = crate::sensor::SENSOR_PATHS.iter().position(|p| *p == free.path);
        let unknown = match sensor {
            Some(entry) => Some(Unknown::of_sensor(entry, 0.01, (free.lower, free.upper))),
            None => Unknown::of_theta(&plan.model, &free.path, 0.1 * (free.upper - free.lower)),
        };
        let mut unknown = unknown.ok_or_else(|| {
            let nearest = plan.model.params().nearest(&free.path).unwrap_or("?").to_owned();
            IdentifyError::Input(format!("experiment.fit.free: there is no parameter `{}`; did you mean `{nearest}`?", free.path))
        })?;
        unknown.bounds = (unknown.bounds.0.max(free.lower), unknown.bounds.1.min(free.upper));
        unknown.prior = free.prior.as_ref().map(|p| (p.mean, p.std));
        let value = unknown.value(&plan.scene_values);
        if value < unknown.bounds.0 || value > unknown.bounds.1 {
            return Err(IdentifyError::Input(format!(
                "experiment.fit.free: the scene's {} = {value} lies outside its bounds [{}, {}]; widen the bounds or change the scene",
                free.path, unknown.bounds.0, unknown.bounds.1
            )));
        }
        let positive = value > 0.0 && unknown.bounds.0 >= 0.0 && matches!(unknown.target, Target::Theta(_));
        Ok(if positive { unknown.logarithmic() } else { unknown })
    };
    setup.experiment.fit.free.iter().map(one).collect()
}

/// Refuses free parameters that influence nothing that was measured.
pub(super) fn refuse_dead(plan: &Plan, unknowns: &[Unknown]) -> Result<(), IdentifyError> {
    let k = unknowns.len();
    let mut norm = vec![0.0f64; k];
    for rec in &plan.fitted {
        let wants = ShotWants { unknowns, tangents: true, ..ShotWants::default() };
        let shot = shoot(plan, rec, &plan.scene_values, wants)
            .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })?;
        for row in shot.global.chunks_exact(k.max(1)) {
            norm.iter_mut().zip(row).for_each(|(n, d)| *n += d * d);
        }
    }
    match norm.iter().position(|n| *n < 1e-24) {
        Some(dead) if k > 0 => Err(IdentifyError::DeadParameter { path: unknowns[dead].path.clone() }),
        _ => Ok(()),
    }
}

/// Baseline fit: segments, noise model, declared unknowns.
pub(super) fn baseline(setup: &Setup, plan: &mut Plan, options: &FitOptions) -> Result<Fitted, IdentifyError> {
    let unknowns = declared(setup, plan)?;
    refuse_dead(plan, &unknowns)?;
    let values = plan.scene_values.clone();
    cut(plan, &values, setup.experiment.fit.segment)?;
    let (values, records) = approach(plan, &plan.fitted, &values, &unknowns, options)?;
    fit(plan, &records, &values, &unknowns, None, options)
}

/// Plain system identification: fits the declared free parameters and reports them.
pub fn fit_scene(
    setup: &Setup,
    logs: &Logs,
    _options: &super::DiagnoseOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<FitReport, IdentifyError> {
    let mut plan = Plan::new(setup, logs)?;
    if setup.experiment.fit.free.is_empty() {
        return Err(IdentifyError::Input("nothing to fit: list parameters in experiment.fit.free".to_owned()));
    }
    let options = FitOptions { noise_floor: setup.experiment.noise_floor, ..FitOptions::default() };
    progress("fitting");
    let fitted = baseline(setup, &mut plan, &options)?;
    progress("intervals");
    let curvature = super::certainty::Curvature::new(&plan, &fitted)?;
    let parameters = super::certainty::estimates(&plan, &fitted, &curvature);
    let held_out = if plan.held_out.is_empty() { None } else { Some(super::gain::held_out_rmse(&plan, &fitted)?) };
    Ok(FitReport {
        schema_version: super::SCHEMA_VERSION,
        parameters,
        rmse_fit: fitted.rmse,
        rmse_held_out: held_out,
        iterations: fitted.iterations,
        converged: fitted.converged,
        records: super::RecordCount { fit: plan.fitted_records(), held_out: plan.held_out.len() },
        unidentifiable: curvature.unidentifiable(&fitted),
    })
}
