//! Hypotheses about the remainder: a force or an error of a sensor that is a function of one variable.
//!
//! Of every joint a force f(x), and of its sensor an error e(x), are tried, with x the time, the position or the velocity: powers, waves of the
//! position, friction whose size depends on the position or on the time, and any function at all, as a sum of hats over the range that the
//! records visit; and of every joint a push, for a moment of one record. Each is a score test at the final model, with everything fitted and the
//! simulation's own errors projected off. They decide whether something is left, and are hypotheses about what it is: no names.

use super::numerics::{Shift, changes};
use super::policy::{Blocks, POLICY};
use super::procedure::{Bench, Coarse};
use super::result::RemainderForm;
use super::scores::reduce_beside;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::form::{Form, Place, Shape, Variable};
use crate::log::JointQuantity;
use crate::number::{number_plain, quantity_plain};
use crate::shooting::{Plan, RecordPlan, Shot, ShotWants, shoot};
use crate::stats::dist::chi2_sf;
use crate::stats::score::{Candidate, CandidateScore, ScoreOptions, Sign, score_test};
use crate::unknown::{Unknown, Values};
use pliant_engine::bodies::{Joint, JointKind};
use rayon::prelude::*;

/// Powers and sizes of a variable, each with whether it reverses and how it is said.
const SINGLE: [(Variable, Shape, bool, &str); 10] = [
    (Variable::Time, Shape::Power(1), false, "grows with the time, like c·t"),
    (Variable::Time, Shape::Power(1), true, "turns over with the velocity and grows with the time, like c·t·sign(v)"),
    (Variable::Position, Shape::Power(2), false, "depends on the position like c·q²"),
    (Variable::Position, Shape::Power(3), false, "depends on the position like c·q³"),
    (Variable::Position, Shape::Size, false, "depends on the position like c·|q|"),
    (Variable::Position, Shape::Size, true, "turns over with the velocity and grows with the position, like c·|q|·sign(v)"),
    (Variable::Velocity, Shape::Power(0), true, "depends on the velocity like c·sign(v)"),
    (Variable::Velocity, Shape::Power(2), false, "depends on the velocity like c·v²"),
    (Variable::Velocity, Shape::Power(2), true, "depends on the velocity like c·v·|v|"),
    (Variable::Velocity, Shape::Power(3), false, "depends on the velocity like c·v³"),
];

/// A hypothesis: several forms of one place and variable.
struct Group {
    forms: Vec<Form>,
    what: String,
}

/// A joint, and its sensors by number.
struct Site<'a> {
    joint: &'a Joint,
    sensors: Vec<usize>,
}

/// The hypotheses that are significant, most significant first. `fitted` may have residuals that are not those of its values alone.
pub(super) fn forms(bench: &Bench, fitted: &Fitted, shifts: &[Shift]) -> Result<Vec<RemainderForm>, IdentifyError> {
    let coarse = Coarse::of(bench, fitted)?;
    let plan = &coarse.plan;
    let shots: Vec<Shot> =
        coarse.fitted.records.par_iter().map(|rec| simulated(plan, rec, &coarse.fitted.values)).collect::<Result<_, _>>()?;
    let fitted = as_left(&coarse.fitted, &shots);
    let (mut out, mut tests) = (Vec::new(), 0);
    for site in sites(plan) {
        let Some(ranges) = Ranges::new(plan, &fitted.records, &shots, site.joint) else { continue };
        let groups = groups(&site, &ranges);
        let test = tested(plan, &fitted, &groups, &changes(shifts), POLICY.constancy_blocks)?;
        // what hangs on a few stretches of the records, as on an outlier at the end of a range, has no robust error
        let robust = |(_, s): &(&Group, &CandidateScore)| s.rank > 0 && s.p_blocks.is_some();
        let robust: Vec<(&Group, &CandidateScore)> = groups.iter().zip(&test).filter(robust).collect();
        tests += robust.len();
        out.extend(robust.into_iter().map(|(group, score)| told(plan, &site, group, score)));
    }
    out.retain(|form| form.p * (tests as f64) < POLICY.form_level);
    let (pushes, tests) = pushes(plan, &fitted, &changes(shifts))?;
    out.extend(pushes.into_iter().filter(|push| push.p * (tests as f64) < POLICY.push_level));
    out.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.taken.total_cmp(&a.taken)));
    Ok(out)
}

