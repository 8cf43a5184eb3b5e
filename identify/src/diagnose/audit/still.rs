//! Sensors that read the same number in every sample of a record, where the simulation moves them.
//!
//! A channel that is dead and a joint that is blocked look alike, and no force can be told from either. A record in which one sensor stands
//! still is left out of the diagnosis; where that leaves none, there is nothing to diagnose. What the simulation does not move may stand
//! still: a marker at a fixed end, a joint that no command reaches, a pose that was logged as one reading.

use super::super::result::AuditFinding;
use super::place_of;
use crate::audit::AUDIT;
use crate::log::{Logs, Record, Role};
use crate::number::{number_plain, quantity_plain};
use crate::shooting::{Observed, Plan, RecordPlan, ShotWants, shoot};

/// A sensor that stands still in a record.
#[derive(Clone, Copy, Debug)]
struct Stuck {
    /// Number of the record in the logs.
    record: usize,
    observed: Observed,
    /// Range of its simulated readings [unit of the sensor]; none where the simulation does not move it either, but in other records in
    /// which it reads the same.
    moves: Option<f64>,
}

/// All of an experiment, in the order of its records.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Still {
    stuck: Vec<Stuck>,
}

impl Still {
    /// `grids`: the noise that quantization makes on every channel.
    pub fn of(plan: &Plan, logs: &Logs, grids: &[f64]) -> Self {
        let mut counts = [0; 2];
        let mut still = Vec::new();
        for (number, record) in logs.records.iter().enumerate() {
            let held_out = record.role == Role::HeldOut;
            let (parts, count) = if held_out { (&plan.held_out, &mut counts[1]) } else { (&plan.fitted, &mut counts[0]) };
            let own: Vec<&RecordPlan> = parts.iter().filter(|rec| rec.parent == *count).collect();
            *count += 1;
            let constant: Vec<Observed> = plan.observed().into_iter().filter(|o| is_constant(plan, record, *o)).collect();
            if constant.is_empty() {
                continue;
            }
            let simulated: Vec<Vec<f64>> = own.iter().filter_map(|rec| predicted(plan, rec)).collect();
            let one = |observed: Observed| Stuck { record: number, observed, moves: moved(plan, &simulated, observed, grids) };
            still.extend(constant.into_iter().map(one));
        }
        let reads = |stuck: &Stuck| first(plan, &logs.records[stuck.record], stuck.observed);
        let alike = |a: &Stuck, b: &Stuck| a.observed == b.observed && reads(a) == reads(b);
        let is_stuck = |a: &&Stuck| still.iter().any(|b| b.moves.is_some() && alike(a, b));
        Self { stuck: still.iter().filter(is_stuck).copied().collect() }
    }

    /// A finding for each.
    pub fn findings(&self, plan: &Plan, logs: &Logs) -> Vec<AuditFinding> {
        let one = |stuck: &Stuck| AuditFinding {
            severity: "faulty".to_owned(),
            record: logs.records[stuck.record].name.clone(),
            place: place_of(plan, stuck.observed),
            time_s: None,
            what: says(plan, logs, stuck, "of the record"),
            number: stuck.moves.unwrap_or(0.0),
            unit: plan.unit_of(stuck.observed).to_owned(),
            advice: if self.nothing_left(logs) {
                "check its column and the sensor's connection, or leave it out of the experiment".to_owned()
            } else {
                "this record was left out; check the sensor's column and connection in it".to_owned()
            },
        };
        self.stuck.iter().map(one).collect()
    }

    /// The logs without these records; none where there is nothing to leave out, or nothing would be left to fit.
    pub fn others(&self, logs: &Logs) -> Option<Logs> {
        let none = self.stuck.is_empty() || self.nothing_left(logs);
        let kept = |(number, record): (usize, &Record)| (!self.has(number)).then(|| record.clone());
        (!none).then(|| Logs { records: logs.records.iter().enumerate().filter_map(kept).collect(), split: logs.split })
    }

    /// Why nothing can be diagnosed, if every fitted record has a sensor that stands still.
    pub fn reason(&self, plan: &Plan, logs: &Logs) -> Option<String> {
        let moves = |stuck: &Stuck| stuck.moves.unwrap_or(0.0);
        let most = self.stuck.iter().max_by(|a, b| moves(a).total_cmp(&moves(b)))?;
        self.nothing_left(logs).then(|| {
            format!(
                "{}: a dead channel and a joint that is blocked look alike, and no force can be told from either. Check its column and \
                 the sensor's connection, or leave it out of the experiment",
                says(plan, logs, most, "of the fitted records")
            )
        })
    }

    fn has(&self, record: usize) -> bool {
        self.stuck.iter().any(|stuck| stuck.record == record)
    }

    fn nothing_left(&self, logs: &Logs) -> bool {
        logs.records.iter().enumerate().all(|(number, record)| record.role != Role::Fit || self.has(number))
    }
}

fn says(plan: &Plan, logs: &Logs, stuck: &Stuck, of: &str) -> String {
    let record = &logs.records[stuck.record];
    let reads: Vec<String> = first(plan, record, stuck.observed).iter().map(|x| number_plain(*x)).collect();
    let (name, unit) = (plan.name_of(stuck.observed), plan.unit_of(stuck.observed));
    let where_moved = match stuck.moves {
        Some(moves) => format!("where the simulation moves it by {}", quantity_plain(moves, unit)),
        None => "as in records where the simulation moves it".to_owned(),
    };
    format!("{name} reads exactly {} in every sample {of}, {where_moved}", reads.join(", "))
}

