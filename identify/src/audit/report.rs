//! Findings and noise levels that an audit returns.

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// May bend results: mask, repair or widen the noise.
    Warning,
    /// The record contradicts itself or the others: leave it out or repair it before any physics.
    Faulty,
}

/// Where in a record a finding sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The record as a whole.
    Record,
    /// The time stamps.
    Clock,
    /// A point (marker).
    Point(usize),
    /// One coordinate of a point: point, axis.
    Coordinate(usize, usize),
    /// A pair of points.
    Pair(usize, usize),
    /// An input channel.
    Input(usize),
}

/// One thing found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Number of the record.
    pub record: usize,
    /// Where in it.
    pub place: Place,
    /// When it is worst, or begins (s); none for whole records.
    pub time_s: Option<f64>,
    /// The fault in a few words, with its numbers.
    pub what: String,
    /// The size.
    pub number: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Advice.
    pub advice: &'static str,
}

/// Noise of one record, per channel (points · dimension).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordNoise {
    /// σ per channel from fourth differences [unit of the points]; it bounds the white part of the noise only.
    pub sigma: Vec<f64>,
    /// Quantisation step per channel where the data lie on a grid coarser than their noise or number format.
    pub quantum: Vec<Option<f64>>,
}

/// Findings in the order of records, the worst first within each, and the noise of every record.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct AuditReport {
    /// All findings.
    pub findings: Vec<Finding>,
    /// Per record.
    pub noise: Vec<RecordNoise>,
}

impl AuditReport {
    /// Records with at least one finding of this severity or worse, ascending.
    pub fn records_with(&self, severity: Severity) -> Vec<usize> {
        let mut records: Vec<usize> = self.findings.iter().filter(|f| f.severity >= severity).map(|f| f.record).collect();
        records.sort_unstable();
        records.dedup();
        records
    }

    /// Records that should not enter a fit as they are.
    pub fn faulty_records(&self) -> Vec<usize> {
        self.records_with(Severity::Faulty)
    }

    /// Median over records of σ per channel [unit of the points]: the floor for a noise model. A channel's quantisation
    /// noise Δ/√12 counts where it is larger.
    pub fn noise_floor(&self) -> Vec<f64> {
        let channels = self.noise.first().map_or(0, |n| n.sigma.len());
        let of = |c: usize| {
            let sigma: Vec<f64> = self.noise.iter().map(|n| n.sigma[c]).collect();
            let quantum = self.noise.iter().filter_map(|n| n.quantum[c]).fold(0.0, f64::max);
            super::series::median(&sigma).max(quantum / 12.0_f64.sqrt())
        };
        (0..channels).map(of).collect()
    }

    /// Noise that quantisation makes on every channel, Δ/√12 [unit of the points]; 0 where there is no grid.
    pub(crate) fn grids(&self) -> Vec<f64> {
        let channels = self.noise.first().map_or(0, |n| n.quantum.len());
        let of = |c: usize| self.noise.iter().filter_map(|n| n.quantum[c]).fold(0.0, f64::max) / 12.0_f64.sqrt();
        (0..channels).map(of).collect()
    }

    pub(crate) fn sort(&mut self) {
        self.findings.sort_by(|a, b| a.record.cmp(&b.record).then(b.severity.cmp(&a.severity)).then(a.place.cmp(&b.place)));
    }
}
