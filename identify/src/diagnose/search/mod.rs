//! Selection of causes by cross-validation, where a residual is no noise.
//!
//! The residual of a real cable is a hundred times the scatter of its readings, slow, and the same in every record. No noise model
//! describes it: a fitted one takes every slow error for colour, and its likelihoods call everything significant or nothing. With twelve
//! or more records a test without a noise model is possible: *does a cause, fitted by least squares to some records, lessen the error on
//! others?* The fitted records are dealt into two parts, and in each round
//! 1. every cause is linearized at the current fit, and the most promising ones are refitted to the first part, with their unmeasured
//!    companions ([`Cause::companions`]: the turn of a clamp matters once a rod has intrinsic curvature, and only then);
//! 2. the best on the second part (of those that it does not surely beat, the one with fewest numbers) is accepted if it lessens the
//!    error there, record by record (t test of the logarithm of the mean squares, Bonferroni over the causes tried), and by at least
//!    `SEARCH.worth` of the squares;
//! 3. causes that it did not beat are tested again on top of it: a cause that then adds nothing cannot be told apart from it.
//!
//! In the end each accepted cause must be missed when it is taken out again. Records that the experiment holds out are not used.

mod constants;
mod cross_validation;
mod paired;

use super::scores::scores_in;
use crate::causes::{Cause, Situation};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use constants::SEARCH;
use cross_validation::{Bench, Trial};
use paired::Paired;

/// A cause that was accepted.
#[derive(Clone, Debug)]
pub(in super::super) struct Step {
    pub cause: Cause,
    /// Part of the squares on other records that it took when it was accepted, and p of none.
    pub gain: f64,
    pub p: f64,
    /// Causes that took as much, and add nothing to it: name and object.
    pub ties: Vec<(&'static str, Option<String>)>,
    /// Fit of all records with all causes accepted so far.
    pub fitted: Whole,
}

/// A least-squares fit of all records.
#[derive(Clone, Debug)]
pub(in super::super) struct Whole {
    /// With the colour of its residual, for tests of the remainder.
    pub coloured: Fitted,
    /// With white noise of as many independent samples as that has, for undetermined combinations and intervals.
    pub spread: Fitted,
}

/// Result of a search.
#[derive(Clone, Debug)]
pub(in super::super) struct Found {
    /// The baseline by least squares.
    pub base: Whole,
    pub steps: Vec<Step>,
    /// (title of a cause, its outcome)
    pub notes: Vec<(String, String)>,
}

/// A cause as tried in a round.
struct Tried {
    cause: Cause,
    trial: Trial,
    paired: Paired,
}

impl Tried {
    /// p of the hypothesis that the other one is no better than it.
    fn loses_to(&self, other: &Self) -> f64 {
        Paired::of(&self.trial.errors, &other.trial.errors).p
    }
}

/// Whether there are records enough, and whole ones: pieces are too short to show anything slow.
pub(in super::super) fn is_possible(plan: &Plan) -> bool {
    !plan.in_pieces && plan.fitted_records() >= SEARCH.records
}

/// Searches from `base`, a baseline of least squares.
pub(in super::super) fn search(
    plan: &Plan,
    base: &Fitted,
    most: usize,
    seed: u64,
    progress: &mut dyn FnMut(&str),
) -> Result<Found, IdentifyError> {
    let bench = Bench::new(plan, base)?;
    let mut current = bench.refit(&base.values, &base.unknowns)?;
    let mut found = Found { base: bench.of_all(base.clone())?, steps: Vec::new(), notes: Vec::new() };
    let mut close: Vec<(&'static str, Option<String>)> = Vec::new();
    let name = |cause: &Cause| (cause.name, cause.object.clone());
    loop {
        let tried = round(&bench, &current, seed, &mut found.notes, progress)?;
        let bar = SEARCH.level / tried.len().max(1) as f64;
        let adding: Vec<&Tried> = tried.iter().filter(|t| t.paired.p <= bar && t.paired.gain >= SEARCH.worth).collect();
        if let Some(last) = found.steps.last_mut() {
            last.ties = close.drain(..).filter(|cause| adding.iter().all(|t| name(&t.cause) != *cause)).collect();
        }
        let Some(best) = best_of(&adding).filter(|_| found.steps.len() < most) else { break };
        progress(&format!("accepted {}", best.cause.title()));
        // a cause that adds to one it once could not be told apart from is present beside it
        found.steps.iter_mut().for_each(|step| step.ties.retain(|tie| *tie != name(&best.cause)));
        let unbeaten = adding.iter().filter(|t| t.loses_to(best) > bar).map(|t| name(&t.cause));
        close = unbeaten.filter(|cause| *cause != name(&best.cause)).collect();
        let fitted = bench.whole(&best.trial.fitted)?;
        found.steps.push(Step { cause: best.cause.clone(), gain: best.paired.gain, p: best.paired.p, ties: Vec::new(), fitted });
        current = best.trial.clone();
    }
    prune(&bench, base, &current, &mut found, progress)?;
    Ok(found)
}

/// Of the causes that add something the one with the least error on other records; of those that it does not surely beat, the one with
/// fewest numbers.
fn best_of<'a>(adding: &[&'a Tried]) -> Option<&'a Tried> {
    let by_total = |a: &&&Tried, b: &&&Tried| a.trial.total().total_cmp(&b.trial.total());
    let best = adding.iter().min_by(by_total)?;
    let near: Vec<&&Tried> = adding.iter().filter(|t| t.loses_to(best) > SEARCH.level).collect();
    let simplest = near.iter().map(|t| t.cause.unknowns.len()).min();
    let simple = near.into_iter().filter(|t| Some(t.cause.unknowns.len()) == simplest);
    simple.min_by(by_total).or(Some(best)).copied()
}

