//! Joints that the simulation moves many times as far as was read, or that moved many times as far: a unit that is not what it is called.
//!
//! Degrees that were logged in radians are 57 times smaller than they should be; a torque in mN·m that is called N·m is 1000 times larger. A fit
//! finds physics for both: a heavy armature, strong friction.

use super::super::result::AuditFinding;
use super::still::{predicted, readings};
use crate::audit::AUDIT;
use crate::number::number_plain;
use crate::shooting::{Observed, Plan, RecordPlan};

/// Of each sensor at a joint a finding, if the sum over records of the ranges of its readings and of the scene's own simulation differ so much.
pub(in super::super) fn other_units(plan: &Plan) -> Vec<AuditFinding> {
    let simulated: Vec<(&RecordPlan, Vec<f64>)> =
        plan.fitted.iter().filter_map(|rec| Some((rec, predicted(plan, rec)?))).collect();
    let joints = (0..plan.joints.len()).map(Observed::Joint);
    joints.filter_map(|joint| finding(plan, joint, moves(plan, &simulated, joint)?)).collect()
}

/// How far a sensor's readings move in the simulation and as measured, over all records; none where either does not move.
fn moves(plan: &Plan, simulated: &[(&RecordPlan, Vec<f64>)], joint: Observed) -> Option<[f64; 2]> {
    let channel = plan.channels_of(joint).start;
    let of = |(rec, rows): &(&RecordPlan, Vec<f64>)| {
        let read = readings(plan, &rec.record, joint).map(|row| row[0]);
        [range(rows.iter().skip(channel).step_by(plan.channels()).copied()), range(read)]
    };
    let sum = simulated.iter().map(of).fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
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
}
