//! The whole diagnosis, in order.

use super::certainty::{Curvature, estimates, profile};
use super::result::*;
use super::second_look::second_look;
use super::select::{Margin, Round, refit, round};
use super::test::{Tested, test};
use super::{audit, baseline, ceiling, constancy, gain, numerics, reason, remainder};
use crate::causes::{Cause as Candidate, discretisation, spacing};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::log::{Logs, Setup, Split};
use crate::number::share;
use crate::shoot::{Plan, RecordPlan, opened};
use crate::stats::dist::chi2_sf;
use crate::unknown::{Coordinate, Unknown};
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

/// Part of the explainable error that the accepted causes must take if something significant remains: below it, they may be an
/// imitation of something outside the library. (In blind batches effects of the library leave nothing significant; winds and
/// offsets that imitate others took up to 0.72.)
const ENOUGH: f64 = 0.9;

struct Accepted {
    cause: Candidate,
    statistic: f64,
    rivals: Vec<Rival>,
    margin: Option<Margin>,
    constancy: Option<f64>,
}

/// Finds out what the scene gets wrong about the logs.
///
/// `progress` is told what is being done. Errors: wrong input, or a baseline that cannot be simulated; everything else ends in
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
    let base = baseline::baseline(setup, &mut plan, &fit_options)?;
    let held_out = gain::prepared(&plan, &plan.held_out, &base, &fit_options)?;
    let judged: &[RecordPlan] = if held_out.is_empty() { &base.records } else { &held_out };
    let mut story = Story { plan: &plan, judged, base: &base, options: &fit_options, stages: Vec::new() };
    story.add("baseline", &base)?;

    let mut run = Selection {
        current: base.clone(),
        accepted: Vec::new(),
        ambiguous: Vec::new(),
        undecided: None,
        rejected: false,
        notes: Vec::new(),
    };
    progress("testing every cause");
    let first = test(&plan, &base, options.seed)?;
    run.grow(&plan, &first, sensor_sigma, options, &fit_options, &mut story, progress)?;
    run.prune(&plan, &fit_options, progress)?;

    progress("checking what remains");
    let numerics = discretisation(&plan, &run.current.records, &run.current.values, run.current.rmse)?;
    let has_ropes = !plan.model.ropes().is_empty();
    let spaced = || spacing(&opened(&setup.scene), &plan, &run.current.records, &run.current.values, run.current.rmse);
    let edges = if has_ropes { spaced() } else { None };
    let p_input = remainder::depends_on_input(&plan, &run.current)?;
    let last = test(&plan, &run.current, options.seed)?;
    let untested = !run.ambiguous.is_empty() || run.rejected || last.adjusted.iter().any(|p| *p <= super::select::LEVEL);
    let varying = run.varying(&plan)?;
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
    let curvature = Curvature::new(&plan, &base)?;
    let mut diagnosis = Diagnosis {
        schema_version: SCHEMA_VERSION,
        scene: setup.source.place("").file.unwrap_or_default(),
        verdict: Verdict::Adequate,
        reason: String::new(),
        causes,
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
        baseline: estimates(&plan, &base, &curvature),
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

/// Forward selection in progress.
struct Selection {
    current: Fitted,
    accepted: Vec<Accepted>,
    ambiguous: Vec<Vec<Name>>,
    /// Fit with the best of the causes that cannot be told apart.
    undecided: Option<Box<Fitted>>,
    rejected: bool,
    /// (title of a candidate, what was found about it)
    notes: Vec<(String, String)>,
}

/// Name of a cause, and the gripper it is about.
type Name = (String, Option<String>);

impl Selection {
    #[allow(clippy::too_many_arguments)] // the parts of the selection
    fn grow(
        &mut self,
        plan: &Plan,
        first: &Tested,
        sensor_sigma: f64,
        options: &DiagnoseOptions,
        fit_options: &FitOptions,
        story: &mut Story,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), IdentifyError> {
        let mut tested = first.clone();
        while self.accepted.len() < options.max_causes {
            let mut notes = Vec::new();
            let mut outcome = round(plan, &self.current, &tested, fit_options, &mut notes, progress)?;
            if matches!(outcome, Round::Nothing) {
                let seed = options.seed;
                let again = second_look(plan, &self.current, sensor_sigma, fit_options, seed, &mut notes, progress)?;
                if let Some(found) = again {
                    (outcome, tested) = found;
                }
            }
            self.notes.extend(notes.into_iter().map(|(j, why)| (candidate(&tested, j).title(), why)));
            match outcome {
                Round::Nothing => return Ok(()),
                Round::Rejected => {
                    self.rejected = true;
                    return Ok(());
                }
                Round::Ambiguous { set, fitted } => {
                    self.undecided = Some(fitted);
                    self.ambiguous.push(set.iter().map(|&j| name(candidate(&tested, j))).collect());
                    return Ok(());
                }
                Round::Accepted { candidate, fitted, shape, statistic, margin } => {
                    let mut cause = self::candidate(&tested, candidate).clone();
                    if !shape.is_empty() {
                        cause.settings.clear();
                        cause.unknowns.extend(shape);
                    }
                    progress(&format!("accepted {}", cause.title()));
                    let rivals = rivals(&tested, candidate);
                    self.accepted.push(Accepted { rivals, cause, statistic, margin, constancy: None });
                    self.current = *fitted;
                    let name = self.accepted.last().map_or("", |a| a.cause.name);
                    story.add(name, &self.current)?;
                    tested = test(plan, &self.current, options.seed)?;
                }
            }
        }
        Ok(())
    }

    /// Takes out accepted causes that the later ones have made superfluous.
    fn prune(&mut self, plan: &Plan, options: &FitOptions, progress: &mut dyn FnMut(&str)) -> Result<(), IdentifyError> {
        if self.accepted.len() < 2 {
            return Ok(());
        }
        for k in (0..self.accepted.len() - 1).rev() {
            let own = self.accepted[k].cause.unknowns.clone();
            progress(&format!("checking that {} is still needed", self.accepted[k].cause.title()));
            let mut without = self.current.clone();
            without.unknowns.retain(|u| !own.iter().any(|o| o.target.same(&u.target)));
            for u in &own {
                u.set(&mut without.values, u.value(&plan.scene_values));
            }
            let fitted = refit(plan, &without, &[], options)?;
            let drop = fitted.deviance - self.current.deviance;
            self.accepted[k].statistic = drop;
            if chi2_sf(drop.max(0.0), own.len() as f64) > super::select::LEVEL {
                self.notes
                    .push((self.accepted[k].cause.title(), "accepted first, superfluous beside the later causes".to_owned()));
                self.accepted.remove(k);
                self.current = fitted;
            }
        }
        Ok(())
    }

    /// The accepted cause whose size differs most between parts of the records, if any does, and its p.
    fn varying(&mut self, plan: &Plan) -> Result<Option<(String, f64)>, IdentifyError> {
        let mut worst: Option<(String, f64)> = None;
        let all = self.accepted.len() as f64;
        for accepted in &mut self.accepted {
            let p = constancy::p_value(plan, &self.current, &accepted.cause.unknowns)?;
            accepted.constancy = Some(p);
            if p * all < constancy::LEVEL && worst.as_ref().is_none_or(|(_, least)| p < *least) {
                worst = Some((accepted.cause.title(), p));
            }
        }
        Ok(worst)
    }

    fn remainder(
        &self,
        plan: &Plan,
        base: &Fitted,
        sensor_sigma: f64,
        p_input: f64,
        untested: bool,
        varying: Option<(String, f64)>,
    ) -> Remainder {
        let by_input = remainder::is_significant(p_input);
        let (before, after) = (base.rmse * base.rmse, self.current.rmse * self.current.rmse);
        let explainable = before - sensor_sigma * sensor_sigma;
        let note = match (by_input, untested) {
            (false, _) if let Some((name, p)) = &varying => format!(
                "{name} would need different sizes in different parts of the records (p = {p:.1e}): it imitates another law"
            ),
            (true, _) => format!(
                "the residual still depends on the inputs (p = {p_input:.1e}): dynamics are missing that no accepted cause explains"
            ),
            (false, true) => "candidates remain significant, but none may be named".to_owned(),
            (false, false) => "what is left does not differ from coloured noise".to_owned(),
        };
        Remainder {
            significant: by_input || untested || varying.is_some(),
            by_input,
            rmse: self.current.rmse,
            unit: plan.unit().to_owned(),
            explained_fraction: if explainable > 0.0 { (before - after) / explainable } else { 0.0 },
            note,
        }
    }

    /// The part of the explainable error that the best of several equal causes takes, if the rest still depends on the inputs:
    /// they imitate something outside the library.
    fn imitated(&self, plan: &Plan, base: &Fitted, sensor_sigma: f64) -> Result<Option<f64>, IdentifyError> {
        let Some(fitted) = &self.undecided else { return Ok(None) };
        if !remainder::is_significant(remainder::depends_on_input(plan, fitted)?) {
            return Ok(None);
        }
        let square = |f: &Fitted| f.rmse * f.rmse;
        let taken = (square(base) - square(fitted)) / (square(base) - sensor_sigma * sensor_sigma).max(f64::MIN_POSITIVE);
        Ok((taken < ENOUGH).then_some(taken))
    }

    fn causes(&self, plan: &Plan) -> Result<Vec<Cause>, IdentifyError> {
        if self.accepted.is_empty() {
            return Ok(Vec::new());
        }
        let errors = Curvature::new(plan, &self.current)?.std_errors();
        let one = |a: &Accepted| -> Result<Cause, IdentifyError> {
            let mut parameters = Vec::new();
            for own in &a.cause.unknowns {
                let Some(j) = self.current.unknowns.iter().position(|u| u.target.same(&own.target)) else { continue };
                let u = &self.current.unknowns[j];
                parameters.push(Estimate {
                    path: u.path.clone(),
                    estimate: u.value(&self.current.values),
                    unit: u.unit.clone(),
                    interval: profile(plan, &self.current, j, errors[j])?,
                    scene_value: u.value(&plan.scene_values),
                });
            }
            let own: Vec<usize> = a.cause.unknowns.iter().flat_map(|u| u.target.entries()).map(|(k, _)| k).collect();
            for &(entry, value) in a.cause.settings.iter().flatten().filter(|(entry, _)| !own.contains(entry)) {
                let info = plan.model.params().info(entry);
                parameters.push(Estimate {
                    path: info.path.clone(),
                    estimate: value,
                    unit: info.unit.to_owned(),
                    interval: [value; 2],
                    scene_value: plan.scene_values.theta[entry],
                });
            }
            Ok(Cause {
                name: a.cause.name.to_owned(),
                object: a.cause.object.clone(),
                meaning: a.cause.meaning.to_owned(),
                parameters,
                statistic: a.statistic,
                constancy_p: a.constancy,
                rivals: a.rivals.clone(),
            })
        };
        self.accepted.iter().map(one).collect()
    }

    /// The sets of causes that cannot be told apart: by the data, or by any data of this kind.
    fn alternatives(&self) -> Vec<Vec<Name>> {
        let twinned = self.accepted.iter().filter(|a| !a.cause.twins.is_empty()).map(|a| with_twins(&a.cause));
        self.ambiguous.iter().cloned().chain(twinned).collect()
    }

    /// The set, and why, if nothing is accepted but a cause with twins.
    fn only_twins(&self) -> Option<(Vec<Name>, String)> {
        let [one] = self.accepted.as_slice() else { return None };
        let twins = one.cause.twins.join(", ");
        let reason = format!(
            "{} explains the data, and no log of these sensors can tell it from {twins}: both move the readings in the same way",
            one.cause.title()
        );
        (!twins.is_empty()).then(|| (with_twins(&one.cause), reason))
    }

    fn candidates(&self, first: &Tested) -> Vec<CandidateReport> {
        let report = |c: usize| {
            let cause = &first.causes[c];
            let unit = cause.unknowns.first().map_or(String::new(), |u| u.unit.clone());
            let base = CandidateReport {
                name: cause.name.to_owned(),
                object: cause.object.clone(),
                status: Status::Untestable,
                statistic: None,
                dof: cause.unknowns.len(),
                p_value: None,
                absorbed_fraction: None,
                smallest_detectable: None,
                one_step: Vec::new(),
                unit,
                reason: cause.untestable.clone().unwrap_or_default(),
            };
            let Some(j) = first.tested.iter().position(|&t| t == c) else { return base };
            let s = &first.score.candidates[j];
            let absorbed = s.absorbed.iter().copied().fold(f64::NAN, f64::min);
            let change = |k: usize, t: f64| self.change(&cause.unknowns[k], t);
            let reasons: Vec<&str> =
                self.notes.iter().filter(|(n, _)| *n == cause.title()).map(|(_, why)| why.as_str()).collect();
            CandidateReport {
                status: if s.rank == 0 { Status::Absorbed } else { Status::Tested },
                statistic: (s.rank > 0).then_some(s.lm),
                p_value: (s.rank > 0).then_some(first.adjusted[j]),
                absorbed_fraction: Some(absorbed).filter(|a| a.is_finite()),
                smallest_detectable: s.detectable.first().map(|d| change(0, *d)).filter(|d| d.is_finite()),
                one_step: s.theta.iter().enumerate().map(|(k, t)| change(k, *t)).collect(),
                reason: if s.rank == 0 { "what can be fitted anyway hides it".to_owned() } else { reasons.join("; ") },
                ..base
            }
        };
        (0..first.causes.len()).map(report).collect()
    }

    /// What a step of a cause's coordinate means: a change of its value, or where that stands for infinity, the value.
    fn change(&self, u: &Unknown, step: f64) -> f64 {
        match u.coordinate {
            Coordinate::Linear => u.slope(0.0) * step,
            Coordinate::Log => u.slope(u.value(&self.current.values)) * step,
            Coordinate::Inverse => u.far(u.value(&self.current.values), step),
        }
    }
}

/// Errors after each accepted cause.
struct Story<'a> {
    plan: &'a Plan,
    judged: &'a [RecordPlan],
    base: &'a Fitted,
    options: &'a FitOptions,
    stages: Vec<Stage>,
}

