//! Step 0: the raw records.

pub(super) mod contradictions;
pub(super) mod scale;
pub(super) mod starts;
pub(super) mod still;

use super::result::AuditFinding;
use crate::audit::{AuditReport, Finding, Layout, Place, RawRecord, audit};
use crate::error::IdentifyError;
use crate::log::{Logs, Lone, LoneSensor, Record, Setup};
use crate::shooting::{NodePair, Observed, Plan};
use pliant_scene::{ActuatorKind, Control};

/// Findings in words, and the noise that quantisation makes on every channel [unit of the channel].
pub(super) fn check(setup: &Setup, plan: &Plan, logs: &Logs) -> Result<(Vec<AuditFinding>, Vec<f64>), IdentifyError> {
    let first = &logs.records[0];
    let controls = setup.controls();
    let mut grids = Vec::new();
    let mut findings = Vec::new();
    let nothing_else = plan.joints.is_empty() && plan.orientations.is_empty();
    if !plan.markers.is_empty() || nothing_else {
        // markers of a sheet have no order in which they are neighbours
        let ropes = plan.model.ropes();
        let on_ropes = plan.markers.iter().all(|m| m.nodes().is_some_and(|m| ropes.iter().any(|r| r.nodes.contains(&m.node))));
        let rope = Layout::rope(first.markers[0].len(), first.inputs[0].len());
        let layout = if on_ropes { rope } else { Layout { chords: Vec::new(), ..rope } };
        let points = |r: &Record| r.markers.iter().flatten().flatten().copied().collect();
        let report = audited(logs, &layout, &points)?;
        findings.extend(report.findings.iter().map(|f| worded(f, logs, &controls, (format!("{:?}", f.place), "m"))));
        if !plan.markers.is_empty() {
            grids.extend(report.grids());
        }
    }
    for (k, sensor) in plan.joints.iter().enumerate() {
        let layout = Layout { dimension: 1, vertical: None, ..Layout::rope(1, first.inputs[0].len()) };
        let report = audited(logs, &layout, &|r: &Record| r.joints.iter().map(|row| row[k]).collect())?;
        // findings on clocks and inputs are those of the first audit
        let again = |f: &Finding| matches!(f.place, Place::Clock | Place::Input(_)) && (k > 0 || !plan.markers.is_empty());
        let own = || (sensor.name.clone(), sensor.unit);
        findings.extend(report.findings.iter().filter(|f| !again(f)).map(|f| worded(f, logs, &controls, own())));
        grids.extend(report.grids());
    }
    findings.extend(logs.records.iter().flat_map(|record| left_out(plan, record)));
    findings.extend(starts::moving(plan));
    grids.resize(plan.channels(), 0.0);
    Ok((findings, grids))
}

fn audited(logs: &Logs, layout: &Layout, read: &dyn Fn(&Record) -> Vec<f64>) -> Result<AuditReport, IdentifyError> {
    let points: Vec<Vec<f64>> = logs.records.iter().map(read).collect();
    let inputs: Vec<Vec<f64>> = logs.records.iter().map(|r| r.inputs.concat()).collect();
    let parts = logs.records.iter().zip(points.iter().zip(&inputs));
    let raw: Vec<RawRecord> = parts.map(|(r, (points, inputs))| RawRecord { time: &r.time, points, inputs }).collect();
    audit(&raw, layout).map_err(|e| IdentifyError::Input(e.to_string()))
}

