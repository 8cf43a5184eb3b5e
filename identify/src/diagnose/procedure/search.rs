//! The order of the procedure: one cause after the other is accepted, each for good reasons, and taken out again if it is not missed.

use super::super::policy::POLICY;
use super::super::result::NumericsKind;
use super::alike::alike;
use super::contest::{Contest, judged, noise_of};
use super::hypothesis::{Bench, Hypothesis};
use super::kept::{Between, Pruned};
use super::race::race;
use super::round::{Evidence, Round, evidence};
use super::told;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use pliant_scene::Scene;

/// The result of a search.
pub(in super::super) struct Found {
    pub base: Hypothesis,
    /// The model with all accepted causes, and as it is judged.
    pub best: Hypothesis,
    pub fitted: Fitted,
    /// Evidence for each of its causes.
    pub evidence: Vec<Evidence>,
    /// Models that cannot be told from it.
    pub tied: Vec<Hypothesis>,
    /// Of each of its causes the others that move the readings just as it does.
    pub alike: Vec<Vec<Cause>>,
    /// Even the best leaves more than noise.
    pub no_noise: bool,
    /// (title of a cause, what became of it)
    pub notes: Vec<(String, String)>,
    /// Causes that the simulation's own error imitates.
    pub imitated: Vec<(String, NumericsKind)>,
}

impl Found {
    /// The models that cannot be told apart: the best one, its ties, and it with a cause replaced by one that moves the readings alike. Titles of
    /// their causes, and fits.
    pub fn alternatives(&self, bench: &Bench) -> Result<Vec<(Vec<String>, Fitted)>, IdentifyError> {
        let titles = |model: &Hypothesis| model.causes.iter().map(Cause::title).collect::<Vec<_>>();
        let mut out = vec![(titles(&self.best), self.fitted.clone())];
        out.extend(self.tied.iter().map(|model| (titles(model), model.fitted.clone())));
        for (k, others) in self.alike.iter().enumerate().filter(|(_, others)| !others.is_empty()) {
            let without = bench.without(&self.best, k)?.fitted;
            for other in others.iter().take(POLICY.told_rivals) {
                let nowhere = vec![f64::NAN; other.unknowns.len()];
                if let Ok((rough, _)) = bench.with(&without, other, &nowhere, &[]) {
                    let mut causes = titles(&self.best);
                    causes[k] = other.title();
                    out.push((causes, bench.finished(&rough, &without.records)?));
                }
            }
        }
        Ok(out)
    }
}

/// Models that were found on other records, and compete before others are sought.
pub(in super::super) struct Entrants {
    /// The best of them without the cause that was accepted last.
    pub parent: Hypothesis,
    /// The best, and those that could not be told from it.
    pub models: Vec<Hypothesis>,
    /// Causes that they were chosen from.
    pub tests: usize,
}

