//! Step 0: the raw records.

pub(super) mod contradictions;
pub(super) mod starts;
pub(super) mod still;

use super::result::AuditFinding;
use crate::audit::{AuditReport, Finding, Layout, Place, RawRecord, audit};
use crate::error::IdentifyError;
use crate::log::{Logs, Lone, LoneSensor, Record};
use crate::shooting::{NodePair, Observed, Plan};

/// Findings in words, and the noise that quantisation makes on every channel [unit of the channel].
pub(super) fn check(plan: &Plan, logs: &Logs) -> Result<(Vec<AuditFinding>, Vec<f64>), IdentifyError> {
    let first = &logs.records[0];
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
        findings.extend(report.findings.iter().map(|f| worded(f, logs, format!("{:?}", f.place), "m")));
        if !plan.markers.is_empty() {
            grids.extend(report.grids());
        }
    }
    for (k, sensor) in plan.joints.iter().enumerate() {
        let layout = Layout { dimension: 1, vertical: None, ..Layout::rope(1, first.inputs[0].len()) };
        let report = audited(logs, &layout, &|r: &Record| r.joints.iter().map(|row| row[k]).collect())?;
        // findings on clocks and inputs are those of the first audit
        let again = |f: &Finding| matches!(f.place, Place::Clock | Place::Input(_)) && (k > 0 || !plan.markers.is_empty());
        let own = |f: &Finding| if matches!(f.place, Place::Input(_)) { format!("{:?}", f.place) } else { sensor.name.clone() };
        findings.extend(report.findings.iter().filter(|f| !again(f)).map(|f| worded(f, logs, own(f), sensor.unit)));
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

/// A finding in words; the audit speaks of metres where the readings are in `unit`.
fn worded(f: &Finding, logs: &Logs, place: String, unit: &str) -> AuditFinding {
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