impl Story<'_> {
    fn add(&mut self, name: &str, fitted: &Fitted) -> Result<(), IdentifyError> {
        let records = gain::reread(self.plan, self.judged, self.base, fitted, self.options)?;
        let residuals = gain::residuals(self.plan, &records, &fitted.values)?;
        let rows: f64 = fitted.residuals.iter().map(|r| r.len() as f64).sum();
        let curvature = Curvature::new(self.plan, fitted)?;
        self.stages.push(Stage {
            name: name.to_owned(),
            rmse_fit: fitted.rmse,
            rmse_held_out: self.plan.rms(&residuals),
            mean_abs_held_out: self.plan.mean_abs(&residuals),
            bic: fitted.deviance + fitted.unknowns.len() as f64 * rows.ln(),
            parameters: estimates(self.plan, fitted, &curvature),
        });
        Ok(())
    }
}

/// A tested candidate.
fn candidate(tested: &Tested, j: usize) -> &Candidate {
    &tested.causes[tested.tested[j]]
}

fn name(cause: &Candidate) -> Name {
    (cause.name.to_owned(), cause.object.clone())
}

fn with_twins(cause: &Candidate) -> Vec<Name> {
    let twins = cause.twins.iter().map(|twin| ((*twin).to_owned(), cause.object.clone()));
    std::iter::once(name(cause)).chain(twins).collect()
}

