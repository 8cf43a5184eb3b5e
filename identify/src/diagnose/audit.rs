//! Step 0: the raw records.

use super::result::AuditFinding;
use crate::audit::{AuditReport, Layout, RawRecord, audit};
use crate::error::IdentifyError;
use crate::log::Logs;

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
