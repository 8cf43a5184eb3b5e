//! The whole diagnosis, in order.

use super::baseline::Prepared;
use super::certainty::Curvature;
use super::constants::DIAGNOSE;
use super::result::*;
use super::scores::scores;
use super::search::{Found, is_possible, search};
use super::selection::Selection;
use super::story::Story;
use super::verdict::{decide, set_alternatives};
use super::{audit, ceiling, gain, numerics, remainder};
use crate::causes::{discretisation, spacing};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::log::{Logs, Setup, Split};
use crate::shooting::{Plan, RecordPlan, opened};
use std::time::Instant;

/// Settings of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiagnoseOptions {
    /// Seed of bootstraps and sign flips.
    pub seed: u64,
    /// Most causes accepted.
    pub max_causes: usize,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { seed: 0, max_causes: 6 }
    }
}

/// Finds the physical effects that the scene lacks to explain the logs.
///
/// `progress` is told each step. Errors: wrong input, or a baseline that cannot be simulated; everything else ends in
/// a verdict.
pub fn diagnose(
    setup: &Setup,
    logs: &Logs,
    options: &DiagnoseOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, IdentifyError> {
    let clock = Instant::now();
    progress("auditing the data");
    let mut plan = Plan::opened(setup, logs)?;
    let (mut findings, sensor_sigma) = audit::check(&plan, logs)?;
    if logs.split == Split::NothingHeldOut {
        findings.push(note("there is a single record: nothing is held out, and no gain can be measured", "add a second record"));
    }
    findings.extend(audit::held_markers(&plan));
    let fit_options = FitOptions::default();
    progress("fitting the baseline");
    let prepared = Prepared::new(setup, &mut plan, &fit_options)?;
    let found = together(&plan, &prepared, sensor_sigma, options, progress)?;
    let base = match &found {
        Some(found) => found.base.coloured.clone(),
        None => prepared.fit(&plan, &fit_options)?,
    };
    let held_out = gain::prepared(&plan, &plan.held_out, &base, &fit_options)?;
    let judged: &[RecordPlan] = if held_out.is_empty() { &base.records } else { &held_out };
    let mut story =
        Story { plan: &plan, judged, base: &base, options: &fit_options, by_record: found.is_some(), stages: Vec::new() };
    let plain = found.as_ref().map(|found| found.base.spread.clone());
    story.add("baseline", plain.as_ref().unwrap_or(&base))?;

    let mut run = Selection::new(&base);
    progress("testing every cause");
    let first = scores(&plan, &base, options.seed)?;
    match found {
        Some(found) => run.take(found, &mut story)?,
        None => {
            run.grow(&plan, &first, sensor_sigma, options, &fit_options, &mut story, progress)?;
            run.prune(&plan, &base.unknowns, &fit_options, progress)?;
        }
    }

    progress("checking what remains");
    let numerics = discretisation(&plan, &run.current.records, &run.current.values, run.current.rmse)?;
    let has_ropes = !plan.model.ropes().is_empty();
    let spaced = || spacing(&opened(&setup.scene), &plan, &run.current.records, &run.current.values, run.current.rmse);
    let edges = if has_ropes { spaced() } else { None };
    let p_input = remainder::depends_on_input(&plan, &run.current)?;
    let last = scores(&plan, &run.current, options.seed)?;
    let untested = !run.ambiguous.is_empty() || run.rejected || last.adjusted.iter().any(|p| *p <= DIAGNOSE.level);
    let varying = run.test_constancy(&plan)?;
    let left = run.remainder(&plan, &base, sensor_sigma, p_input, untested, varying);

    progress("intervals and held-out gain");
    let causes = run.causes(&plan)?;
    let before = gain::residuals(&plan, judged, &base.values)?;
    let reread = gain::reread(&plan, judged, &base, &run.current, &fit_options)?;
    let after = gain::residuals(&plan, &reread, &run.current.values)?;
    let gain =
        if held_out.is_empty() { Vec::new() } else { gain::gains(&plan, judged, &before, &after, sensor_sigma, options.seed)? };
    let ceiling = ceiling::ceiling(&plan, &base, &run.current, judged, sensor_sigma, &fit_options)?;
    let (curves, snapshots) = gain::pictures(&plan, (judged, &base.values), (&reread, &run.current.values))?;
    let of_base = plain.as_ref().unwrap_or(&base);
    let curvature = Curvature::new(&plan, of_base)?;
    let mut diagnosis = Diagnosis {
        schema_version: SCHEMA_VERSION,
        scene: setup.source.place("").file.unwrap_or_default(),
        verdict: Verdict::Adequate,
        reason: String::new(),
        causes,
        extension: Vec::new(),
        alternatives: Vec::new(),
        alternative_objects: Vec::new(),
        advice: Vec::new(),
        remainder: left,
        candidates: run.candidates(&first),
        gain,
        ceiling,
        noise: noise(&plan, &run.current, sensor_sigma),
        records: RecordCount { fit: plan.fitted_records(), held_out: plan.held_out.len() },
        audit: findings,
        baseline: story.stages[0].parameters.clone(),
        unidentifiable: curvature.unidentifiable(&base),
        stages: story.stages,
        curves,
        snapshots,
        wall_s: 0.0,
    };
    set_alternatives(&mut diagnosis, &run.alternatives());
    numerics::report(&mut diagnosis, &numerics, has_ropes.then_some(edges.as_ref()), plan.model.step_length());
    let imitated = run.imitated(&plan, &base, sensor_sigma)?;
    decide(&mut diagnosis, &run, &first, base.converged, imitated, numerics.ratio);
    diagnosis.wall_s = clock.elapsed().as_secs_f64();
    Ok(diagnosis)
}

/// Where the residual is no noise and records are many: causes that carry over together, and the baseline of least squares that they
/// begin from. What they leave has to be no noise either: else a noise model can be found, and is the better judge.
fn together(
    plan: &Plan,
    prepared: &Prepared,
    sensor_sigma: f64,
    options: &DiagnoseOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<Found>, IdentifyError> {
    let no_noise = |fitted: &Fitted| sensor_sigma > 0.0 && fitted.rmse > DIAGNOSE.no_noise * sensor_sigma;
    if !is_possible(plan) {
        return Ok(None);
    }
    let plain = prepared.fit(plan, &FitOptions { rounds: 0, tolerance: DIAGNOSE.baseline_tolerance, ..FitOptions::default() })?;
    if !no_noise(&plain) {
        return Ok(None);
    }
    let found = search(plan, &plain, options.max_causes, options.seed, progress)?;
    Ok(Some(found).filter(|found| found.steps.last().is_some_and(|last| no_noise(&last.fitted.coloured))))
}

/// The noise of a fit, in the reported unit.
fn noise(plan: &Plan, fitted: &Fitted, sensor_sigma: f64) -> Noise {
    let sigma = fitted.noise.sigma();
    let reported = plan.rms(&[sigma.to_vec()]);
    let rows: usize = fitted.residuals.iter().map(Vec::len).sum();
    let channels = sigma.len().max(1);
    Noise {
        ar: fitted.noise.coefficients().to_vec(),
        sigma: reported * fitted.noise.stationary_ratio().sqrt(),
        sensor_sigma,
        effective_samples: fitted.noise.effective_samples(rows / channels) * channels as f64,
    }
}

/// A finding of the audit that is about the experiment.
fn note(what: &str, advice: &str) -> AuditFinding {
    AuditFinding {
        severity: "warning".to_owned(),
        record: String::new(),
        place: String::new(),
        time_s: None,
        what: what.to_owned(),
        number: 0.0,
        unit: String::new(),
        advice: advice.to_owned(),
    }
}
