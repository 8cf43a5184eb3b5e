//! Causes that no data of this kind could tell from an accepted one.
//!
//! If another cause imitates an accepted one exactly, whatever its size, then it also does so for a small change of size: at the accepted model,
//! and at the same one with the cause taken back to the scene's value, the two directions of change of the readings are parallel, all else
//! that is fitted projected off: nearly so without the cause, where the model is not that of the data. That needs no refit, which may fail to
//! arrive (an encoder's scale that stands for a floor's friction has to take every starting state with it). One end alone would not do: beside a
//! free gain, an encoder's scale changes the size of a cubic spring that is there, and makes none. Where the cause takes so much that the
//! data would tell even this little difference of direction, a refit decides.

use super::super::policy::POLICY;
use super::super::scores::scores_in;
use super::apart::{uncertain, with_common};
use super::coarse::Coarse;
use super::hypothesis::{Bench, Hypothesis, squares};
use super::round::Evidence;
use super::spread::frozen;
use crate::causes::{Cause, Situation};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::unknown::Unknown;

/// Of every accepted cause the others that move the readings in the same way. `judged`: the best model as it is judged, `evidence` of its causes;
/// `refitted`: models that were held against others, by their keys: a cause that was refitted in place of the accepted one is judged by that.
pub(super) fn alike(
    bench: &Bench,
    best: &Hypothesis,
    judged: &Fitted,
    evidence: &[Evidence],
    refitted: &[Vec<String>],
    seed: u64,
) -> Result<Vec<Vec<Cause>>, IdentifyError> {
    let coarse = Coarse::of(bench, &judged.of_some(POLICY.searched_records))?;
    let (there, fitted) = (&coarse.bench(bench), &coarse.fitted);
    let one = |(k, (cause, evidence)): (usize, (&Cause, &Evidence))| -> Result<Vec<Cause>, IdentifyError> {
        let swapped = |other: &Cause| {
            let mut key: Vec<String> = best.key().into_iter().filter(|t| *t != cause.title()).chain([other.title()]).collect();
            key.sort();
            key
        };
        let records = fitted.records.iter().map(|rec| frozen(rec, &cause.unknowns)).collect();
        let mut all = parallel(there, &Fitted { records, ..fitted.clone() }, cause, POLICY.alike, seed)?;
        all.retain(|other| !refitted.contains(&swapped(&other.cause)));
        if all.is_empty() {
            return Ok(Vec::new());
        }
        let mut back = with_common(fitted, &cause.unknowns);
        cause.unknowns.iter().for_each(|u| u.set(&mut back.values, u.value(&bench.plan.scene_values)));
        let before = parallel(there, &back, cause, POLICY.alike_before, seed)?;
        let mut out = Vec::new();
        for other in all {
            // in place of the cause it would have to be the other way than is physical
            let Some(begun) = before.iter().find(|b| b.cause.title() == other.cause.title() && b.admissible) else { continue };
            let told = (1.0 - other.cosine * other.cosine) * evidence.statistic > POLICY.lead;
            if !told || comes_as_near(bench, best, judged, k, begun)? {
                out.push(other.cause);
            }
        }
        Ok(out)
    };
    best.causes.iter().zip(evidence).enumerate().map(one).collect()
}

/// Whether the model with a cause replaced by another, refitted, cannot be told from it; so too if the refit does not arrive.
fn comes_as_near(bench: &Bench, best: &Hypothesis, judged: &Fitted, k: usize, other: &Parallel) -> Result<bool, IdentifyError> {
    let (noise, varies) = (&judged.noise, best.varies(k));
    let without = bench.without(best, k)?;
    let Ok((rough, cause)) = bench.with(&without.fitted, &other.cause, &other.step, &[]) else { return Ok(true) };
    let Ok(plain) = bench.finished(&rough, &without.fitted.records) else { return Ok(true) };
    let apart = if varies { bench.apart(&plain, &cause.unknowns)? } else { None };
    let swapped = without.and(cause, apart.unwrap_or(plain));
    let fitted = super::contest::judged(bench, &swapped, noise, POLICY.no_noise)?;
    let own_sizes = |fitted: &Fitted| uncertain(bench, fitted);
    let [here, there] =
        [squares(bench.plan, judged, noise)? + own_sizes(judged)?, squares(bench.plan, &fitted, noise)? + own_sizes(&fitted)?];
    Ok(!fitted.converged || there - here < POLICY.lead)
}

/// A cause that moves the readings as another does.
struct Parallel {
    cause: Cause,
    /// Smallest principal cosine of the two.
    cosine: f64,
    /// The step that the linearization proposes, and whether its sign is physical.
    step: Vec<f64>,
    admissible: bool,
}