/// Pushes: a force at a joint for a moment of one record. Of every record and joint the most significant one, and how many were tried.
fn pushes(plan: &Plan, fitted: &Fitted, changes: &[&[Vec<f64>]]) -> Result<(Vec<RemainderForm>, usize), IdentifyError> {
    let sites = sites(plan);
    let pairs: Vec<(usize, &Site)> = (0..fitted.records.len()).flat_map(|r| sites.iter().map(move |site| (r, site))).collect();
    let tried = |(r, site): &(usize, &Site)| pushes_of(plan, fitted, changes, *r, site);
    let tried: Vec<Vec<RemainderForm>> = pairs.par_iter().map(tried).collect::<Result<_, _>>()?;
    let number = tried.iter().map(Vec::len).sum();
    let strongest = |all: Vec<RemainderForm>| all.into_iter().min_by(|a, b| a.p.total_cmp(&b.p));
    Ok((tried.into_iter().filter_map(strongest).collect(), number))
}

/// Those of one record and joint: a hat over each part of the record's time.
fn pushes_of(
    plan: &Plan,
    fitted: &Fitted,
    changes: &[&[Vec<f64>]],
    r: usize,
    site: &Site,
) -> Result<Vec<RemainderForm>, IdentifyError> {
    let rec = &fitted.records[r];
    let alone = Fitted { records: vec![rec.clone()], residuals: vec![fitted.residuals[r].clone()], ..fitted.clone() };
    let changes: Vec<&[Vec<f64>]> = changes.iter().map(|change| &change[r..=r]).collect();
    let width = rec.record.time.last().copied().unwrap_or(0.0) / POLICY.push_parts as f64;
    let place = Place::Force { q: site.joint.q, v: site.joint.v };
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
        let form = told(plan, site, group, score);
        RemainderForm { p: chi2_sf(score.lm_without_any, 1.0), ..form }
    };
    Ok(groups.iter().zip(&test).filter(|(_, score)| score.rank > 0).map(told).collect())
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

/// The joints with one degree of freedom.
fn sites(plan: &Plan) -> Vec<Site<'_>> {
    fn of<'a>(plan: &Plan, joint: &'a Joint) -> Site<'a> {
        let own = |k: &usize| plan.joints[*k].v == joint.v && plan.joints[*k].quantity != JointQuantity::Torque;
        Site { joint, sensors: (0..plan.joints.len()).filter(own).collect() }
    }
    plan.model.tree().joints().iter().filter(|joint| joint.kind != JointKind::Ball).map(|joint| of(plan, joint)).collect()
}

/// Ranges of the variables that the records visit.
struct Ranges {
    time: [f64; 2],
    position: [f64; 2],
    velocity: [f64; 2],
}

impl Ranges {
    /// None of a joint that does not move.
    fn new(plan: &Plan, records: &[RecordPlan], shots: &[Shot], joint: &Joint) -> Option<Self> {
        let (mut q, mut v, mut time) = (Vec::new(), Vec::new(), 0.0f64);
        let first = plan.model.n_node_dofs();
        for (rec, shot) in records.iter().zip(shots) {
            q.extend(shot.states.iter().map(|x| x.q[first + joint.q]));
            v.extend(shot.states.iter().map(|x| x.v[first + joint.v]));
            time = time.max(rec.record.time.last().copied().unwrap_or(0.0));
        }
        let inner = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            let at = |part: f64| all.get((all.len().saturating_sub(1) as f64 * part) as usize).copied().unwrap_or(0.0);
            [at(POLICY.form_range), at(1.0 - POLICY.form_range)]
        };
        let out = Self { time: [0.0, time], position: inner(q), velocity: inner(v) };
        let wide = |[low, high]: [f64; 2]| high > low;
        [out.time, out.position, out.velocity].into_iter().all(wide).then_some(out)
    }
}

/// Any function over a range, as a sum of hats.
fn hats([low, high]: [f64; 2], place: Place, variable: Variable, reversing: bool) -> Vec<Form> {
    let (last, width) = (POLICY.form_hats - 1, (high - low) / (POLICY.form_hats - 1) as f64);
    let hat = |k: usize| Shape::Hat { peak: low + k as f64 * width, width, first: k == 0, last: k == last };
    (0..=last).map(|k| Form { place, variable, shape: hat(k), reversing }).collect()
}