/// Readings of a sensor in a record, without those that are missing.
pub(super) fn readings(plan: &Plan, record: &Record, observed: Observed) -> impl Iterator<Item = Vec<f64>> {
    let samples = 0..record.time.len();
    samples.map(move |k| plan.measured(record, k, observed)).filter(|row| row.iter().all(|x| x.is_finite()))
}

fn first(plan: &Plan, record: &Record, observed: Observed) -> Vec<f64> {
    readings(plan, record, observed).next().unwrap_or_default()
}

fn is_constant(plan: &Plan, record: &Record, observed: Observed) -> bool {
    let mut all = readings(plan, record, observed);
    all.next().is_some_and(|first| all.all(|row| row == first))
}

/// Simulated readings of a record as the scene has it; none where it cannot be simulated.
pub(super) fn predicted(plan: &Plan, rec: &RecordPlan) -> Option<Vec<f64>> {
    Some(shoot(plan, rec, &plan.scene_values, ShotWants::default()).ok()?.predicted)
}

/// The widest range of a sensor's channels in one part of a record, where that is more than noise and grid could hide.
fn moved(plan: &Plan, parts: &[Vec<f64>], observed: Observed, grids: &[f64]) -> Option<f64> {
    let (width, floors) = (plan.channels(), plan.floors());
    let range = |channel: usize| {
        let of = |rows: &Vec<f64>| {
            let seen = || rows.iter().skip(channel).step_by(width).filter(|x| x.is_finite());
            seen().copied().fold(f64::NEG_INFINITY, f64::max) - seen().copied().fold(f64::INFINITY, f64::min)
        };
        let widest = parts.iter().map(of).fold(0.0, f64::max);
        let hidden = AUDIT.still_over_noise * floors[channel].max(grids[channel]).max(AUDIT.still_rounding);
        if widest > hidden { widest } else { 0.0 }
    };
    let widest = plan.channels_of(observed).map(range).fold(0.0, f64::max);
    (widest > 0.0).then_some(widest)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::starts::tests::{experiment, pendulum, plan_of};
    use super::*;

    /// A pendulum of which each record stands at one angle or swings from it; the last is held out.
    fn of(angles: &[(f64, bool)]) -> (Plan, Logs) {
        let one = |(angle, swings): &(f64, bool)| -> Vec<f64> {
            (0..40).map(|k| if *swings { angle * (5.7 * 0.01 * f64::from(k)).cos() } else { *angle }).collect()
        };
        experiment(&pendulum("measured"), &angles.iter().map(one).collect::<Vec<_>>())
    }

    fn still(plan: &Plan, logs: &Logs) -> Still {
        Still::of(plan, logs, &vec![0.0; plan.channels()])
    }

    #[test]
    fn a_record_with_a_sensor_that_stands_still_is_left_out() {
        let (plan, logs) = of(&[(0.3, true), (0.2, false), (0.2, true), (0.1, true)]);
        let still = still(&plan, &logs);
        let found = still.findings(&plan, &logs);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].record.as_str(), found[0].severity.as_str()), ("run1", "faulty"));
        let says = "position of pivot reads exactly 0.2 in every sample of the record, where the simulation moves it by ";
        assert!(found[0].what.starts_with(says), "{}", found[0].what);
        let left: Vec<String> = still.others(&logs).unwrap().records.iter().map(|record| record.name.clone()).collect();
        assert_eq!(left, ["run0", "run2", "run3"]);
        assert_eq!(still.reason(&plan, &logs), None);
    }

    #[test]
    fn a_held_out_record_is_left_out_as_well() {
        let (plan, logs) = of(&[(0.3, true), (0.2, false)]);
        let left = still(&plan, &logs).others(&logs).unwrap();
        assert_eq!((left.records.len(), left.records[0].role), (1, Role::Fit));
    }

    #[test]
    fn nothing_is_diagnosed_where_every_fitted_record_has_one() {
        let (plan, logs) = of(&[(0.3, false), (0.2, false), (0.1, true)]);
        let still = still(&plan, &logs);
        assert!(still.others(&logs).is_none());
        assert!(still.reason(&plan, &logs).unwrap().contains("reads exactly 0.3 in every sample of the fitted records"));
    }

    #[test]
    fn a_dead_channel_is_dead_where_nothing_would_move_it_as_well() {
        let mut logs = of(&[(0.0, false), (0.0, false), (0.1, true)]).1;
        logs.records[0].inputs.iter_mut().for_each(|u| u[0] = 0.5);
        let (plan, logs) = plan_of(&pendulum("measured"), logs.records);
        let still = still(&plan, &logs);
        let said: Vec<String> = still.findings(&plan, &logs).into_iter().map(|f| f.what).collect();
        assert!(said.len() == 2 && said[1].ends_with("as in records where the simulation moves it"), "{said:?}");
        assert!(still.reason(&plan, &logs).is_some());
    }

    #[test]
    fn what_the_simulation_does_not_move_may_stand_still() {
        let (plan, logs) = of(&[(0.0, false), (0.0, false)]);
        let none = still(&plan, &logs);
        assert!(none.findings(&plan, &logs).is_empty() && none.others(&logs).is_none() && none.reason(&plan, &logs).is_none());
        // nor is a motion seen that a coarse encoder rounds away
        let (plan, logs) = of(&[(0.01, false), (0.01, false)]);
        assert!(!still(&plan, &logs).stuck.is_empty());
        assert!(Still::of(&plan, &logs, &vec![0.01; plan.channels()]).stuck.is_empty());
    }
}
