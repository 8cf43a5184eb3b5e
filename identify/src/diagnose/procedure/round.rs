//! One round of the search: which of the models that extend the ones so far by a cause is accepted, and what it cannot be told from.

use super::super::gain::prepared;
use super::super::numerics::Shift;
use super::super::policy::POLICY;
use super::super::result::NumericsKind;
use super::apart::{carried, uncertain};
use super::contest::Contest;
use super::hypothesis::{Bench, Hypothesis, squares};
use super::unseen::counted;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::followable;
use crate::stats::dist::chi2_quantile;
use crate::unknown::Unknown;
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

/// Models held against each other in a round: those of the beam first.
pub(super) struct Round<'a> {
    pub(super) bench: &'a Bench<'a>,
    pub(super) scene: &'a Scene,
    pub models: Vec<Hypothesis>,
    beam: usize,
    /// Causes tested in this round, for the level of each.
    tests: f64,
    pub(super) contest: Contest,
    /// −2 log likelihood of each on the held-out records, where it was asked for.
    held_out: Vec<OnceCell<f64>>,
    /// Errors of the simulation at the first child that they are asked for: the best, and those that come as near to the data share them.
    pub(super) shifts: OnceCell<Vec<Shift>>,
}

/// A model that was accepted.
pub(super) struct Accepted {
    pub leader: usize,
    pub evidence: Evidence,
    /// Others that it cannot be told from.
    pub tied: Vec<usize>,
    /// All that came after it, best first.
    behind: Vec<usize>,
}