/// Refits of the promising causes on top of the current fit.
fn round(
    bench: &Bench,
    current: &Trial,
    seed: u64,
    notes: &mut Vec<(String, String)>,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<Tried>, IdentifyError> {
    let at = Situation { plan: bench.plan, values: &current.fitted.values, free: &current.fitted.unknowns, together: true };
    let tested = scores_in(bench.plan, &at, &current.fitted, seed)?;
    let mut tried = Vec::new();
    for (cause, step) in bench.promising(&tested, &current.fitted) {
        progress(&format!("trying {} on other records", cause.title()));
        match bench.with(current, &cause, &step) {
            Ok((trial, cause)) => tried.push(Tried { paired: Paired::of(&current.errors, &trial.errors), cause, trial }),
            Err(e) => note(notes, &cause, format!("its refit failed: {e}")),
        }
    }
    tried.sort_by(|a, b| a.trial.total().total_cmp(&b.trial.total()));
    let most = tried.first().map_or(0.0, |best| best.paired.gain);
    for (rank, t) in tried.iter_mut().enumerate() {
        if rank < SEARCH.finalists && t.paired.gain > SEARCH.far_behind * most {
            progress(&format!("going on with {}", t.cause.title()));
            if let Ok((further, cause)) = bench.further(&t.trial, &t.cause)
                && further.total() < t.trial.total()
            {
                (t.paired, t.trial, t.cause) = (Paired::of(&current.errors, &further.errors), further, cause);
            }
        }
        note(notes, &t.cause, t.paired.words(bench.sizes()));
        progress(&format!("{}: {}", t.cause.title(), t.paired.words(bench.sizes())));
    }
    Ok(tried)
}

/// Takes out causes that are not missed, of all but the last one.
fn prune(
    bench: &Bench,
    base: &Fitted,
    whole: &Trial,
    found: &mut Found,
    progress: &mut dyn FnMut(&str),
) -> Result<(), IdentifyError> {
    let mut current = whole.clone();
    for k in (0..found.steps.len().saturating_sub(1)).rev() {
        let cause = found.steps[k].cause.clone();
        if found.steps[k + 1..].iter().any(|later| later.cause.rests_on(&cause)) {
            continue;
        }
        progress(&format!("checking that {} is still needed", cause.title()));
        let Ok(without) = bench.without(&current, &base.unknowns, &cause) else { continue };
        let missed = Paired::of(&without.errors, &current.errors);
        if missed.p > SEARCH.level || missed.gain < SEARCH.worth {
            note(&mut found.notes, &cause, "accepted first, superfluous beside the later causes".to_owned());
            found.steps.remove(k);
            if let Some(last) = found.steps.last_mut() {
                last.fitted = bench.whole(&without.fitted)?;
            }
            current = without;
        }
    }
    Ok(())
}

/// Keeps the last thing found about a cause.
fn note(notes: &mut Vec<(String, String)>, cause: &Cause, text: String) {
    notes.retain(|(title, _)| *title != cause.title());
    notes.push((cause.title(), text));
}
