//! Step 2: refit of the declared free parameters.
#![allow(rustdoc::broken_intra_doc_links)] // `[m]` is a unit here, and its escape would be read in the schema's descriptions

use super::policy::POLICY;
use super::procedure::Bench;
use super::procedure::scatter::scatter;
use super::result::Estimate;
use crate::causes::probed;
use crate::error::IdentifyError;
use crate::fit::{Cut, FIT, FitOptions, Fitted, cut, evenly, first_noise, fit, fit_noise};
use crate::log::{LogMistake, Logs, Setup};
use crate::number::{number_plain, quantity_plain, unit};
use crate::sensor::{JOINT_BOUNDS, SENSOR_BOUNDS, SENSOR_PATHS};
use crate::shooting::{Plan, RecordPlan, ShotWants, own_unknowns, shoot};
use crate::stats::ar::ArModel;
use crate::unknown::{Target, Unknown, Values};
use schemars::JsonSchema;
use serde::Serialize;

/// Result of a plain system identification.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FitReport {
    /// Version of this object.
    pub schema_version: u32,
    /// Fitted parameters with 90 % intervals.
    pub parameters: Vec<Estimate>,
    /// Unit of the residuals.
    pub unit: String,
    /// Root mean square residual on the fitted records.
    pub rmse_fit: f64,
    /// On the held-out records, if there are any.
    pub rmse_held_out: Option<f64>,
    /// The same of readings in other units.
    pub other_units: Vec<UnitResidual>,
    /// Iterations.
    pub iterations: usize,
    /// Whether it converged.
    pub converged: bool,
    /// Numbers of records.
    pub records: super::RecordCount,
    /// Combinations of parameters that the data do not determine, weights in the fit's coordinates; the intervals of the parameters
    /// in them are their bounds.
    pub unidentifiable: Vec<String>,
    /// Reservations about the estimates: a residual that is not noise, estimates at their bounds.
    pub warnings: Vec<String>,
}

/// Residuals of readings in one unit.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct UnitResidual {
    /// The unit.
    pub unit: String,
    /// Root mean square residual on the fitted records.
    pub rmse_fit: f64,
    /// On the held-out records, if there are any.
    pub rmse_held_out: Option<f64>,
}

impl std::fmt::Display for FitReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for p in &self.parameters {
            let interval = p.interval.map_or_else(String::new, |[low, high]| format!("90 %: {low:.6e} to {high:.6e}; "));
            // −0 is 0
            writeln!(f, "{} = {:.6e} {}  ({interval}scene: {:.6e})", p.path, p.estimate, p.unit, p.scene_value + 0.0)?;
        }
        let others = |of: fn(&UnitResidual) -> Option<f64>| -> String {
            self.other_units.iter().filter_map(|o| Some(format!(", {:.3e} {}", of(o)?, o.unit))).collect()
        };
        let fitted = others(|o| Some(o.rmse_fit));
        writeln!(f, "residual {:.3e} {}{fitted} on {} fitted records", self.rmse_fit, self.unit, self.records.fit)?;
        if let Some(held_out) = self.rmse_held_out {
            let unseen = others(|o| o.rmse_held_out);
            writeln!(f, "residual {held_out:.3e} {}{unseen} on {} held-out records", self.unit, self.records.held_out)?;
        }
        for line in &self.unidentifiable {
            writeln!(f, "not determined by these data: {line}")?;
        }
        for line in &self.warnings {
            writeln!(f, "warning: {line}")?;
        }
        Ok(())
    }
}