/// A finding in words: on an input under its own name and unit, on readings at this place; the audit speaks of metres where they are in `unit`.
fn worded(f: &Finding, logs: &Logs, controls: &[Control], (place, unit): (String, &'static str)) -> AuditFinding {
    let (place, unit) = match f.place {
        Place::Input(k) => (controls[k].name.clone(), controls[k].unit),
        _ => (place, unit),
    };
    AuditFinding {
        severity: format!("{:?}", f.severity).to_lowercase(),
        record: logs.records[f.record].name.clone(),
        place,
        time_s: f.time_s,
        what: f.what.clone(),
        number: f.number,
        unit: if f.unit == "m" { unit.to_owned() } else { f.unit.to_owned() },
        advice: f.advice.to_owned(),
    }
}

/// Torque motors whose command is 0 in every sample of every record: a motor that was off, or a torque that nobody logged.
pub(super) fn silent(setup: &Setup, logs: &Logs) -> Vec<AuditFinding> {
    let controls = setup.controls();
    let motors = setup.scene.actuator.iter().filter(|actuator| actuator.kind == ActuatorKind::Torque);
    let is_silent = |k: usize| logs.records.iter().all(|record| record.inputs.iter().all(|row| row[k] == 0.0));
    let of = |name: &String| controls.iter().position(|control| control.name == *name);
    let names = motors.filter(|actuator| of(&actuator.name).is_some_and(is_silent)).map(|actuator| &actuator.name);
    let finding = |name: &String| {
        AuditFinding {
        severity: "warning".to_owned(),
        record: String::new(),
        place: name.clone(),
        time_s: None,
        what: "its command is 0 in every sample of every record".to_owned(),
        number: 0.0,
        unit: String::new(),
        advice: "if the motor was driven, its torque was not logged, and no cause found without it can be trusted; if it was off, all is well"
            .to_owned(),
    }
    };
    names.map(finding).collect()
}

/// Of each sensor the readings of a record that were left out.
fn left_out(plan: &Plan, record: &Record) -> Vec<AuditFinding> {
    let observed = |lone: &Lone| match lone.sensor {
        LoneSensor::Marker(k) => Observed::Marker(k),
        LoneSensor::Joint(k) => Observed::Joint(k),
    };
    let mut sensors: Vec<Observed> = record.left_out.iter().map(observed).collect();
    sensors.dedup();
    let finding = |sensor: Observed| {
        let own: Vec<&Lone> = record.left_out.iter().filter(|lone| observed(lone) == sensor).collect();
        let worst = own.iter().max_by(|a, b| a.size.abs().total_cmp(&b.size.abs()))?;
        Some(AuditFinding {
            severity: "info".to_owned(),
            record: record.name.clone(),
            place: place_of(plan, sensor),
            time_s: Some(worst.time),
            what: format!(
                "lone readings, {} in all, off the curve through their neighbours, were left out; the largest is given",
                own.len()
            ),
            number: worst.size,
            unit: plan.unit_of(sensor).to_owned(),
            advice: "a sensor that does this often is worth a look".to_owned(),
        })
    };
    sensors.into_iter().filter_map(finding).collect()
}

/// Where a finding on something observed sits.
fn place_of(plan: &Plan, observed: Observed) -> String {
    match observed {
        Observed::Marker(k) => format!("Point({k})"),
        Observed::Joint(_) | Observed::Orientation(_) => plan.name_of(observed),
    }
}

/// Markers on nodes that a gripper holds: they measure it, and nothing about the rope or cloth.
pub(super) fn held_markers(plan: &Plan) -> Vec<AuditFinding> {
    let held = |node: usize| plan.model.prescribed()[node];
    let owner = |node: usize| plan.model.node_spans().find(|(_, nodes)| nodes.contains(&node));
    let on_nodes = plan.markers.iter().enumerate().filter_map(|(k, m)| Some((k, m.nodes()?)));
    let on_held = on_nodes.filter(|(_, m)| held(m.node) && held(m.next));
    let finding = |(k, marker): (usize, &NodePair)| AuditFinding {
        severity: "info".to_owned(),
        record: String::new(),
        place: format!("Point({k})"),
        time_s: None,
        what: match owner(marker.node) {
            Some((name, nodes)) => {
                format!("marker {k} is on node {} of \"{name}\", which a gripper holds", marker.node - nodes.start)
            }
            None => format!("marker {k} is on a node that a gripper holds"),
        },
        number: 0.0,
        unit: String::new(),
        advice: "it shows the gripper's and the sensor's errors and nothing else; correct `node` if a free one was meant"
            .to_owned(),
    };
    on_held.map(finding).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::starts::tests::{experiment, pendulum};
    use super::*;
    use pliant_scene::Source;
    use std::path::PathBuf;

    #[test]
    fn a_motor_without_a_torque_in_any_record_is_told() {
        let setup = Setup::from_source(Source::new("scene.toml", pendulum("rest")), PathBuf::new()).unwrap();
        let mut logs = experiment(&pendulum("rest"), &[vec![0.1; 40], vec![0.1; 40]]).1;
        let found = silent(&setup, &logs);
        assert_eq!(found.iter().map(|f| f.place.as_str()).collect::<Vec<_>>(), ["motor"]);
        logs.records[1].inputs[3][0] = 0.1;
        assert!(silent(&setup, &logs).is_empty());
    }

    #[test]
    fn what_is_found_on_an_input_has_its_name() {
        let setup = Setup::from_source(Source::new("scene.toml", pendulum("rest")), PathBuf::new()).unwrap();
        let (plan, mut logs) = experiment(&pendulum("rest"), &[vec![0.1; 40], vec![0.1; 40]]);
        logs.records[0].inputs[20][0] = f64::NAN;
        let (found, _) = check(&setup, &plan, &logs).unwrap();
        assert!(found.iter().any(|f| f.place == "motor" && f.what.contains("missing")), "{found:?}");
    }
}
