//! Joints that the simulation moves many times as far as was read, or that moved many times as far: a unit that is not what it is called.
//!
//! Degrees that were logged in radians are 57 times smaller than they should be; a torque in mN·m that is called N·m is 1000 times larger. A fit
//! finds physics for both: a heavy armature, strong friction.

use super::super::result::AuditFinding;
use super::still::{predicted, readings};
use crate::audit::AUDIT;
use crate::fit::growth;
use crate::number::number_plain;
use crate::shooting::{Observed, Plan, RecordPlan};

/// Of each sensor at a joint a finding, if the sum over records of the ranges of its readings and of the scene's own simulation differ so much,
/// and do so before a disturbance has grown e-fold: an unstable plant, a pole that a controller balanced, falls in a simulation of its own.
pub(in super::super) fn other_units(plan: &Plan) -> Vec<AuditFinding> {
    let simulated: Vec<(&RecordPlan, Vec<f64>)> =
        plan.fitted.iter().filter_map(|rec| Some((rec, predicted(plan, rec)?))).collect();
    let told = |seconds: &[f64]| -> Vec<AuditFinding> {
        let joints = (0..plan.joints.len()).map(Observed::Joint);
        joints.filter_map(|joint| finding(plan, joint, moves(plan, &simulated, seconds, joint)?)).collect()
    };
    let over_all = told(&vec![f64::INFINITY; simulated.len()]);
    if over_all.is_empty() {
        return over_all;
    }
    let known = |rec: &RecordPlan| {
        let grown = growth(plan, rec, &plan.scene_values).ok()?;
        Some(rec.record.duration() / grown.ln().max(1.0))
    };
    let at_first = told(&simulated.iter().map(|(rec, _)| known(rec).unwrap_or(0.0)).collect::<Vec<_>>());
    let still = |finding: &AuditFinding| {
        at_first.iter().any(|other| other.place == finding.place && (other.number > 1.0) == (finding.number > 1.0))
    };
    over_all.into_iter().filter(still).collect()
}

/// How far a sensor's readings move in the simulation and as measured, over all records for so many seconds each; none where either does not move.
fn moves(plan: &Plan, simulated: &[(&RecordPlan, Vec<f64>)], seconds: &[f64], joint: Observed) -> Option<[f64; 2]> {
    let channel = plan.channels_of(joint).start;
    let of = |((rec, rows), seconds): (&(&RecordPlan, Vec<f64>), &f64)| {
        let samples = rec.record.time.partition_point(|t| t <= seconds);
        let read = readings(plan, &rec.record, joint).map(|row| row[0]);
        let simulated = rows.iter().skip(channel).step_by(plan.channels()).copied();
        [range(simulated.take(samples)), range(read.take(samples))]
    };
    let sum = simulated.iter().zip(seconds).map(of).fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
    (sum[0] > 0.0 && sum[1] > 0.0).then_some(sum)
}

fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.filter(|x| x.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    (high - low).max(0.0)
}

fn finding(plan: &Plan, joint: Observed, [simulated, read]: [f64; 2]) -> Option<AuditFinding> {
    let times = simulated / read;
    let two = [times, 1.0 / times].map(|x| number_plain(x.round()));
    let what = match times {
        x if x > AUDIT.other_unit => format!("the scene's own simulation moves it {} times as far as was read", two[0]),
        x if x < 1.0 / AUDIT.other_unit => {
            format!("it was read to move {} times as far as in the scene's own simulation", two[1])
        }
        _ => return None,
    };
    Some(AuditFinding {
        severity: "warning".to_owned(),
        record: String::new(),
        place: plan.name_of(joint),
        time_s: None,
        what,
        number: times,
        unit: String::new(),
        advice: "check the units of its column (1 rad is 57.3 deg) and of the commands that move it (1 N·m is 1000 mN·m) before any physics"
            .to_owned(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::starts::tests::{experiment, pendulum, plan_of};
    use super::*;

    /// A torque of 1 N·m turns the pendulum, of 0.046 kg·m², by about 1 rad in 0.4 s.
    #[test]
    fn a_torque_in_another_unit_is_told() {
        let read = |size: f64| -> Vec<f64> { (0..40).map(|k| size * (f64::from(k) / 40.0).powi(2)).collect() };
        let found = |size: f64| {
            let mut records = experiment(&pendulum("measured"), &[read(size), read(size)]).1.records;
            records.iter_mut().for_each(|record| record.inputs.fill(vec![1.0]));
            other_units(&plan_of(&pendulum("measured"), records).0)
        };
        assert!(found(1.0).is_empty(), "what another inertia does is no other unit");
        let told = found(1.6e-3);
        assert!(told.len() == 1 && told[0].what.contains("simulation moves it") && told[0].number > 500.0, "{told:?}");
        let told = found(1.6e3);
        assert!(told.len() == 1 && told[0].what.contains("was read to move"), "{told:?}");
    }

    /// A pole that stands on its joint, balanced to a milliradian, falls by itself: that is no other unit.
    #[test]
    fn an_unstable_plant_falls_by_itself() {
        let text = pendulum("measured")
            .replace("center_of_mass = [0, 0, -0.3]", "center_of_mass = [0, 0, 0.3]")
            .replace("inertia = [1e-3, 1e-3, 1e-3", "inertia = [1e-5, 1e-5, 1e-5");
        let balanced = |k: usize| -> Vec<f64> { (0..40).map(|t| 1e-3 * (0.8 * f64::from(t) + k as f64).sin()).collect() };
        let (plan, _) = experiment(&text, &[balanced(0), balanced(1), balanced(2)]);
        let simulated: Vec<(&RecordPlan, Vec<f64>)> =
            plan.fitted.iter().map(|rec| (rec, predicted(&plan, rec).unwrap())).collect();
        let [fallen, read] = moves(&plan, &simulated, &[f64::INFINITY; 2], Observed::Joint(0)).unwrap();
        assert!(fallen > AUDIT.other_unit * read, "{fallen} {read}");
        assert!(other_units(&plan).is_empty());
    }
}
