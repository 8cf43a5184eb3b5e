//! The whole diagnosis, in order.

use super::audit::still::Still;
use super::baseline::{Prepared, at_bound, coloured};
use super::beside::Beside;
use super::certainty::{Curvature, estimates, half_widths, normal};
use super::listing;
use super::numerics::{Shift, Source, changes, shifts};
use super::policy::POLICY;
use super::procedure::{Found, counted, rejoined, search, searched_on};
use super::remainder::remainder;
use super::result::*;
use super::scores::scores;
use super::story::{stages, story};
use super::verdict::decide;
use super::{audit, ceiling, gain, next, reason};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::journal::Journal;
use crate::log::{Interpolation, Logs, Setup, Split};
use crate::number::number_plain;
use crate::shooting::{Plan, opened};
use std::sync::Arc;
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

/// Seconds of each part.
struct Clock {
    start: Instant,
    last: Instant,
    parts: Vec<PartTime>,
}

impl Clock {
    fn new() -> Self {
        let now = Instant::now();
        Self { start: now, last: now, parts: Vec::new() }
    }

    fn done(&mut self, part: &str) {
        let seconds = self.last.elapsed().as_secs_f64();
        self.parts.push(PartTime { part: part.to_owned(), seconds });
        self.last = Instant::now();
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
    passes(setup, logs, options, &Arc::default(), progress)
}

/// The same, told and kept by a journal: what it has of an earlier run is not computed again, and the result is the same to the last bit.
///
/// Errors: those of [`diagnose`].
pub fn diagnose_kept(
    setup: &Setup,
    logs: &Logs,
    options: &DiagnoseOptions,
    journal: &Arc<Journal>,
) -> Result<Diagnosis, IdentifyError> {
    passes(setup, logs, options, journal, &mut |stage| journal.says(stage))
}

fn passes(
    setup: &Setup,
    logs: &Logs,
    options: &DiagnoseOptions,
    journal: &Arc<Journal>,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, IdentifyError> {
    let mut clock = Clock::new();
    let first = match finished(journal) {
        Some(first) => first,
        None => pass(setup, logs, None, options, (&mut clock, journal), progress)?,
    };
    let mut finer: Option<(Refinement, Diagnosis)> = None;
    for _ in 1..POLICY.passes {
        let last = finer.as_ref().map_or(&first, |(_, last)| last);
        let here = finer.as_ref().map_or_else(|| setup.clone(), |(by, _)| by.setup(setup));
        let Some(refined) = Refinement::of(last, &here) else { break };
        progress(&format!("once more, with {}", refined.words()));
        keep(journal, last);
        journal.pass(Some(refined.words()));
        let next = match finished(journal) {
            Some(next) => next,
            None => pass(&refined.setup(setup), logs, Some((&refined, &first)), options, (&mut clock, journal), progress)?,
        };
        finer = Some((refined, next));
    }
    Ok(finer.map_or(first, |(_, last)| last))
}

/// A pass with the present simulation that was finished.
fn finished(journal: &Journal) -> Option<Diagnosis> {
    serde_json::from_str(&journal.reached::<String>("pass")?).ok()
}

/// Keeps it, if it is read back as it was.
fn keep(journal: &Journal, pass: &Diagnosis) {
    let Some(text) = journal.keeps().then(|| serde_json::to_string(pass).ok()).flatten() else { return };
    let back: Option<Diagnosis> = serde_json::from_str(&text).ok();
    // NaN is equal to itself here
    if back.is_some_and(|back| format!("{back:?}") == format!("{pass:?}")) {
        journal.reaches("pass", &text);
    }
}

/// A finer simulation than the scene's.
struct Refinement {
    step: f64,
    interpolation: Interpolation,
}

impl Refinement {
    /// The one that a diagnosis calls for: its step where the data are nearer to a finer one, or where a cause would only make up
    /// for it; the other reading of inputs where the data are nearer to that. Small causes are not to be looked for in the simulation's own error.
    fn of(d: &Diagnosis, setup: &Setup) -> Option<Self> {
        let of = |kind| d.numerics.iter().find(|n: &&Numerics| n.kind == kind);
        let (step, interpolation) = (setup.scene.time.step, setup.experiment.interpolation);
        // of many records that no model explains what was found are approximations, which a finer step makes no names of
        let approximated = d.records.fit > POLICY.searched_records && d.remainder.over_scatter > POLICY.no_noise;
        let nearer = |n: &Numerics| n.gain > POLICY.per_number && !approximated;
        let told = |n: &&Numerics| nearer(n) || d.imitated.contains(&NumericsKind::Step);
        let needed = of(NumericsKind::Step).filter(told).and_then(|n| n.needed);
        let finer = needed.map(|needed| (step / needed).ceil().min(POLICY.finest));
        let ways = d.numerics.iter().filter(|n| n.kind == NumericsKind::Inputs && nearer(n));
        let other = ways.max_by(|a, b| a.gain.total_cmp(&b.gain)).and_then(|n| n.interpolation);
        let wanted = d.verdict != Verdict::Withheld && (finer.is_some() || other.is_some());
        wanted.then(|| Self { step: step / finer.unwrap_or(1.0), interpolation: other.unwrap_or(interpolation) })
    }

    fn setup(&self, setup: &Setup) -> Setup {
        let mut out = setup.clone();
        out.scene.time.step = self.step;
        out.experiment.interpolation = self.interpolation;
        out
    }

    fn words(&self) -> String {
        format!("a step of {} s and inputs read as `interpolation = \"{}\"`", number_plain(self.step), self.interpolation.name())
    }
}

/// A diagnosis with the simulation as it is given; `coarser`: what the scene's own gave, and how this one is finer.
fn pass(
    setup: &Setup,
    logs: &Logs,
    coarser: Option<(&Refinement, &Diagnosis)>,
    options: &DiagnoseOptions,
    (clock, journal): (&mut Clock, &Arc<Journal>),
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, IdentifyError> {
    progress("auditing the data");
    let mut plan = Plan { journal: Arc::clone(journal), ..Plan::opened(setup, logs)? };
    let (mut findings, grids) = audit::check(setup, &plan, logs)?;
    let still = Still::of(&plan, logs, &grids);
    findings.extend(still.findings(&plan, logs));
    let nothing_to_see = still.reason(&plan, logs);
    let others = still.others(logs);
    if let Some(others) = &others {
        plan = Plan { journal: Arc::clone(journal), ..Plan::opened(setup, others)? };
    }
    if logs.split == Split::NothingHeldOut {
        findings.push(note("there is a single record: nothing is held out, and no gain can be measured", "add a second record"));
    }
    findings.extend(audit::held_markers(&plan));
    findings.extend(audit::silent(setup, logs));
    findings.extend(audit::scale::other_units(&plan));
    clock.done("audit");

    progress("fitting the baseline");
    let to_the_end = FitOptions { tolerance: POLICY.fine.tolerance, ..FitOptions::default() };
    let (prepared, mut plain) = Prepared::begun(setup, &mut plan, &to_the_end, &grids)?;
    let scatter = prepared.seen(&plan, &plain, &grids)?.white.sigma().to_vec();
    plan.report_worst(&plain.residuals, &scatter);
    plain.rmse = plan.rms(&plain.residuals);
    let seen = |plain: &Fitted| prepared.seen(&plan, plain, &grids);
    // some of the records are enough to look for causes on while even the best model leaves more than noise
    let enough = plain.records.len() < plan.fitted.len() && seen(&plain)?.no_noise(&plain);
    if !enough {
        plain = prepared.ended(&plan, plain, &to_the_end)?;
    }
    let bench = seen(&plain)?;
    let mut base = bench.finished(&plain, &plain.records)?;
    let untrusted = nothing_to_see.or_else(|| (!plain.converged).then(reason::not_converged));
    findings.extend(audit::contradictions::contradictions(&bench, &base));
    if enough {
        let even_handed = counted(&bench, &base);
        base = counted(&bench, &bench.finished(&even_handed, &even_handed.records)?);
    }
    journal.baseline(base.rmse, plan.unit);
    clock.done("baseline");

    let scene = opened(&setup.scene);
    let most = if untrusted.is_some() { 0 } else { options.max_causes };
    let found = search(&bench, &scene, base, None, most, options.seed, progress)?;
    let whole_plan = if most > 0 { rejoined(&bench, &found) } else { None };
    let whole = whole_plan.as_ref().map(|plan| bench.on(plan));
    let on_whole =
        whole.as_ref().and_then(|whole| Some((whole, searched_on(whole, &scene, &found, most, options.seed, progress)?)));
    // from here on with whole records where they were followed
    let (bench, found) = on_whole.unwrap_or((&bench, found));
    let plan = bench.plan;
    findings.extend(in_pieces(plan));
    clock.done("search");

    progress("checking what remains");
    let (fitted, spread) = (&found.fitted, spread(plan, &found)?);
    let shifts = shifts(&scene, plan, fitted);
    let changed = Beside::new(plan, &spread, &changes(&shifts))?;
    let gain = |(k, shift): (usize, &Shift)| match shift.source {
        Source::Inputs(way) => {
            found.gain_of_reading(bench, way, &changed.sizes(k)).unwrap_or(f64::NEG_INFINITY).max(changed.gain(k))
        }
        Source::Step | Source::Mesh => changed.gain(k),
    };
    let numerics: Vec<Numerics> =
        shifts.iter().enumerate().map(|of| of.1.report(plan, fitted, gain(of), changed.over_left(of.0))).collect();
    let sensor_sigma = reported(plan, bench.white.sigma());
    let noise = noise(plan, fitted, sensor_sigma);
    let base_rmse = found.base.fitted.rmse;
    let left = remainder(bench, fitted, (&found, &changed.reduced), (&shifts, &numerics), base_rmse, &noise)?;
    clock.done("remainder");

    progress("intervals and held-out gain");
    let half = half_widths(&changed, &numerics);
    // every candidate against the baseline, under the noise of the final model; on some of many records where that is none
    let judged_on = if found.no_noise { found.base.fitted.of_some(POLICY.searched_records) } else { found.base.fitted.clone() };
    let first = scores(plan, &Fitted { noise: fitted.noise.clone(), ..judged_on }, options.seed)?;
    let causes = listing::causes(plan, &found, &changed.reduced, &half, &first);
    clock.done("intervals");
    let base = &found.base.fitted;
    let fit_options = FitOptions::default();
    let story = story(plan, &found, &fit_options)?;
    // the same one where no cause was accepted
    let (before, after) = (&story[0], &story[story.len() - 1]);
    let gain = match plan.held_out.is_empty() {
        true => Vec::new(),
        false => gain::gains(plan, [before, after], sensor_sigma, options.seed)?,
    };
    let ceiling = ceiling::ceiling(plan, [before, after], sensor_sigma, &fit_options)?;
    let (curves, snapshots) = gain::pictures(plan, [before, after])?;
    let curvature = Curvature::new(plan, &coloured(plan, base.clone())?.1)?;
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
        next: Vec::new(),
        remainder: left,
        candidates: listing::candidates(&first, &base.values, &found.notes),
        gain,
        ceiling,
        numerics,
        imitated: found.imitated.iter().map(|(_, kind)| *kind).collect(),
        refined: coarser.map(|(refined, _)| Refined { step: refined.step, interpolation: refined.interpolation }),
        noise,
        warnings: fitted.unknowns.iter().filter_map(|u| at_bound(u, fitted)).collect(),
        records: RecordCount { fit: plan.fitted_records(), held_out: plan.held_out.len() },
        audit: findings,
        baseline: estimates(plan, base, Some(&normal(&curvature.std_errors()))),
        unidentifiable: curvature.unidentifiable(base),
        stages: stages(plan, &found, &story, &half),
        curves,
        snapshots,
        wall_s: 0.0,
        parts: Vec::new(),
    };
    decide(&mut diagnosis, plan, &found, &first, untrusted, coarser.map(|(refined, d)| (refined.words(), d)));
    clock.done("held-out gain and report");
    if diagnosis.verdict == Verdict::Ambiguous {
        progress("which experiment would tell");
        diagnosis.next = next::experiments(bench, &found)?;
        clock.done("next experiment");
    }
    diagnosis.wall_s = clock.start.elapsed().as_secs_f64();
    diagnosis.parts.clone_from(&clock.parts);
    Ok(diagnosis)
}

/// The final model with the noise that the errors of its estimates are taken from: its own where what is left is noise, else white noise of
/// as many independent samples as the residual has.
fn spread(plan: &Plan, found: &Found) -> Result<Fitted, IdentifyError> {
    if found.no_noise { Ok(coloured(plan, found.fitted.clone())?.1) } else { Ok(found.fitted.clone()) }
}

/// Root mean square over the channels whose errors are reported.
fn reported(plan: &Plan, scatter: &[f64]) -> f64 {
    plan.rms(&[scatter.to_vec()])
}

/// The noise of a fit, in the reported unit.
fn noise(plan: &Plan, fitted: &Fitted, sensor_sigma: f64) -> Noise {
    let sigma = fitted.noise.sigma();
    let reported = plan.rms(&[sigma.to_vec()]);
    let rows: usize = fitted.residuals.iter().map(Vec::len).sum();
    let channels = sigma.len().max(1);
    Noise {
        ar: fitted.noise.coefficients().to_vec(),
        sigma: reported * fitted.noise.stationary_ratio(),
        sensor_sigma,
        effective_samples: fitted.noise.effective_samples(rows / channels) * channels as f64,
    }
}

/// That held-out records are judged in pieces, if they are.
fn in_pieces(plan: &Plan) -> Option<AuditFinding> {
    let what = format!(
        "a small disturbance of the motion grows a thousandfold in {} s, so held-out records are judged in pieces of no more than that",
        number_plain(plan.followed)
    );
    let advice = "what a simulation does later says how the disturbance grew, and not what the model lacks; commands of a position \
                  drive in place of its torques would hold the simulated motion as they hold the real one";
    let longer = plan.held_out.iter().any(|rec| rec.record.duration() > plan.followed);
    longer.then(|| AuditFinding { severity: "info".to_owned(), ..note(&what, advice) })
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::pendulum;
    use super::*;
    use crate::report::sample;
    use pliant_scene::Source;

    /// A few units are enough, but not of many records over more than noise.
    #[test]
    fn approximations_are_not_sought_again_with_a_finer_step() {
        let setup = Setup::from_source(Source::new("scene.toml", pendulum("measured")), Default::default()).unwrap();
        let with = |records: usize, over_scatter: f64, gain: f64| {
            let mut d = sample::diagnosis();
            d.records.fit = records;
            d.remainder.over_scatter = over_scatter;
            let (kind, unit, note) = (NumericsKind::Step, String::new(), String::new());
            d.numerics = vec![Numerics {
                kind,
                interpolation: None,
                rms: 0.0,
                unit,
                part: 0.2,
                beyond: 0.2,
                gain,
                needed: Some(0.002),
                note,
            }];
            Refinement::of(&d, &setup).map(|finer| finer.step)
        };
        assert_eq!(with(47, 1.0, 20.0), Some(0.005 / 3.0));
        assert_eq!(with(47, 1.0, 10.0), None);
        assert_eq!(with(47, 100.0, 400.0), None);
        assert_eq!(with(5, 100.0, 20.0), Some(0.005 / 3.0));
    }
}
