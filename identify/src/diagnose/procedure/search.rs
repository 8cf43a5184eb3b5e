//! The order of the procedure: one cause after the other is accepted, each for good reasons, and taken out again if it is not missed.

use super::super::beside::Beside;
use super::super::gain::prepared;
use super::super::numerics::{Shift, Source, changes, shift, shifts};
use super::super::policy::POLICY;
use super::super::result::NumericsKind;
use super::alike::alike;
use super::apart::{carried, uncertain};
use super::contest::{Contest, judged, noise_of};
use super::hypothesis::{Bench, Hypothesis, squares};
use super::kept::{Between, Pruned};
use super::race::race;
use super::told;
use super::unseen::counted;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::stats::dist::chi2_quantile;
use pliant_scene::Scene;
use std::cell::OnceCell;

/// Evidence for an accepted cause, all other causes present; of models that are judged on unseen records, those accepted before.
#[derive(Clone, Debug)]
pub(in super::super) struct Evidence {
    /// Squares that it takes.
    pub statistic: f64,
    /// Part of the squares on records left out that it takes; of a size that varies, on halves of records. Absent with a single record.
    pub foretold: Option<f64>,
}

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

/// Models held against each other in a round: those of the beam first.
struct Round<'a> {
    bench: &'a Bench<'a>,
    scene: &'a Scene,
    models: Vec<Hypothesis>,
    beam: usize,
    /// Causes tested in this round, for the level of each.
    tests: f64,
    contest: Contest,
    /// −2 log likelihood of each on the held-out records, where it was asked for.
    held_out: Vec<OnceCell<f64>>,
    /// Errors of the simulation at the first child that they are asked for: the best, and those that come as near to the data share them.
    shifts: OnceCell<Vec<Shift>>,
}

/// A model that was accepted.
struct Accepted {
    leader: usize,
    evidence: Evidence,
    /// Others that it cannot be told from.
    tied: Vec<usize>,
    /// All that came after it, best first.
    behind: Vec<usize>,
}

impl<'a> Round<'a> {
    fn new(
        bench: &'a Bench,
        scene: &'a Scene,
        beam: &[Hypothesis],
        children: Vec<Hypothesis>,
        tests: usize,
    ) -> Result<Self, IdentifyError> {
        let models: Vec<Hypothesis> = beam.iter().cloned().chain(children).collect();
        let contest = Contest::new(bench, &models.iter().collect::<Vec<_>>(), beam.len())?;
        let held_out = vec![OnceCell::new(); models.len()];
        Ok(Self {
            bench,
            scene,
            models,
            beam: beam.len(),
            tests: tests.max(1) as f64,
            contest,
            held_out,
            shifts: OnceCell::new(),
        })
    }

    /// A model as the next cause is tried on it.
    fn adopted(&self, k: usize) -> Hypothesis {
        let mut out = self.contest.adopted(k, &self.models[k]);
        if self.contest.unseen {
            out.fitted = counted(self.bench, &out.fitted);
        }
        out
    }

    /// The best model of the beam.
    fn parent(&self) -> usize {
        (0..self.beam).min_by(|&a, &b| self.contest.scores[a].total_cmp(&self.contest.scores[b])).unwrap_or(0)
    }