fn set_alternatives(d: &mut Diagnosis, sets: &[Vec<Name>]) {
    d.alternatives = sets.iter().map(|set| set.iter().map(|(name, _)| name.clone()).collect()).collect();
    d.alternative_objects = sets.iter().map(|set| set.iter().map(|(_, object)| object.clone()).collect()).collect();
}

fn rivals(tested: &Tested, j: usize) -> Vec<Rival> {
    let mut out: Vec<Rival> = (0..tested.tested.len())
        .filter(|&k| k != j && tested.score.candidates[k].rank > 0)
        .map(|k| {
            let (name, object) = name(candidate(tested, k));
            Rival { name, object, cosine: tested.score.cosines[(j, k)] }
        })
        .collect();
    out.sort_by(|a, b| b.cosine.abs().total_cmp(&a.cosine.abs()));
    out.truncate(4);
    out
}

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

fn decide(d: &mut Diagnosis, run: &Selection, first: &Tested, converged: bool, imitated: Option<f64>, numerical_part: f64) {
    let names: Vec<String> = d.causes.iter().map(Cause::title).collect();
    let titles = d.alternative_titles();
    let little = !run.accepted.is_empty() && d.remainder.significant && d.remainder.explained_fraction < ENOUGH;
    let open = little && !run.ambiguous.is_empty() && !d.remainder.by_input;
    (d.verdict, d.reason) = if !converged {
        (Verdict::Withheld, "the baseline fit did not converge; nothing built on it can be trusted".to_owned())
    } else if open {
        let reason = format!(
            "{} takes {} of what can be explained, but what remains is significant and fits several causes equally well: {}",
            names.join(" with "),
            share(d.remainder.explained_fraction),
            titles.concat().join(", ")
        );
        (Verdict::Ambiguous, reason)
    } else if little {
        let reason = format!(
            "{} fits best, but takes {} of what can be explained, and the rest is significant ({}): something outside the library",
            names.join(" with "),
            share(d.remainder.explained_fraction),
            d.remainder.note
        );
        (Verdict::NotInLibrary, reason)
    } else if let Some((set, reason)) = run.only_twins() {
        set_alternatives(d, &[set]);
        (Verdict::Ambiguous, reason)
    } else if !run.accepted.is_empty() || (!d.causes.is_empty() && (!d.remainder.significant || numerical_part > ENOUGH)) {
        let margins = run.accepted.iter().filter_map(|a| Some((a.cause.title(), a.margin.as_ref()?)));
        (Verdict::Named, reason::named(&d.causes, margins, &d.gain))
    } else if let (Some(taken), Some(set)) = (imitated, titles.first()) {
        let reason = format!(
            "{} fit equally well, but take {} of what can be explained, and the rest still depends on the inputs: something outside the library",
            set.join(", "),
            share(taken)
        );
        (Verdict::NotInLibrary, reason)
    } else if let Some(set) = titles.first() {
        (Verdict::Ambiguous, format!("{} explain the data equally well", set.join(", ")))
    } else if run.rejected || d.remainder.significant {
        (Verdict::NotInLibrary, "something significant is there, and no cause of the library is accepted for it".to_owned())
    } else {
        (Verdict::Adequate, "nothing beyond the noise was found".to_owned())
    };
    if open && d.verdict == Verdict::Ambiguous {
        let accepted = run.accepted.iter().map(|a| name(&a.cause));
        let set = accepted.chain(run.alternatives().concat()).collect();
        set_alternatives(d, &[set]);
    }
    if d.verdict != Verdict::Named {
        d.causes.clear();
    }
    let wanted: Vec<&String> = d.alternatives.iter().flatten().collect();
    d.advice = first
        .causes
        .iter()
        .filter(|c| wanted.iter().any(|w| *w == c.name))
        .map(|c| format!("{}: {}", c.name, c.excitation))
        .collect();
    d.advice.dedup();
}