/// The causes whose directions have at least this cosine with that of `cause` at a fit.
fn parallel(bench: &Bench, fitted: &Fitted, cause: &Cause, cosine: f64, seed: u64) -> Result<Vec<Parallel>, IdentifyError> {
    let own = |u: &&Unknown| cause.unknowns.iter().any(|o| o.target.same(&u.target));
    let others: Vec<Unknown> = fitted.unknowns.iter().filter(|u| !own(u)).cloned().collect();
    let at = Situation { plan: bench.plan, values: &fitted.values, free: &others, together: true };
    let tested = scores_in(bench.plan, &at, &Fitted { unknowns: others.clone(), ..fitted.clone() }, seed)?;
    let of = |j: usize| &tested.causes[tested.tested[j]];
    let all = 0..tested.tested.len();
    let Some(j) = all.clone().find(|&j| of(j).title() == cause.title()) else { return Ok(Vec::new()) };
    let one = |k: usize| {
        let (score, cosine) = (&tested.score.candidates[k], tested.score.containment[(j, k)]);
        Parallel { cause: of(k).clone(), cosine, step: score.theta.clone(), admissible: score.admissible }
    };
    let same = |k: &usize| *k != j && tested.score.candidates[*k].rank > 0 && tested.score.containment[(j, *k)] >= cosine;
    Ok(all.filter(same).map(one).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::causes::library;
    use crate::fit::fit;
    use crate::shooting::{Plan, ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;

    const NOISE: f64 = 2e-4;

    fn cause(plan: &Plan, name: &str) -> Cause {
        let at = Situation { plan, values: &plan.scene_values, free: &[], together: true };
        library(&at).into_iter().find(|cause| cause.name == name).unwrap()
    }

    /// A pendulum of which this cause has moved its coordinate so far.
    fn moved(name: &str, by: f64) -> Plan {
        let mut plan = experiment(&pendulum("measured"), &[vec![0.6; 40], vec![0.9; 40], vec![0.2; 40]]).0;
        let number = cause(&plan, name).unknowns[0].clone();
        let mut values = plan.scene_values.clone();
        number.set(&mut values, number.moved(number.value(&plan.scene_values), by));
        for (k, rec) in plan.fitted.clone().iter().enumerate() {
            let clean = shoot(&plan, rec, &values, ShotWants::default()).unwrap().predicted;
            plan.fitted[k].record.joints =
                clean.iter().zip(gaussians(40, 3 + k as u64)).map(|(x, e)| vec![x + NOISE * e]).collect();
        }
        plan
    }

    /// The accepted model with this cause, and what `then` says of it.
    fn accepted<T>(plan: &Plan, name: &str, then: impl Fn(&Bench, &Hypothesis) -> T) -> T {
        let white = ArModel::white(vec![NOISE]).unwrap();
        let bench = Bench { plan, declared: Vec::new(), white: white.clone() };
        let cause = cause(plan, name);
        let fitted =
            |unknowns: &[Unknown]| fit(plan, &plan.fitted, &plan.scene_values, unknowns, Some(&white), &POLICY.fine).unwrap();
        let best = Hypothesis::baseline(fitted(&[])).and(cause.clone(), fitted(&cause.unknowns));
        then(&bench, &best)
    }

    fn names_alike(name: &str, by: f64) -> Vec<String> {
        let evidence = [Evidence { statistic: 1e4, foretold: None }];
        accepted(&moved(name, by), name, |bench, best| {
            let all = alike(bench, best, &best.fitted, &evidence, &[], 0).unwrap();
            all[0].iter().map(|other| other.name.to_owned()).collect()
        })
    }

    /// An armature turns a joint heavier just as a link whose mass lies farther out does; lighter it cannot turn it.
    #[test]
    fn what_would_have_to_be_the_other_way_is_not_alike() {
        let [wider, closer] = [0.05, -0.05].map(|by| names_alike("link_inertia", by));
        assert!(wider.contains(&"armature".to_owned()), "{wider:?}");
        assert!(!closer.contains(&"armature".to_owned()), "{closer:?}");
    }

    /// A refit tells damping that grows with the speed from one that grows with its square, and not a wider link from an armature.
    #[test]
    fn a_refit_decides() {
        let comes_near = |name: &str, by: f64, other: &str| {
            let plan = moved(name, by);
            let other = Parallel { cause: cause(&plan, other), cosine: 1.0, step: vec![f64::NAN], admissible: true };
            accepted(&plan, name, |bench, best| comes_as_near(bench, best, &best.fitted, 0, &other).unwrap())
        };
        assert!(comes_near("link_inertia", 0.05, "armature"));
        assert!(!comes_near("viscous_friction", 2.0, "quadratic_damping"));
    }
}
