//! Hypotheses about the remainder: a force or an error of a sensor that is a function of one variable.
//!
//! Of every joint a force f(x), of a ball about each of its axes, and of its sensor an error e(x), are tried, with x the time, the position or
//! the velocity: powers, waves of the position, friction whose size depends on the position or on the time, and any function at all, as a sum of
//! hats over the range that the records visit. Of every node of a rope a force that is always there, of all its nodes one that depends on the
//! time, of its bending a moment that depends on the curvature or its rate, and of all markers an error that depends on the time. And of every
//! joint and rope a push, for a moment of one record. Each is a score test at the final model, with everything fitted and the simulation's own
//! errors projected off. They decide whether something is left, and are hypotheses about what it is: no names.

mod hypotheses;

use super::numerics::{Shift, changes};
use super::policy::{Blocks, POLICY};
use super::procedure::{Bench, Coarse};
use super::result::RemainderForm;
use super::scores::reduce_beside;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::{Fitted, evenly};
use crate::form::{Form, Place, Shape, Variable};
use crate::number::number_plain;
use crate::shooting::{Plan, RecordPlan, Shot, ShotWants, shoot};
use crate::stats::dist::chi2_sf;
use crate::stats::score::{Candidate, CandidateScore, ScoreOptions, Sign, score_test};
use crate::unknown::{Unknown, Values};
use hypotheses::{Group, Ranges, Site, sites};
use rayon::prelude::*;

/// The hypotheses that are significant, those first that take most beyond what their numbers cost: of an accepted cause other functions of the
/// variable that its force depends on, among themselves, since a law that stands in for another leaves just that; and all others. `fitted` may
/// have residuals that are not those of its values alone.
pub(super) fn forms(
    bench: &Bench,
    fitted: &Fitted,
    causes: &[&Cause],
    shifts: &[Shift],
) -> Result<Vec<RemainderForm>, IdentifyError> {
    // where what is left is no noise, some of many records are enough to say what it looks like
    let most = if bench.no_noise(fitted) { POLICY.searched_records } else { usize::MAX };
    let keep = evenly(&fitted.records, most);
    let shifts: Vec<Shift> = shifts.iter().map(|shift| shift.of_some(&keep)).collect();
    let coarse = Coarse::of(bench, &fitted.of_some(most))?;
    let plan = &coarse.plan;
    let shots: Vec<Shot> =
        coarse.fitted.records.par_iter().map(|rec| simulated(plan, rec, &coarse.fitted.values)).collect::<Result<_, _>>()?;
    let fitted = as_left(&coarse.fitted, &shots);
    let (mut of_causes, mut others) = (Vec::new(), Vec::new());
    for site in sites(plan) {
        let Some(ranges) = Ranges::new(plan, &fitted.records, &shots, &site) else { continue };
        let groups = site.groups(&ranges);
        let test = tested(plan, &fitted, &groups, &changes(&shifts), POLICY.constancy_blocks)?;
        // what hangs on a few stretches of the records, as on an outlier at the end of a range, has no robust error
        let robust = |(_, s): &(&Group, &CandidateScore)| s.rank > 0 && s.p_blocks.is_some();
        let robust: Vec<(&Group, &CandidateScore)> = groups.iter().zip(&test).filter(robust).collect();
        for (group, score) in robust {
            let family = if causes.iter().any(|cause| site.has_law(cause, group)) { &mut of_causes } else { &mut others };
            family.push(site.told(plan, group, score));
        }
    }
    let significant = |family: Vec<RemainderForm>| {
        let tests = family.len() as f64;
        family.into_iter().filter(move |form| form.p * tests < POLICY.form_level)
    };
    let mut out: Vec<RemainderForm> = significant(of_causes).chain(significant(others)).collect();
    let (pushes, tests) = pushes(plan, &fitted, &changes(&shifts))?;
    out.extend(pushes.into_iter().filter(|push| push.p * (tests as f64) < POLICY.push_level));
    // beside something strong everything is significant: what comes nearest to it comes first
    let worth = |form: &RemainderForm| form.taken - POLICY.per_number * form.numbers as f64;
    out.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    Ok(out)
}