    /// The best child that has everything a cause is accepted for, with its ties.
    fn accept(
        &self,
        notes: &mut Vec<(String, String)>,
        imitated: &mut Vec<(String, NumericsKind)>,
    ) -> Result<Option<Accepted>, IdentifyError> {
        let mut order: Vec<usize> = (self.beam..self.models.len()).collect();
        order.sort_by(|&a, &b| self.contest.scores[a].total_cmp(&self.contest.scores[b]));
        let (mut possible, mut as_numerics) = (Vec::new(), Vec::new());
        // of two that are as near to the data neither is there where the simulation's own error may be one of them
        let beside = |k: usize, as_numerics: &[usize]| {
            let rival = as_numerics.iter().find(|&&other| self.contest.alike(k, other))?;
            Some(format!("{} is as near to the data, and the simulation's own error imitates it", self.cause(*rival).title()))
        };
        for k in order {
            if let Some(why) = beside(k, &as_numerics) {
                notes.push((self.cause(k).title(), why));
                continue;
            }
            match self.rejection(k)? {
                None => possible.push(k),
                Some(Rejection::Imitated(kind)) => {
                    let title = self.cause(k).title();
                    notes.push((title.clone(), kind.imitates().to_owned()));
                    imitated.push((title, kind));
                    as_numerics.push(k);
                }
                Some(Rejection::Because(why)) => notes.push((self.cause(k).title(), why)),
            }
        }
        possible.retain(|&k| match beside(k, &as_numerics) {
            Some(why) => {
                notes.push((self.cause(k).title(), why));
                false
            }
            None => true,
        });
        let Some((&leader, behind)) = possible.split_first() else { return Ok(None) };
        let (limits, behind): (Vec<usize>, Vec<usize>) = behind.iter().partition(|&&k| self.has_as_limit(k, leader));
        for k in limits {
            notes.push((
                self.cause(k).title(),
                format!("becomes {} at a limit of its own, which explains as much", self.cause(leader).title()),
            ));
        }
        let tied: Vec<usize> = behind.iter().copied().filter(|&k| self.contest.ties(leader, k)).collect();
        for &k in behind.iter().filter(|k| !tied.contains(k)) {
            let ahead = self.contest.scores[k] - self.contest.scores[leader];
            let by = format!("{} is nearer to the data, by {ahead:.0} units of −2 log likelihood", self.cause(leader).title());
            notes.push((
                self.cause(k).title(),
                if self.contest.no_noise { "another is nearer to the data".to_owned() } else { by },
            ));
        }
        Ok(Some(Accepted {
            leader,
            evidence: evidence(self.bench, &self.contest, self.parent(), leader, self.cause(leader))?,
            tied,
            behind,
        }))
    }

    /// Whether one child is the other at a limit of the cause that it adds, for all that the data say: it has more numbers, and they gain
    /// nothing significant.
    fn has_as_limit(&self, k: usize, other: usize) -> bool {
        let before = |k: usize| {
            let causes = &self.models[k].causes;
            let mut titles: Vec<String> = causes[..causes.len() - 1].iter().map(Cause::title).collect();
            titles.sort();
            titles
        };
        let more = self.models[k].numbers() as f64 - self.models[other].numbers() as f64;
        if self.contest.no_noise || more < 1.0 || !self.cause(k).may_be(self.cause(other)) || before(k) != before(other) {
            return false;
        }
        let gained = self.contest.scores[other] - self.contest.scores[k] + POLICY.per_number * more;
        gained < chi2_quantile(1.0 - POLICY.level, more)
    }

    /// The cause that a child adds.
    fn cause(&self, k: usize) -> &Cause {
        &self.models[k].causes[self.models[k].causes.len() - 1]
    }

    /// Why a child is not accepted, if it is not.
    fn rejection(&self, k: usize) -> Result<Option<Rejection>, IdentifyError> {
        let (parent, cause, fitted) = (self.parent(), self.cause(k), &self.contest.fits[k]);
        if let [one] = cause.unknowns.as_slice() {
            let value = one.value(&fitted.values);
            if value <= one.bounds.0 || value >= one.bounds.1 {
                return Ok(Some(Rejection::Because(format!("its refit ends at the physical bound {} = {value}", one.path))));
            }
        }
        let more = self.models[k].numbers() as f64 - self.models[parent].numbers() as f64;
        let taken = self.contest.scores[parent] - self.contest.scores[k];
        if !self.contest.no_noise {
            let level = chi2_quantile(1.0 - POLICY.accepted_level / self.tests, more.max(1.0));
            let (needed, gained) = (level.max(POLICY.per_number * more), taken + POLICY.per_number * more);
            if gained < needed {
                return Ok(Some(Rejection::Because(format!(
                    "its refit gains {gained:.1} units of −2 log likelihood, less than {needed:.1}"
                ))));
            }
            let lost = self.on_held_out(k) - self.on_held_out(parent);
            if gained - lost < needed {
                return Ok(Some(Rejection::Because(format!(
                    "its refit gains {gained:.1} units of −2 log likelihood, and with it the held-out records lose {lost:.1}"
                ))));
            }
        }
        let both = self.contest.left_out(self.bench, parent, k, cause)?;
        let (better, share) = self.contest.gain(&both);
        let carries = better && (!self.contest.no_noise || share >= POLICY.worth);
        // a single record has none left out, and its likelihood decides
        let judged = both[1].len() >= 2 || self.contest.no_noise;
        if judged && !carries {
            let what = if self.contest.varies[k] { "halves of records" } else { "records" };
            return Ok(Some(Rejection::Because(format!(
                "it does not carry over: on {what} left out it takes {:.1} % of the squares",
                100.0 * share
            ))));
        }
        // an approximation of more than noise gets no name that the simulation's own error could have taken
        if self.contest.unseen { Ok(None) } else { self.imitated(parent, k) }
    }