/// The declared free parameters as unknowns.
pub(super) fn declared(setup: &Setup, plan: &Plan) -> Result<Vec<Unknown>, IdentifyError> {
    setup.check_free(plan.model.params())?;
    let one = |free: &crate::log::Free| {
        let of_joint = |sensor: usize| setup.experiment.joint[sensor].paths().iter().position(|p| *p == free.path);
        let joint = (0..setup.experiment.joint.len()).find_map(|sensor| Some((sensor, of_joint(sensor)?)));
        let width = POLICY.declared_size * (free.upper - free.lower);
        let beside = setup.offset_path(&free.path);
        let mut unknown = match (SENSOR_PATHS.iter().position(|path| *path == free.path), joint, beside) {
            (Some(entry), ..) => Unknown::of_sensor(entry, POLICY.sensor_size, SENSOR_BOUNDS[entry]),
            (.., Some((marker, axis))) => Unknown::beside(free.path.clone(), vec![marker], axis, width),
            (None, Some((sensor, entry)), None) => {
                let unit = setup.joint_units(sensor)[entry];
                Unknown::of_joint(free.path.clone(), unit, (sensor, entry), width, JOINT_BOUNDS[entry])
            }
            (None, None, None) => probed(plan, Unknown::of_theta(&plan.model, &free.path, width)?),
        };
        unknown.bounds = (unknown.bounds.0.max(free.lower), unknown.bounds.1.min(free.upper));
        unknown.prior = free.prior.as_ref().map(|p| (p.mean, p.std));
        let value = unknown.value(&plan.scene_values);
        let positive = value > 0.0 && unknown.bounds.0 >= 0.0 && matches!(unknown.target, Target::Theta(_));
        Some(if positive { unknown.logarithmic() } else { unknown })
    };
    // the check above has found every path
    Ok(plan.tied(setup.experiment.fit.free.iter().filter_map(one).collect()))
}

/// Refuses free parameters that influence nothing that was measured.
pub(super) fn refuse_dead(plan: &Plan, unknowns: &[Unknown]) -> Result<(), IdentifyError> {
    let k = unknowns.len();
    let mut norm = vec![0.0f64; k];
    let values = opened(&plan.scene_values, unknowns);
    for rec in &plan.fitted {
        let wants = ShotWants { unknowns, tangents: true, ..ShotWants::default() };
        let shot = shoot(plan, rec, &values, wants)
            .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })?;
        for row in shot.global.chunks_exact(k.max(1)) {
            norm.iter_mut().zip(row).for_each(|(n, d)| *n += d * d);
        }
    }
    match norm.iter().position(|n| *n < POLICY.no_influence) {
        Some(dead) if k > 0 => Err(IdentifyError::DeadParameter { path: unknowns[dead].path.clone() }),
        _ => Ok(()),
    }
}

/// The values with everything at its start whose law is silent at zero.
fn opened(values: &Values, unknowns: &[Unknown]) -> Values {
    let mut out = values.clone();
    for u in unknowns {
        if let Some(probe) = u.silent(values) {
            u.set(&mut out, probe.start);
        }
    }
    out
}

/// Start of a baseline fit of a plan whose records are cut.
pub(super) struct Prepared {
    pub unknowns: Vec<Unknown>,
    pub values: Values,
}

impl Prepared {
    /// A plan whose records are cut, and its baseline, near its end: as wholes up to a growth of [`FIT`]`.growth_followed` where the model follows
    /// them, `grids` being the noise that the channels' quantisation makes, and else in pieces from `FIT.growth` on.
    pub(super) fn begun(
        setup: &Setup,
        plan: &mut Plan,
        options: &FitOptions,
        grids: &[f64],
    ) -> Result<(Self, Fitted), IdentifyError> {
        let unknowns = declared(setup, plan)?;
        refuse_dead(plan, &unknowns)?;
        let values = opened(&plan.scene_values, &unknowns);
        let (prepared, uncut, length) = (Self { unknowns, values }, plan.fitted.clone(), setup.experiment.fit.segment);
        let as_wholes = cut(plan, &prepared.values, length, FIT.growth_followed)?;
        if matches!(as_wholes, Cut::Joined(grown) if grown <= FIT.growth) {
            let near = prepared.near(plan, options)?;
            return Ok((prepared, near));
        }
        // a motion that grows may not even be simulated as a whole where the model is wrong
        if matches!(as_wholes, Cut::Joined(_))
            && let Ok(near) = prepared.near(plan, options)
            && !prepared.seen(plan, &near, grids)?.no_noise(&near)
        {
            return Ok((prepared, near));
        }
        plan.fitted = uncut;
        cut(plan, &prepared.values, length, FIT.growth)?;
        let near = prepared.near(plan, options)?;
        Ok((prepared, near))
    }