/// Pushes: a force at a joint or on a rope for a moment of one record. Of every record and place the most significant one, and how many were tried.
fn pushes(plan: &Plan, fitted: &Fitted, changes: &[&[Vec<f64>]]) -> Result<(Vec<RemainderForm>, usize), IdentifyError> {
    let sites = sites(plan);
    let pushed = || sites.iter().flat_map(|site| site.pushed().into_iter().map(move |place| (site, place)));
    let pairs: Vec<(usize, (&Site, Place))> = (0..fitted.records.len()).flat_map(|r| pushed().map(move |at| (r, at))).collect();
    let tried = |(r, at): &(usize, (&Site, Place))| pushes_of(plan, fitted, changes, *r, *at);
    let tried: Vec<Vec<RemainderForm>> = pairs.par_iter().map(tried).collect::<Result<_, _>>()?;
    let number = tried.iter().map(Vec::len).sum();
    let strongest = |all: Vec<RemainderForm>| all.into_iter().min_by(|a, b| a.p.total_cmp(&b.p));
    Ok((tried.into_iter().filter_map(strongest).collect(), number))
}

/// Those of one record and place: a hat over each part of the record's time.
fn pushes_of(
    plan: &Plan,
    fitted: &Fitted,
    changes: &[&[Vec<f64>]],
    r: usize,
    (site, place): (&Site, Place),
) -> Result<Vec<RemainderForm>, IdentifyError> {
    let rec = &fitted.records[r];
    let alone = Fitted { records: vec![rec.clone()], residuals: vec![fitted.residuals[r].clone()], ..fitted.clone() };
    let changes: Vec<&[Vec<f64>]> = changes.iter().map(|change| &change[r..=r]).collect();
    let width = rec.record.time.last().copied().unwrap_or(0.0) / POLICY.push_parts as f64;
    let push = |k: usize| {
        let peak = k as f64 * width;
        let shape = Shape::Hat { peak, width, first: false, last: false };
        let what = format!("pushes for {} s, {} s into {}", number_plain(width), number_plain(peak), rec.record.name);
        Group { forms: vec![Form { place, variable: Variable::Time, shape, reversing: false }], what }
    };
    let groups: Vec<Group> = (0..=POLICY.push_parts - POLICY.push_behind).map(push).collect();
    let test = tested(plan, &alone, &groups, &changes, POLICY.push_blocks)?;
    // an outlier is a push to the model as well, but hangs on one block
    let told = |(group, score): (&Group, &CandidateScore)| {
        let form = site.told(plan, group, score);
        RemainderForm { p: chi2_sf(score.lm_without_any, 1.0), ..form }
    };
    let felt = felt(&test);
    Ok(groups.iter().zip(&test).zip(felt).filter(|(_, felt)| *felt).map(|(one, _)| told(one)).collect())
}

/// Which of the pushes the readings feel: where friction holds a joint the model hardly moves, and to first order a push there would have to be
/// larger by orders than anything that is.
fn felt(pushes: &[CandidateScore]) -> Vec<bool> {
    let information = |score: &CandidateScore| if score.rank > 0 { score.std_error[0].powi(-2) } else { 0.0 };
    let all: Vec<f64> = pushes.iter().map(information).collect();
    let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
    all.iter().map(|one| *one > POLICY.feeble_part * mean).collect()
}

/// The score test of hypotheses, with everything fitted and these changes of the readings projected off.
fn tested(
    plan: &Plan,
    fitted: &Fitted,
    groups: &[Group],
    changes: &[&[Vec<f64>]],
    blocks: Blocks,
) -> Result<Vec<CandidateScore>, IdentifyError> {
    let k = fitted.unknowns.len();
    let mut unknowns = fitted.unknowns.clone();
    let mut candidates = Vec::new();
    for group in groups {
        let columns = (unknowns.len()..unknowns.len() + group.forms.len()).collect();
        unknowns.extend(group.forms.iter().map(|form| Unknown::of_form(group.what.clone(), form.clone())));
        candidates.push(Candidate { columns, sign: Sign::Any });
    }
    let reduced = reduce_beside(plan, fitted, &unknowns, changes, blocks)?;
    let nuisance: Vec<usize> = (0..k).chain(unknowns.len()..unknowns.len() + changes.len()).collect();
    Ok(score_test(&reduced, &nuisance, &candidates, &ScoreOptions::default())?.candidates)
}