    /// −2 log likelihood of a model on the held-out records, of which only the starts are fitted; infinite where it cannot be simulated.
    fn on_held_out(&self, k: usize) -> f64 {
        let (plan, judged) = (self.bench.plan, &self.contest.fits[k]);
        let squares = || -> Result<f64, IdentifyError> {
            let near = carried(judged, &prepared(plan, &plan.held_out, judged, &POLICY.fine)?);
            let fitted = self.bench.polished(&near, &judged.values, &[], &judged.noise, &POLICY.fine)?;
            Ok(squares(plan, &fitted, &judged.noise)? + uncertain(self.bench, &fitted)?)
        };
        *self.held_out[k].get_or_init(|| if plan.held_out.is_empty() { 0.0 } else { squares().unwrap_or(f64::INFINITY) })
    }

    /// Whether the simulation's own error imitates the cause: its size is no more than three times the one that makes up for that error, and it
    /// does not lead the finer simulation without it, or one that is part of the way there.
    fn imitated(&self, parent: usize, k: usize) -> Result<Option<Rejection>, IdentifyError> {
        let (plan, fitted) = (self.bench.plan, &self.contest.fits[k]);
        let own: Vec<usize> = (0..fitted.unknowns.len())
            .filter(|&j| self.cause(k).unknowns.iter().any(|o| o.target.same(&fitted.unknowns[j].target)))
            .collect();
        let size = |j: usize| {
            let u = &fitted.unknowns[j];
            (u.coordinate_of(u.value(&fitted.values)) - u.coordinate_of(u.value(&plan.scene_values))).abs()
        };
        let shifts = self.shifts.get_or_init(|| shifts(self.scene, plan, fitted));
        let coarse = self.contest.coarse(self.bench, k)?;
        let beside = Beside::new(&coarse.plan, &coarse.fitted, &changes(shifts))?;
        for (number, of) in shifts.iter().enumerate() {
            let bias = beside.sizes(number);
            let small = own.iter().all(|&j| size(j) <= POLICY.beyond_bias * bias[j].abs());
            if small
                && self.taken_by_finer(parent, of.source)? > self.contest.scores[parent] - self.contest.scores[k] - POLICY.lead
            {
                return Ok(Some(Rejection::Imitated(of.source.kind())));
            }
        }
        Ok(None)
    }

    /// Squares that a finer simulation, or one part of the way to it, takes from a model; inputs are read one way or the other.
    fn taken_by_finer(&self, model: usize, source: Source) -> Result<f64, IdentifyError> {
        let coarse = self.contest.coarse(self.bench, model)?;
        let finer = shift(source, self.scene, self.bench.plan, &self.contest.fits[model]);
        let Some(finer) = finer else { return Ok(0.0) };
        let beside = Beside::new(&coarse.plan, &coarse.fitted, &[&finer.change])?;
        Ok(if source.kind() == NumericsKind::Inputs { beside.gain(0) } else { beside.most(0) })
    }

    /// The models that the next cause is tried on: the accepted one, its ties, and what comes second.
    fn next_beam(&self, accepted: &Accepted) -> Vec<Hypothesis> {
        // on unseen records the leader alone: each further model is tried as often
        let size = if self.contest.unseen { 1 } else { POLICY.beam.max(1 + accepted.tied.len().min(POLICY.finalists)) };
        let order = std::iter::once(accepted.leader).chain(accepted.behind.iter().copied());
        order.take(size).map(|k| self.adopted(k)).collect()
    }
}

/// Why a cause is not accepted.
enum Rejection {
    Because(String),
    Imitated(NumericsKind),
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

/// Evidence for a cause: the model with it against the one without.
fn evidence(bench: &Bench, contest: &Contest, without: usize, with: usize, cause: &Cause) -> Result<Evidence, IdentifyError> {
    let numbers = if contest.no_noise { 0.0 } else { POLICY.per_number * cause.unknowns.len() as f64 };
    let both = contest.left_out(bench, without, with, cause)?;
    let foretold = (both[0].len() > 1).then(|| contest.gain(&both).1);
    Ok(Evidence { statistic: contest.scores[without] - contest.scores[with] + numbers, foretold })
}