    /// The bench with the scatter of the readings around a fit.
    pub(super) fn seen<'a>(&self, plan: &'a Plan, plain: &Fitted, grids: &[f64]) -> Result<Bench<'a>, IdentifyError> {
        let white = ArModel::white(scatter(plan, plain, grids))?;
        Ok(Bench { plan, declared: self.unknowns.clone(), white })
    }

    /// The baseline by least squares to some of many records, roughly: it brings the values near the end, and tells what is left.
    fn near(&self, plan: &Plan, options: &FitOptions) -> Result<Fitted, IdentifyError> {
        let keep = evenly(&plan.fitted, POLICY.searched_records);
        let some: Vec<RecordPlan> =
            plan.fitted.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(rec, _)| rec.clone()).collect();
        let options = if some.len() < plan.fitted.len() { POLICY.coarse } else { FitOptions { rounds: 0, ..*options } };
        self.bench(plan)?.first(&some, &self.values, &self.unknowns, &options)
    }

    /// The baseline by least squares to all records from one that is near, fitted again from where it ended while it does not converge.
    pub(super) fn ended(&self, plan: &Plan, near: Fitted, options: &FitOptions) -> Result<Fitted, IdentifyError> {
        let bench = self.bench(plan)?;
        let options = FitOptions { rounds: 0, ..*options };
        let mut fitted = near;
        if fitted.records.len() < plan.fitted.len() {
            fitted = bench.polished(&plan.fitted, &fitted.values, &self.unknowns, &bench.white, &options)?;
        }
        for _ in 1..POLICY.baseline_fits {
            if fitted.converged {
                break;
            }
            fitted = bench.polished(&fitted.records, &fitted.values, &self.unknowns, &bench.white, &options)?;
        }
        Ok(fitted)
    }

    fn bench<'a>(&self, plan: &'a Plan) -> Result<Bench<'a>, IdentifyError> {
        Ok(Bench { plan, declared: self.unknowns.clone(), white: first_noise(plan)? })
    }
}

/// The better of two fits, the fit that its intervals are taken from, and warnings.
struct Chosen {
    fitted: Fitted,
    /// The same fit under the noise model of its intervals.
    spread: Fitted,
    warnings: Vec<String>,
}

/// Least squares first, then the whitened fit from there, unless that one gives least squares up.
///
/// Whitened by its own colour, a residual that is noise gives the best estimates. Where the model lacks something, the residual is
/// no noise, and the whitened optimum may lie far from the data: it explains the fast part of the residual and neglects the slow one.
fn choose(setup: &Setup, plan: &mut Plan, logs: &Logs, options: &FitOptions) -> Result<Chosen, IdentifyError> {
    let start = opened(&plan.scene_values, &declared(setup, plan)?);
    let (_, grids) = super::audit::check(setup, plan, logs)?;
    let (prepared, near) = Prepared::begun(setup, plan, options, &grids)?;
    let plain = prepared.ended(plan, near, options)?;
    let whitened = fit(plan, &plain.records, &plain.values, &prepared.unknowns, None, options)?;
    let given_up = whitened.rmse > POLICY.given_up * plain.rmse;
    let mut warnings = Vec::new();
    let (fitted, spread) = if given_up {
        warnings.push(format!(
            "the residual is not noise: whitened by its own colour, the fit would leave {} where least squares leaves {}, so the model \
             lacks something; these are the least-squares values, their intervals do not cover what is lacking, and `pliant diagnose` \
             looks for it",
            quantity_plain(whitened.rmse, plan.unit),
            quantity_plain(plain.rmse, plan.unit)
        ));
        coloured(plan, plain)?
    } else {
        (whitened.clone(), whitened)
    };
    for u in &fitted.unknowns {
        let still = || (u.value(&fitted.values) == u.value(&start)).then(|| unmoved(u));
        warnings.extend(at_bound(u, &fitted).or_else(still));
    }
    Ok(Chosen { fitted, spread, warnings })
}