/// The fit with corrections of its records that make the simulation's residuals those that it says are left: where sizes differ from record to
/// record, its values are the common ones.
fn as_left(fitted: &Fitted, shots: &[Shot]) -> Fitted {
    let mut out = fitted.clone();
    for (rec, (left, shot)) in out.records.iter_mut().zip(fitted.residuals.iter().zip(shots)) {
        let mut known = rec.correction.to_vec();
        known.resize(left.len(), 0.0);
        known.iter_mut().zip(left.iter().zip(&shot.residual)).for_each(|(k, (left, now))| *k += left - now);
        rec.correction = known.into();
    }
    out
}

fn simulated(plan: &Plan, rec: &RecordPlan, values: &Values) -> Result<Shot, IdentifyError> {
    shoot(plan, rec, values, ShotWants { states: true, ..ShotWants::default() })
        .map_err(|source| IdentifyError::Simulation { record: rec.record.name.clone(), source })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::causes::{Situation, library};
    use crate::fit::fit;
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;

    const NOISE: f64 = 1e-4;

    /// What the swings have that the scene lacks.
    #[derive(Clone, Copy, Default)]
    struct Swings {
        /// N·m·s²/rad²
        damping: f64,
        /// Error of the encoder that changes sign with the velocity \[rad\].
        play: f64,
        /// Torque from 0.1 to 0.2 s of the second record [N·m].
        push: f64,
        /// Error of the last reading of the second record \[rad\].
        outlier: f64,
    }

    /// Hypotheses about swings, at the scene without all this.
    fn of_swings(hidden: Swings) -> Vec<RemainderForm> {
        beside_causes(hidden, &[])
    }

    /// The same where these causes, whatever their sizes, were accepted.
    fn beside_causes(hidden: Swings, accepted: &[&str]) -> Vec<RemainderForm> {
        let starts = [0.3, 0.9, -0.5, 1.4, -1.1, 0.6];
        let nothing: Vec<Vec<f64>> = starts.iter().map(|angle| vec![*angle; 40]).collect();
        let mut plan = experiment(&pendulum("measured"), &nothing).0;
        let mut truth = plan.scene_values.clone();
        truth.theta[plan.model.params().find("pivot.quadratic_damping").unwrap()] = hidden.damping;
        for (k, mut rec) in plan.fitted.clone().into_iter().enumerate() {
            let (push, outlier) = if k == 1 { (hidden.push, hidden.outlier) } else { (0.0, 0.0) };
            rec.inputs.iter_mut().skip(20).take(20).for_each(|u| u[0] += push);
            let shot = simulated(&plan, &rec, &truth).unwrap();
            let speed = |t: usize| shot.predicted[(t + 1).min(39)] - shot.predicted[t.saturating_sub(1)];
            let noise = gaussians(40, 7 + k as u64);
            let late = |t: usize| if t == 39 { outlier } else { 0.0 };
            let reading = |t: usize| vec![shot.predicted[t] + hidden.play * speed(t).signum() + NOISE * noise[t] + late(t)];
            plan.fitted[k].record.joints = (0..40).map(reading).collect();
        }
        let white = ArModel::white(vec![NOISE]).unwrap();
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let library = library(&Situation { plan: &plan, values: &plan.scene_values, free: &[], together: false });
        let accepted: Vec<&Cause> = library.iter().filter(|cause| accepted.contains(&cause.name)).collect();
        forms(&Bench { plan: &plan, declared: Vec::new(), white }, &fitted, &accepted, &[]).unwrap()
    }

    /// A remainder that is too weak to be found among all hypotheses is found among those about the law of an accepted cause.
    #[test]
    fn the_law_of_an_accepted_cause_is_looked_at_closely() {
        let weak = Swings { damping: 6e-6, ..Swings::default() };
        assert_eq!(of_swings(weak), []);
        assert_eq!(beside_causes(weak, &["joint_stiffness"]), []);
        let found = beside_causes(weak, &["viscous_friction"]);
        assert!(found.len() == 1 && found[0].what.starts_with("a torque at `pivot` that depends on the velocity"), "{found:?}");
        assert_eq!(beside_causes(Swings::default(), &["viscous_friction", "joint_stiffness"]), []);
    }

    #[test]
    fn a_law_that_is_missing_is_said_in_words() {
        let found = of_swings(Swings { damping: 2e-3, ..Swings::default() });
        assert!(found.iter().any(|f| f.what == "a torque at `pivot` that depends on the velocity like c·v·|v|"), "{found:?}");
        let found = of_swings(Swings { play: 5e-4, ..Swings::default() });
        let play = "an error of the sensor of `position of pivot` that depends on the velocity like c·sign(v)";
        assert_eq!(found.first().map(|f| f.what.as_str()), Some(play), "{found:?}");
    }

    /// Where the residuals are not those of the values, as with sizes that differ from record to record, they are what is looked at.
    #[test]
    fn residuals_are_taken_as_they_are() {
        let plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40], vec![0.7; 40]]).0;
        let white = ArModel::white(vec![NOISE]).unwrap();
        let mut fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        fitted.residuals.iter_mut().flatten().for_each(|r| *r = 0.25 * *r + 1e-3);
        let shots: Vec<Shot> = fitted.records.iter().map(|rec| simulated(&plan, rec, &fitted.values).unwrap()).collect();
        for (rec, left) in as_left(&fitted, &shots).records.iter().zip(&fitted.residuals) {
            let seen = simulated(&plan, rec, &fitted.values).unwrap().residual;
            let miss = seen.iter().zip(left).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(seen.len() == left.len() && miss < 1e-12, "{miss}");
        }
    }

    /// Something that pushes once is said with its record and time; an outlier, to which a push just before it fits too, is not.
    #[test]
    fn a_push_is_told_from_an_outlier() {
        let found = of_swings(Swings { push: 3e-3, ..Swings::default() });
        let said = |f: &&RemainderForm| {
            f.what.starts_with("a torque at `pivot` that pushes for 0.0163 s, 0.1") && f.what.contains("s into run1 (")
        };
        assert!(found.iter().find(said).is_some_and(|f| f.taken > 100.0), "{found:?}");
        assert_eq!(of_swings(Swings { outlier: 8.0 * NOISE, ..Swings::default() }), []);
    }

    /// A push that hardly moves the readings would have to be absurdly large; late ones move them less than early ones, and are felt.
    #[test]
    fn what_is_not_felt_is_no_push() {
        let starts = [0.3, 0.9, -0.5, 1.4, -1.1, 0.6];
        let plan = experiment(&pendulum("measured"), &starts.map(|angle| vec![angle; 40])).0;
        let white = ArModel::white(vec![NOISE]).unwrap();
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let alone =
            Fitted { records: vec![fitted.records[1].clone()], residuals: vec![fitted.residuals[1].clone()], ..fitted.clone() };
        let all = sites(&plan);
        let place = all.iter().flat_map(Site::pushed).next().unwrap();
        let shape = |peak: f64| Shape::Hat { peak, width: 0.0163, first: false, last: false };
        let push = |peak| Form { place, variable: Variable::Time, shape: shape(peak), reversing: false };
        let groups: Vec<Group> = [0.05, 0.2, 0.34].map(|t| Group { forms: vec![push(t)], what: String::new() }).into();
        let mut test = tested(&plan, &alone, &groups, &[], POLICY.push_blocks).unwrap();
        assert_eq!(felt(&test), [true; 3], "{test:?}");
        test[0].std_error[0] *= 1e5;
        assert_eq!(felt(&test), [false, true, true]);
    }

    #[test]
    fn noise_looks_like_nothing() {
        assert_eq!(of_swings(Swings::default()), []);
    }
}