/// Causes accepted by the procedure on top of `base`, at most `most`, from `entrants` on where there are any. `scene`: that of the plan.
pub(in super::super) fn search(
    bench: &Bench,
    scene: &Scene,
    base: Fitted,
    entrants: Option<Entrants>,
    most: usize,
    seed: u64,
    progress: &mut dyn FnMut(&str),
) -> Result<Found, IdentifyError> {
    if let Some(found) = Found::reached(bench) {
        told::accepted(bench, &found.best, &found.evidence);
        return Ok(found);
    }
    let mut base = Hypothesis::baseline(base);
    // on some of the records while even the best leaves more than noise
    let all = if base.fitted.records.len() < bench.plan.fitted.len() { &bench.plan.fitted } else { &base.fitted.records.clone() };
    let of_all = |model: &Hypothesis| model.fitted.records.len() == all.len();
    let mut entrants = entrants;
    let mut beam = vec![entrants.as_ref().map_or(&base, |found| &found.parent).clone()];
    let (mut best, mut tied) = (beam[0].clone(), Vec::new());
    let mut refitted: Vec<Vec<String>> = Vec::new();
    let mut of_each = Vec::new();
    let (mut notes, mut imitated) = (Vec::new(), Vec::new());
    let mut over = false;
    if let Some(then) = Between::reached(bench) {
        Between { beam, best, tied, refitted, of_each, notes, imitated, over } = then;
        told::accepted(bench, &best, &of_each[of_each.len().saturating_sub(1)..]);
        entrants = None;
    }
    while !over && best.causes.len() < most {
        bench.plan.journal.round(Some((best.causes.len() + 1, most)));
        let entered = entrants.take().map(|found| (found.models, found.tests));
        let found_before = entered.is_some();
        let (mut children, tests) = match entered {
            Some(entered) => entered,
            None => race(bench, &beam, seed, &mut notes, progress)?,
        };
        if children.is_empty() {
            break;
        }
        if !of_all(&beam[0]) && children.iter().any(|child| !bench.no_noise(&child.fitted)) {
            progress("what is left may be noise: on all records");
            let on_all = |models: &[Hypothesis]| models.iter().filter_map(|model| model.on(bench, all).ok()).collect();
            (beam, children) = (on_all(&beam), on_all(&children));
            if beam.is_empty() || children.is_empty() {
                break;
            }
        }
        let round = Round::new(bench, scene, &beam, children, tests)?;
        let Some(accepted) = round.accept(&mut notes, &mut imitated)? else {
            if !found_before {
                tied.extend(round.as_near_as_the_first().map(|k| round.adopted(k)));
                break;
            }
            // nothing of what was found on other records stands
            (beam, best) = (vec![base.clone()], base.clone());
            continue;
        };
        best = round.adopted(accepted.leader);
        progress(&format!("accepted {}", best.causes.last().map_or(String::new(), Cause::title)));
        told::accepted(bench, &best, std::slice::from_ref(&accepted.evidence));
        of_each.push(accepted.evidence.clone());
        refitted.extend(round.models.iter().map(Hypothesis::key));
        tied = accepted.tied.iter().map(|&k| round.adopted(k)).collect();
        beam = round.next_beam(&accepted);
        Between::keep(bench, (&best, &beam, &tied), &refitted, &of_each, (&notes, &imitated), false);
    }
    bench.plan.journal.round(None);
    if !over {
        Between::keep(bench, (&best, &beam, &tied), &refitted, &of_each, (&notes, &imitated), true);
    }
    let evidence = match of_each.as_slice() {
        // all other causes present: none
        [evidence] if best.causes.len() == 1 => vec![evidence.clone()],
        _ => prune(bench, &mut best, &of_each, &mut notes, progress)?,
    };
    tied.retain(|other| other.key() != best.key());
    if !of_all(&base) {
        progress("refitting to all records");
        base = base.on(bench, all)?;
    }
    if best.causes.is_empty() {
        best = base.clone();
    } else if !of_all(&best) {
        best = best.on(bench, all)?;
    }
    let fitted = as_judged(bench, &best)?;
    let no_noise = bench.no_noise(&fitted);
    // over more than noise nothing is named that a likeness could make ambiguous
    let alike = match no_noise {
        true => best.causes.iter().map(|_| Vec::new()).collect(),
        false => alike(bench, &best, &fitted, &evidence, &refitted, seed)?,
    };
    let found = Found { alike, base, best, fitted, evidence, tied, no_noise, notes, imitated };
    found.keep(bench);
    Ok(found)
}

/// A model under the noise that it leaves, and with the spreads that are likeliest under it.
fn as_judged(bench: &Bench, model: &Hypothesis) -> Result<Fitted, IdentifyError> {
    let noise = noise_of(bench, &model.fitted)?;
    let fitted = bench.spread_anew(&Fitted { noise: noise.clone(), ..model.fitted.clone() })?;
    judged(bench, &Hypothesis { fitted, ..model.clone() }, &noise, POLICY.no_noise)
}

/// Takes out causes that are not missed, and says how much each of the others takes. `of_each`: what it was accepted for. On unseen records that
/// stands: the steps that a refit is given there tell whether a cause is missed, and not what the best model without it would leave.
fn prune(
    bench: &Bench,
    best: &mut Hypothesis,
    of_each: &[Evidence],
    notes: &mut Vec<(String, String)>,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<Evidence>, IdentifyError> {
    let (mut of_all, mut k) = (Vec::new(), best.causes.len());
    let when_accepted: Vec<(String, Evidence)> =
        best.causes.iter().map(Cause::title).rev().zip(of_each.iter().rev().cloned()).collect();
    if let Some(then) = Pruned::reached(bench) {
        (*best, of_all, *notes, k) = (then.best, then.of_all, then.notes, then.left);
    }
    while k > 0 {
        k -= 1;
        let cause = best.causes[k].clone();
        progress(&format!("checking that {} is still needed", cause.title()));
        let without = bench.without(best, k)?;
        let contest = Contest::new(bench, &[&without, best], 2)?;
        let (better, share) = contest.gain(&contest.left_out(bench, 0, 1, &cause)?);
        let taken = contest.scores[0] - contest.scores[1];
        let missed = if contest.no_noise { better && share >= POLICY.worth } else { taken > 0.0 };
        let rested_on = best.causes.iter().any(|other| other.rests_on(&cause));
        if !missed && !rested_on && best.causes.len() > 1 {
            notes.push((cause.title(), "accepted first, superfluous beside the later causes".to_owned()));
            *best = without;
            told::taken_out(bench, best);
            // those before were judged with it present
            of_all.clear();
            k = best.causes.len();
        } else {
            let then = when_accepted.iter().find(|(title, _)| contest.unseen && *title == cause.title());
            of_all.insert(0, then.map_or_else(|| evidence(bench, &contest, 0, 1, &cause), |(_, then)| Ok(then.clone()))?);
        }
        Pruned::keep(bench, best, &of_all, notes, k);
    }
    Ok(of_all)
}
