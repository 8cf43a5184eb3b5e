//! Step 0: the raw records.

use super::result::AuditFinding;
use crate::audit::{AuditReport, Layout, RawRecord, audit};
use crate::error::IdentifyError;
use crate::log::Logs;
use crate::shoot::Plan;

/// Findings in words, and the median noise of all channels [m].
pub(super) fn check(logs: &Logs) -> Result<(Vec<AuditFinding>, f64, AuditReport), IdentifyError> {
    let first = &logs.records[0];
    let layout = Layout::rope(first.markers[0].len(), first.inputs[0].len());
    let points: Vec<Vec<f64>> = logs.records.iter().map(|r| r.markers.iter().flatten().flatten().copied().collect()).collect();
    let inputs: Vec<Vec<f64>> = logs.records.iter().map(|r| r.inputs.concat()).collect();
    let raw: Vec<RawRecord> = logs
        .records
        .iter()
        .zip(points.iter().zip(&inputs))
        .map(|(r, (points, inputs))| RawRecord { time: &r.time, points, inputs })
        .collect();
    let report = audit(&raw, &layout).map_err(|e| IdentifyError::Input(e.to_string()))?;
    let findings = report.findings.iter().map(|f| AuditFinding {
        severity: format!("{:?}", f.severity).to_lowercase(),
        record: logs.records[f.record].name.clone(),
        place: format!("{:?}", f.place),
        time_s: f.time_s,
        what: f.what.clone(),
        number: f.number,
        unit: f.unit.to_owned(),
        advice: f.advice.to_owned(),
    });
    let mut sigmas: Vec<f64> = report.noise.iter().flat_map(|n| n.sigma.iter().copied()).filter(|s| s.is_finite()).collect();
    sigmas.sort_by(f64::total_cmp);
    let median = sigmas.get(sigmas.len() / 2).copied().unwrap_or(0.0);
    Ok((findings.collect(), median, report))
}

/// Markers on nodes that a gripper holds: they measure it, and nothing about the rope.
pub(super) fn held_markers(plan: &Plan) -> Vec<AuditFinding> {
    let held = |node: usize| plan.model.driven()[node];
    let rope = |node: usize| plan.model.ropes().iter().find(|rope| rope.nodes.contains(&node));
    let on_held = plan.markers.iter().enumerate().filter(|(_, m)| held(m.node) && held(m.next));
    let finding = |(k, marker): (usize, &crate::shoot::MarkerPlace)| AuditFinding {
        severity: "info".to_owned(),
        record: String::new(),
        place: format!("Point({k})"),
        time_s: None,
        what: match rope(marker.node) {
            Some(rope) => {
                format!("marker {k} is on node {} of \"{}\", which a gripper holds", marker.node - rope.nodes.start, rope.name)
            }
            None => format!("marker {k} is on a node that a gripper holds"),
        },
        number: 0.0,
        unit: String::new(),
        advice: "it shows the gripper's and the sensor's errors, not the rope; correct `node` if a free one was meant".to_owned(),
    };
    on_held.map(finding).collect()
}
