//! Records unlike the others as a whole: total length, level, speed.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{distance, median, quantile, spread};

/// A number per record, and the finding where one is unlike the others.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    severity: Severity,
    /// Least deviation worth a word, relative to the median.
    least: f64,
    advice: &'static str,
}

const LENGTH: Quantity = Quantity {
    name: "total length",
    unit: "m",
    severity: Severity::Warning,
    least: AUDIT.total_length_least,
    advice: "compare the lengths of its pairs; a wrong scale or a slipped marker changes them",
};
const LEVEL: Quantity = Quantity {
    name: "mean height over its ends",
    unit: "m",
    severity: Severity::Info,
    least: 0.0,
    advice: "another payload, rest shape or frame, or simply another motion",
};
const SPEED: Quantity = Quantity {
    name: "logarithm of the rms speed",
    unit: "ln(m/s)",
    severity: Severity::Info,
    least: 0.0,
    advice: "another kind of motion, or a wrong clock; weigh it when records are compared",
};

pub(super) fn check(records: &[Prepared], out: &mut Vec<Finding>) {
    let Some(layout) = records.first().filter(|_| records.len() >= AUDIT.compared_records).map(|r| r.layout) else { return };
    if !layout.chords.is_empty() {
        unlike(records, &LENGTH, total_length, out);
        if let Some(axis) = layout.vertical.filter(|a| *a < layout.dimension) {
            unlike(records, &LEVEL, |r| level(r, axis), out);
        }
    }
    unlike(records, &SPEED, |r| rms_speed(r).max(f64::MIN_POSITIVE).ln(), out);
}

fn unlike(records: &[Prepared], quantity: &Quantity, of: impl Fn(&Prepared) -> f64, out: &mut Vec<Finding>) {
    let values: Vec<f64> = records.iter().map(of).collect();
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let (center, scale) = (median(&finite), spread(&finite));
    for (record, value) in records.iter().zip(&values) {
        let off = value - center;
        if scale > 0.0 && off.abs() > AUDIT.unlike * scale && off.abs() > quantity.least * center.abs() {
            out.push(Finding {
                severity: quantity.severity,
                record: record.index,
                place: Place::Record,
                time_s: None,
                what: format!(
                    "{} {value:.4} where the other records have {center:.4} (robust z {:+.1})",
                    quantity.name,
                    off / scale
                ),
                number: off,
                unit: quantity.unit,
                advice: quantity.advice,
            });
        }
    }
}

/// 90 % quantile of the sum of chords; NaN where all points were hardly ever seen together.
fn total_length(record: &Prepared) -> f64 {
    let sum = |t: usize| record.layout.chords.iter().map(|&(a, b)| distance(record.point(t, a), record.point(t, b))).sum::<f64>();
    let all_seen = |t: &usize| (0..record.layout.points).all(|p| !record.missing_near(*t, p, 0));
    let seen: Vec<usize> = (0..record.times()).filter(all_seen).collect();
    if seen.len() < record.times().div_ceil(AUDIT.hardly_seen) {
        return f64::NAN;
    }
    quantile(&seen.into_iter().map(sum).collect::<Vec<_>>(), AUDIT.straight)
}

/// Mean over time and points of the height over the mean of the first and last point.
fn level(record: &Prepared, axis: usize) -> f64 {
    let n = record.layout.points;
    let at = |t: usize| {
        let ends = 0.5 * (record.point(t, 0)[axis] + record.point(t, n - 1)[axis]);
        (0..n).map(|p| record.point(t, p)[axis]).sum::<f64>() / n as f64 - ends
    };
    (0..record.times()).map(at).sum::<f64>() / record.times().max(1) as f64
}

fn rms_speed(record: &Prepared) -> f64 {
    let n = record.layout.points;
    let steps = (1..record.times()).flat_map(|t| (0..n).map(move |p| (t, p)));
    let squares: f64 = steps.map(|(t, p)| distance(record.point(t, p), record.point(t - 1, p)).powi(2)).sum();
    let count = (record.times().saturating_sub(1) * n).max(1) as f64;
    let interval = record.interval();
    if interval > 0.0 { (squares / count).sqrt() / interval } else { 0.0 }
}