impl<'a> Round<'a> {
    pub fn new(
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
    pub fn adopted(&self, k: usize) -> Hypothesis {
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
    pub fn accept(
        &self,
        notes: &mut Vec<(String, String)>,
        imitated: &mut Vec<(String, NumericsKind)>,
    ) -> Result<Option<Accepted>, IdentifyError> {
        let mut order: Vec<usize> = (self.beam..self.models.len()).collect();
        order.sort_by(|&a, &b| self.contest.scores[a].total_cmp(&self.contest.scores[b]));
        let (mut possible, mut as_numerics, mut doubtful) = (Vec::new(), Vec::new(), Vec::new());
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
                Some(Rejection::Impossible(why)) => notes.push((self.cause(k).title(), why)),
                Some(Rejection::Doubtful(why)) => {
                    notes.push((self.cause(k).title(), why));
                    doubtful.push(k);
                }
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
        let (limits, mut behind): (Vec<usize>, Vec<usize>) = behind.iter().partition(|&&k| self.has_as_limit(k, leader));
        for k in limits {
            notes.push((
                self.cause(k).title(),
                format!("becomes {} at a limit of its own, which explains as much", self.cause(leader).title()),
            ));
        }
        let mut tied: Vec<usize> = behind.iter().copied().filter(|&k| self.contest.ties(leader, k)).collect();
        for &k in behind.iter().filter(|k| !tied.contains(k)) {
            let ahead = self.contest.scores[k] - self.contest.scores[leader];
            let by = format!("{} is nearer to the data, by {ahead:.0} units of −2 log likelihood", self.cause(leader).title());
            notes.push((
                self.cause(k).title(),
                if self.contest.no_noise { "another is nearer to the data".to_owned() } else { by },
            ));
        }
        let rivals: Vec<usize> = doubtful.into_iter().filter(|&k| self.is_rival(k, leader)).collect();
        tied.extend(&rivals);
        behind.extend(&rivals);
        for of in [&mut tied, &mut behind] {
            of.sort_by(|&a, &b| self.contest.scores[a].total_cmp(&self.contest.scores[b]));
        }
        Ok(Some(Accepted {
            leader,
            evidence: evidence(self.bench, &self.contest, self.parent(), leader, self.cause(leader))?,
            tied,
            behind,
        }))
    }

    /// Whether one child is the other at a limit of the cause that it adds, for all that the data say: it has more numbers, the other's among
    /// them or a law that becomes the other's, and they gain nothing significant.
    fn has_as_limit(&self, k: usize, other: usize) -> bool {
        let more = self.models[k].numbers() as f64 - self.models[other].numbers() as f64;
        if self.contest.no_noise || more < 1.0 || !self.beside(k, other) {
            return false;
        }
        let has = |u: &Unknown| self.cause(k).unknowns.iter().any(|own| own.target.same(&u.target));
        let gained = self.contest.scores[other] - self.contest.scores[k] + POLICY.per_number * more;
        (self.cause(other).unknowns.iter().all(has) || self.cause(k).may_be(self.cause(other)))
            && gained < chi2_quantile(1.0 - POLICY.level, more)
    }

    /// Whether two children extend the same model.
    fn beside(&self, k: usize, other: usize) -> bool {
        let [a, b] = [k, other].map(|k| {
            let causes = &self.models[k].causes;
            let mut titles: Vec<String> = causes[..causes.len() - 1].iter().map(Cause::title).collect();
            titles.sort();
            titles
        });
        a == b
    }

    /// Whether a child that is not accepted for itself may be what the accepted one stands for: what the accepted one has to be told from is
    /// as near to the data, and not as certain. Of models of more than noise none is near.
    fn is_rival(&self, k: usize, leader: usize) -> bool {
        let near = !self.contest.no_noise && self.beside(k, leader) && self.contest.alike(leader, k);
        if !near || self.has_as_limit(k, leader) {
            return false;
        }
        // with the held-out records, where they were asked
        let all = |k: usize| self.contest.scores[k] + self.on_held_out(k);
        self.held_out[k].get().is_none() || all(k) - all(leader) - self.contest.pardoned(leader, k) < POLICY.lead
    }

    /// Children of other models that the first cannot be told from, where nothing is accepted: with no more numbers than it has, and as near to the
    /// data, which the models that they extend are not. Two causes may act as the two numbers of a third.
    pub fn as_near_as_the_first(&self) -> impl Iterator<Item = usize> {
        let has_all = |k: usize, of: usize| {
            let causes = &self.models[k].causes;
            self.models[of].causes.iter().all(|cause| causes.iter().any(|own| own.title() == cause.title()))
        };
        let near = |k: usize| !self.contest.no_noise && self.contest.alike(0, k);
        let needed = move |k: usize| (0..self.beam).all(|of| !has_all(k, of) || of != 0 && !near(of));
        let simple = |k: usize| self.models[k].numbers() <= self.models[0].numbers() && self.unphysical(k).is_none();
        (self.beam..self.models.len()).filter(move |k| simple(*k) && near(*k) && needed(*k))
    }

    /// The cause that a child adds.
    pub(super) fn cause(&self, k: usize) -> &Cause {
        &self.models[k].causes[self.models[k].causes.len() - 1]
    }

    /// Why the size that a child gives its cause is not physical, if it is not.
    fn unphysical(&self, k: usize) -> Option<String> {
        let [one] = self.cause(k).unknowns.as_slice() else { return None };
        let value = one.value(&self.contest.fits[k].values);
        let ends = value <= one.bounds.0 || value >= one.bounds.1;
        ends.then(|| format!("its refit ends at the physical bound {} = {value}", one.path))
    }

    /// Why a child is not accepted, if it is not.
    fn rejection(&self, k: usize) -> Result<Option<Rejection>, IdentifyError> {
        let (parent, cause) = (self.parent(), self.cause(k));
        if let Some(why) = self.unphysical(k) {
            return Ok(Some(Rejection::Impossible(why)));
        }
        let more = self.models[k].numbers() as f64 - self.models[parent].numbers() as f64;
        let taken = self.contest.scores[parent] - self.contest.scores[k];
        if !self.contest.no_noise {
            let level = chi2_quantile(1.0 - POLICY.accepted_level / self.tests, more.max(1.0));
            let (needed, gained) = (level.max(POLICY.per_number * more), taken + POLICY.per_number * more);
            if gained < needed {
                return Ok(Some(Rejection::Doubtful(format!(
                    "its refit gains {gained:.1} units of −2 log likelihood, less than {needed:.1}"
                ))));
            }
            let lost = self.on_held_out(k) - self.on_held_out(parent);
            if gained - lost < needed {
                return Ok(Some(Rejection::Doubtful(format!(
                    "its refit gains {gained:.1} units of −2 log likelihood, and with it the held-out records lose {lost:.1} of them"
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
            return Ok(Some(Rejection::Doubtful(format!(
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
            let records = followable(plan, &plan.held_out)?;
            let near = carried(judged, &prepared(plan, &records, judged, &POLICY.fine)?);
            let fitted = self.bench.polished(&near, &judged.values, &[], &judged.noise, &POLICY.fine)?;
            Ok(squares(plan, &fitted, &judged.noise)? + uncertain(self.bench, &fitted)?)
        };
        *self.held_out[k].get_or_init(|| if plan.held_out.is_empty() { 0.0 } else { squares().unwrap_or(f64::INFINITY) })
    }

    /// The models that the next cause is tried on: the accepted one, its ties, and what comes second.
    pub fn next_beam(&self, accepted: &Accepted) -> Vec<Hypothesis> {
        // on unseen records the leader alone: each further model is tried as often
        let size = if self.contest.unseen { 1 } else { POLICY.beam.max(1 + accepted.tied.len().min(POLICY.finalists)) };
        let order = std::iter::once(accepted.leader).chain(accepted.behind.iter().copied());
        order.take(size).map(|k| self.adopted(k)).collect()
    }
}

/// Why a cause is not accepted.
pub(super) enum Rejection {
    /// Its size is not physical.
    Impossible(String),
    /// It is not certain.
    Doubtful(String),
    /// The simulation's own error would be enough.
    Imitated(NumericsKind),
}

/// Evidence for a cause: the model with it against the one without.
pub(super) fn evidence(
    bench: &Bench,
    contest: &Contest,
    without: usize,
    with: usize,
    cause: &Cause,
) -> Result<Evidence, IdentifyError> {
    let numbers = if contest.no_noise { 0.0 } else { POLICY.per_number * cause.unknowns.len() as f64 };
    let both = contest.left_out(bench, without, with, cause)?;
    let foretold = (both[0].len() > 1).then(|| contest.gain(&both).1);
    Ok(Evidence { statistic: contest.scores[without] - contest.scores[with] + numbers, foretold })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::super::beside::Beside;
    use super::super::super::numerics::{Source as Own, shift};
    use super::*;
    use crate::causes::{Situation, library};
    use crate::fit::fit;
    use crate::log::Setup;
    use crate::shooting::{Plan, ShotWants, opened, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;
    use crate::unknown::Unknown;
    use pliant_scene::Source;
    use std::path::PathBuf;

    const NOISE: f64 = 2e-4;

    /// Swings of a pendulum of which these parameters are other than the scene says.
    fn swings(hidden: &[(&str, f64)]) -> Plan {
        swings_in(&pendulum("measured"), hidden)
    }

    fn swings_in(text: &str, hidden: &[(&str, f64)]) -> Plan {
        let starts = [0.9, -0.6, 1.2, 0.5];
        let mut plan = experiment(text, &starts.map(|angle| vec![angle; 40])).0;
        let mut truth = plan.scene_values.clone();
        for (path, value) in hidden {
            match plan.model.params().find(path) {
                Some(entry) => truth.theta[entry] = *value,
                None => cause(&plan, "encoder_bias").unknowns[0].set(&mut truth, *value),
            }
        }
        let scene = plan.clone();
        for (k, rec) in plan.fitted.iter_mut().chain(&mut plan.held_out).enumerate() {
            let clean = shoot(&scene, rec, &truth, ShotWants::default()).unwrap().predicted;
            let noise = gaussians(40, 7 + k as u64);
            rec.record.joints = clean.iter().zip(noise).map(|(x, e)| vec![x + NOISE * e]).collect();
        }
        plan
    }

    fn cause(plan: &Plan, name: &str) -> Cause {
        let at = Situation { plan, values: &plan.scene_values, free: &[], together: true };
        library(&at).into_iter().find(|cause| cause.name == name).unwrap()
    }

    fn bench(plan: &Plan) -> Bench<'_> {
        Bench { plan, declared: Vec::new(), white: ArModel::white(vec![NOISE]).unwrap() }
    }

    /// A model of these causes, refitted.
    fn model(bench: &Bench, causes: &[Cause]) -> Hypothesis {
        let plan = bench.plan;
        let fitted = |unknowns: &[Unknown]| {
            fit(plan, &plan.fitted, &plan.scene_values, unknowns, Some(&bench.white), &POLICY.coarse).unwrap()
        };
        let (mut out, mut unknowns) = (Hypothesis::baseline(fitted(&[])), Vec::new());
        for cause in causes {
            unknowns.extend(cause.unknowns.clone());
            out = out.and(cause.clone(), fitted(&unknowns));
        }
        out
    }

    fn scene() -> Scene {
        scene_of(pendulum("measured"))
    }

    fn scene_of(text: String) -> Scene {
        opened(&Setup::from_source(Source::new("scene.toml", text), PathBuf::new()).unwrap().scene)
    }

    /// What is as near to the data as the accepted cause is its rival, whether it is certain for itself or not.
    #[test]
    fn what_is_not_certain_may_be_a_rival() {
        let plan = swings(&[("pivot.damping", 2.5e-4)]);
        let bench = bench(&plan);
        let causes = ["viscous_friction", "quadratic_damping", "joint_stiffness"].map(|name| cause(&plan, name));
        let (base, scene) = (model(&bench, &[]), scene());
        let children: Vec<Hypothesis> = causes.iter().map(|cause| model(&bench, std::slice::from_ref(cause))).collect();
        let with = |tests: usize| {
            let round = Round::new(&bench, &scene, std::slice::from_ref(&base), children.clone(), tests).unwrap();
            let gained: Vec<f64> =
                (1..4).map(|k| round.contest.scores[0] - round.contest.scores[k] + POLICY.per_number).collect();
            let accepted = round.accept(&mut Vec::new(), &mut Vec::new()).unwrap();
            (gained, accepted.map(|accepted| (accepted.leader, accepted.tied)))
        };
        let (gained, accepted) = with(1);
        let level = |tests: usize| chi2_quantile(1.0 - POLICY.accepted_level / tests as f64, 1.0);
        assert_eq!(accepted.map(|accepted| accepted.0), Some(1), "{gained:?}");
        // as many tests as make the rival uncertain
        let tests = (0..40).map(|k| 1usize << k).find(|tests| level(*tests) > gained[1]).unwrap_or(usize::MAX);
        assert!(level(tests) < gained[0], "{gained:?} {}", level(tests));
        assert_eq!(with(tests).1, Some((1, vec![2])), "{gained:?}");
    }

    /// What is no larger than three times what makes up for the step is looked for with a finer step first, whether or not that is nearer to the data.
    #[test]
    fn what_may_make_up_for_a_long_step_waits_for_a_finer_one() {
        let text = pendulum("measured").replace("step = 0.005", "step = 0.01");
        let scene = scene_of(text.clone());
        let with = |armature: f64| {
            let plan = swings_in(&text, &[("pivot.armature", armature)]);
            let bench = bench(&plan);
            let beam = [model(&bench, &[])];
            let child = model(&bench, &[cause(&plan, "armature")]);
            let own = shift(Own::Step, &scene, &plan, &child.fitted).unwrap();
            let makes_up = Beside::new(&plan, &child.fitted, &[&own.change]).unwrap().sizes(0)[0];
            let size = child.fitted.unknowns[0].coordinate_of(child.fitted.unknowns[0].value(&child.fitted.values));
            let round = Round::new(&bench, &scene, &beam, vec![child], 1).unwrap();
            let (taken, mut imitated) = (round.contest.scores[0] - round.contest.scores[1], Vec::new());
            assert!(taken > POLICY.lead && round.taken_by_finer(0, Own::Step).unwrap() == 0.0, "{taken}");
            let accepted = round.accept(&mut Vec::new(), &mut imitated).unwrap();
            ((makes_up / size).abs(), accepted.map(|accepted| accepted.leader), imitated)
        };
        let (makes_up, accepted, imitated) = with(7e-5);
        assert!(makes_up > 1.0 / POLICY.beyond_bias && accepted.is_none(), "{makes_up}");
        assert_eq!(imitated, [("armature (pivot)".to_owned(), NumericsKind::Step)]);
        let (makes_up, accepted, imitated) = with(1.2e-4);
        assert!(makes_up < 1.0 / POLICY.beyond_bias && accepted == Some(1) && imitated.is_empty(), "{makes_up}");
    }

    /// A law that has the accepted cause's number among its own is no rival: it is there in both.
    #[test]
    fn what_has_the_accepted_cause_in_it_is_no_rival() {
        let plan = swings(&[("pivot.damping", 2.5e-4)]);
        let (bench, scene) = (bench(&plan), scene());
        let viscous = cause(&plan, "viscous_friction");
        let unknowns = [viscous.unknowns.clone(), cause(&plan, "joint_stiffness").unknowns].concat();
        let both = Cause { name: "both", unknowns, ..viscous.clone() };
        let (base, children) = (model(&bench, &[]), [viscous, both].map(|cause| model(&bench, &[cause])));
        let round = Round::new(&bench, &scene, &[base], children.to_vec(), 1).unwrap();
        assert!(round.contest.alike(1, 2));
        let accepted = round.accept(&mut Vec::new(), &mut Vec::new()).unwrap().unwrap();
        assert_eq!((accepted.leader, accepted.tied), (1, Vec::new()));
    }

    /// Two causes that act as the two numbers of the best one are rivals of it, where each of them alone is not.
    #[test]
    fn two_causes_together_may_be_rivals() {
        let plan = swings(&[("pivot.damping", 5e-3), ("encoder bias", 4e-3)]);
        let (bench, scene) = (bench(&plan), scene());
        let [bias, viscous, stiffness] = ["encoder_bias", "viscous_friction", "joint_stiffness"].map(|name| cause(&plan, name));
        let unknowns = [viscous.unknowns.clone(), bias.unknowns.clone()].concat();
        let two = Cause { name: "two", unknowns, ..viscous.clone() };
        let beam = [vec![two.clone()], vec![bias.clone()]].map(|causes| model(&bench, &causes));
        let whole = vec![bias.clone(), viscous.clone()];
        let children: Vec<Hypothesis> = [vec![bias.clone(), viscous], vec![bias, stiffness.clone()], vec![two, stiffness]]
            .iter()
            .map(|c| model(&bench, c))
            .collect();
        let round = Round::new(&bench, &scene, &beam, children, 1).unwrap();
        assert!(round.accept(&mut Vec::new(), &mut Vec::new()).unwrap().is_none());
        assert_eq!(round.as_near_as_the_first().collect::<Vec<_>>(), [2]);
        // what is as near without its last cause does not need it
        let beam = [beam[0].clone(), model(&bench, &whole)];
        let two = [beam[0].causes.clone(), whole[..1].to_vec()].concat();
        let first = model(&bench, &two);
        let round = Round::new(
            &bench,
            &scene,
            &[first, beam[1].clone()],
            vec![model(&bench, &[whole, vec![cause(&plan, "joint_stiffness")]].concat())],
            1,
        )
        .unwrap();
        assert!(round.contest.alike(0, 1) && round.contest.alike(0, 2));
        assert!(round.as_near_as_the_first().next().is_none());
    }
}