/// Warning about an unknown that no step moved.
fn unmoved(u: &Unknown) -> String {
    format!(
        "{} stayed where it started, since no step from there lowered the error: its value and interval say nothing. Where bodies land or \
         slide under `sdirk2`, try `euler`; or start elsewhere",
        u.path
    )
}

/// A least-squares fit with the noise model of its residual, and with white noise of as many independent samples as that has:
/// the error of least squares where its residual is coloured.
pub(super) fn coloured(plan: &Plan, plain: Fitted) -> Result<(Fitted, Fitted), IdentifyError> {
    let lost = plain.unknowns.len() + own_unknowns(&plain.records);
    let noise = fit_noise(plan, &plain.residuals, lost)?;
    let samples = plain.residuals.iter().map(Vec::len).sum::<usize>() / plan.channels().max(1);
    let wider = (samples as f64 / noise.effective_samples(samples)).max(1.0).sqrt();
    let sigma = noise.sigma().iter().map(|s| s * noise.stationary_ratio() * wider).collect();
    let spread = Fitted { noise: ArModel::white(sigma)?, ..plain.clone() };
    Ok((Fitted { noise, ..plain }, spread))
}

/// Warning about an estimate that ends at one of its bounds.
pub(super) fn at_bound(u: &Unknown, fitted: &Fitted) -> Option<String> {
    let value = u.value(&fitted.values);
    let bound = if value <= u.bounds.0 {
        "lower"
    } else if value >= u.bounds.1 {
        "upper"
    } else {
        return None;
    };
    let value = format!("{} {}", number_plain(value), unit(&u.unit));
    let value = value.trim_end();
    Some(format!(
        "{} ends at its {bound} bound, {value}: the bound is too narrow, or it makes up for something the model lacks",
        u.path
    ))
}

/// Plain system identification: fits the declared free parameters and reports them.
pub fn fit_scene(setup: &Setup, logs: &Logs, progress: &mut dyn FnMut(&str)) -> Result<FitReport, IdentifyError> {
    if setup.experiment.fit.free.is_empty() {
        return Err(setup.refuse("experiment.fit", LogMistake::NothingFree).into());
    }
    let mut plan = Plan::new(setup, logs)?;
    let options = FitOptions::default();
    progress("fitting");
    let Chosen { fitted, spread, warnings } = choose(setup, &mut plan, logs, &options)?;
    progress("intervals");
    let curvature = super::certainty::Curvature::new(&plan, &spread)?;
    let parameters = super::certainty::estimates(&plan, &spread, Some(&super::certainty::normal(&curvature.std_errors())));
    let seen = !plan.held_out.is_empty();
    let judged = seen.then(|| super::gain::judged(&plan, &fitted, &FitOptions::default())).transpose()?;
    let residual = |unit: &'static str| UnitResidual {
        unit: unit.to_owned(),
        rmse_fit: plan.rms_in(unit, &fitted.residuals),
        rmse_held_out: judged.as_ref().map(|judged| plan.rms_in(unit, judged.residuals())),
    };
    let UnitResidual { unit, rmse_fit, rmse_held_out } = residual(plan.unit);
    Ok(FitReport {
        schema_version: super::SCHEMA_VERSION,
        parameters,
        unit,
        rmse_fit,
        rmse_held_out,
        other_units: plan.other_units().into_iter().map(residual).collect(),
        iterations: fitted.iterations,
        converged: fitted.converged,
        records: super::RecordCount { fit: plan.fitted_records(), held_out: plan.held_out.len() },
        unidentifiable: curvature.unidentifiable(&fitted),
        warnings,
    })
}

#[cfg(test)]
mod tests {
    use super::super::procedure::begun;

    #[test]
    fn what_the_model_follows_stays_whole() {
        // a disturbance grows tenfold
        assert!(!begun(0.0).0.in_pieces());
        assert!(begun(2.0).0.in_pieces());
    }
}