/// The hypotheses of a joint.
fn groups(site: &Site, ranges: &Ranges) -> Vec<Group> {
    let mut out = Vec::new();
    let (q, v) = (site.joint.q, site.joint.v);
    for place in std::iter::once(Place::Force { q, v }).chain(site.sensors.iter().map(|k| Place::Reading(*k))) {
        let mut add = |forms, what: &str| out.push(Group { forms, what: what.to_owned() });
        for (variable, shape, reversing, what) in SINGLE {
            add(vec![Form { place, variable, shape, reversing }], what);
        }
        add(hats(ranges.time, place, Variable::Time, false), "depends on the time");
        add(hats(ranges.position, place, Variable::Position, false), "depends on the position");
        add(hats(ranges.velocity, place, Variable::Velocity, false), "depends on the velocity");
        add(hats(ranges.position, place, Variable::Position, true), "turns over with the velocity and depends on the position");
        add(hats(ranges.time, place, Variable::Time, true), "turns over with the velocity and depends on the time");
        let [low, high] = ranges.position;
        let kinds = [(false, ""), (true, "turns over with the velocity and ")];
        for (waves, (reversing, turns)) in POLICY.form_waves.into_iter().flat_map(|waves| kinds.map(|kind| (waves, kind))) {
            let period = (high - low) / waves;
            let k = std::f64::consts::TAU / period;
            let wave = |shape| Form { place, variable: Variable::Position, shape, reversing };
            let what = format!("{turns}repeats every {} of the position", quantity_plain(period, length(site.joint)));
            add(vec![wave(Shape::Sine(k)), wave(Shape::Cosine(k))], &what);
        }
    }
    out
}

/// Unit of a joint's coordinate.
fn length(joint: &Joint) -> &'static str {
    if joint.kind == JointKind::Prismatic { "m" } else { "rad" }
}

fn told(plan: &Plan, site: &Site, group: &Group, score: &CandidateScore) -> RemainderForm {
    let form = &group.forms[0];
    let (object, of, unit) = match form.place {
        Place::Force { .. } if site.joint.kind == JointKind::Prismatic => (site.joint.name.clone(), "a force at", "N"),
        Place::Force { .. } => (site.joint.name.clone(), "a torque at", "N·m"),
        Place::Reading(k) => (plan.joints[k].name.clone(), "an error of the sensor of", plan.joints[k].unit),
    };
    let coordinate = length(site.joint);
    let variable = match form.variable {
        Variable::Time => "s".to_owned(),
        Variable::Position => coordinate.to_owned(),
        Variable::Velocity => format!("{coordinate}/s"),
    };
    let values = group.forms.iter().zip(&score.theta).filter_map(|(form, size)| match form.shape {
        Shape::Hat { peak, .. } => Some([peak, *size]),
        _ => None,
    });
    let values: Vec<[f64; 2]> = values.collect();
    let ends = |by: fn(&&[f64; 2], &&[f64; 2]) -> std::cmp::Ordering| values.iter().min_by(by);
    let (least, most) = (ends(|a, b| a[1].total_cmp(&b[1])), ends(|a, b| b[1].total_cmp(&a[1])));
    let at = |[x, y]: &[f64; 2]| format!("{} {unit} at {} {variable}", number_plain(*y), number_plain(*x));
    let range = match (values.as_slice(), least, most) {
        ([[_, size]], ..) => format!(" ({})", quantity_plain(*size, unit)),
        (_, Some(a), Some(b)) => format!(" ({} to {})", at(a), at(b)),
        _ => String::new(),
    };
    RemainderForm {
        what: format!("{of} `{object}` that {}{range}", group.what),
        object,
        taken: score.lm,
        numbers: score.rank,
        p: score.p,
        unit: unit.to_owned(),
        variable_unit: variable,
        values,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
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
        forms(&Bench { plan: &plan, declared: Vec::new(), white }, &fitted, &[]).unwrap()
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

    #[test]
    fn noise_looks_like_nothing() {
        assert_eq!(of_swings(Swings::default()), []);
    }
}
