//! Lengths that should not change: within a record, and from record to record.
//!
//! The chord between neighbours on a rope shortens when the rope bends but never exceeds the arc, so its upper quantile
//! (90 %) is nearly the arc and nearly the same in all records; where it is not, a marker has moved along the rope, been
//! exchanged or been clamped elsewhere.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{median, quantile, spread};

pub(super) fn check_within(record: &Prepared, out: &mut Vec<Finding>) {
    for &pair in record.layout.chords.iter().filter(|p| !record.layout.rigid.contains(p)) {
        step(record, pair, AUDIT.step_flexible, out);
    }
    for &pair in &record.layout.rigid {
        step(record, pair, AUDIT.step_rigid, out);
        drifts(record, pair, out);
    }
}

/// A lasting step: medians over windows on both sides differ by `relative` of the length and `typical` ordinary differences.
fn step(record: &Prepared, pair: (usize, usize), (relative, typical): (f64, f64), out: &mut Vec<Finding>) {
    let (samples, length) = record.distances(pair);
    let margin = AUDIT.step_window + AUDIT.step_apart;
    if length.len() < AUDIT.step_windows * margin {
        return;
    }
    let window = |from: usize, to: usize| median(&length[from..to]);
    let change = |t: usize| window(t + AUDIT.step_apart, t + margin) - window(t - margin, t - AUDIT.step_apart);
    let times: Vec<usize> = (margin..length.len() - margin).filter(|&t| !record.near_lost(samples[t], 1)).collect();
    let changes: Vec<f64> = times.iter().map(|&t| change(t)).collect();
    let sizes: Vec<f64> = changes.iter().map(|c| c.abs()).collect();
    let Some(best) = (0..sizes.len()).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b])) else { return };
    let t = times[best];
    let before = window(t.saturating_sub(AUDIT.step_lasting), t - AUDIT.step_apart);
    let after = window(t + AUDIT.step_apart, (t + AUDIT.step_lasting).min(length.len()));
    let noise = record.point_sigma(pair.0).hypot(record.point_sigma(pair.1));
    let bar = (relative * before).max(typical * median(&sizes)).max(AUDIT.step_over_noise * noise);
    if sizes[best] > bar && (after - before).abs() > AUDIT.step_kept * sizes[best] {
        out.push(Finding {
            severity: Severity::Faulty,
            record: record.index,
            place: Place::Pair(pair.0, pair.1),
            time_s: record.at(samples[t]),
            what: format!("their distance steps from {before:.4} m to {after:.4} m and stays"),
            number: after - before,
            unit: "m",
            advice: "a marker slipped or was taken for another: use the record before the step only",
        });
    }
}

fn drifts(record: &Prepared, pair: (usize, usize), out: &mut Vec<Finding>) {
    let (_, length) = record.distances(pair);
    let (center, drift) = (median(&length), drift(&length));
    let rest = spread(&length.iter().enumerate().map(|(t, x)| x - drift * t as f64 / length.len() as f64).collect::<Vec<_>>());
    if drift.abs() > AUDIT.drift_length * center && drift.abs() > AUDIT.drift_rest * rest {
        out.push(Finding {
            severity: Severity::Warning,
            record: record.index,
            place: Place::Pair(pair.0, pair.1),
            time_s: None,
            what: format!("a fixed distance of {center:.4} m drifts over the record"),
            number: drift,
            unit: "m",
            advice: "something slips or the calibration drifts",
        });
    }
}

/// Fixed distances that vary far more than the noise: one finding for all records, at the worst.
fn check_rigid(records: &[Prepared], pair: (usize, usize), out: &mut Vec<Finding>) {
    let varies = |record: &Prepared| {
        let (_, length) = record.distances(pair);
        let noise = record.point_sigma(pair.0).hypot(record.point_sigma(pair.1));
        let (center, sd) = (median(&length), spread(&length));
        (sd > AUDIT.rigid_varies * center && sd > AUDIT.rigid_over_noise * noise).then_some((record.index, center, sd))
    };
    let found: Vec<(usize, f64, f64)> = records.iter().filter_map(varies).collect();
    let Some(&(worst, center, sd)) = found.iter().max_by(|a, b| a.2.total_cmp(&b.2)) else { return };
    let typical = median(&found.iter().map(|f| f.2).collect::<Vec<_>>());
    out.push(Finding {
        severity: Severity::Warning,
        record: worst,
        place: Place::Pair(pair.0, pair.1),
        time_s: None,
        what: format!(
            "a fixed distance of {center:.4} m varies far above the noise in {} of {} records, typically by {typical:.5} m",
            found.len(),
            records.len()
        ),
        number: sd,
        unit: "m",
        advice: "the clamp gives way or the markers wobble: inputs and directions taken from them carry this error",
    });
}

/// Median of the last tenth less median of the first, scaled to the whole record.
fn drift(length: &[f64]) -> f64 {
    let tenth = (length.len() / 10).max(1).min(length.len());
    (median(&length[length.len() - tenth..]) - median(&length[..tenth])) / 0.9
}

/// The chord's upper quantile; NaN (unlike nothing) where the pair was hardly seen.
fn straight_length(record: &Prepared, pair: (usize, usize)) -> f64 {
    let (_, length) = record.distances(pair);
    if length.len() < record.times().div_ceil(AUDIT.hardly_seen) { f64::NAN } else { quantile(&length, AUDIT.straight) }
}

pub(super) fn check_across(records: &[Prepared], out: &mut Vec<Finding>) {
    let Some(layout) = records.first().map(|r| r.layout) else { return };
    layout.rigid.iter().for_each(|&pair| check_rigid(records, pair, out));
    if records.len() < AUDIT.compared_records {
        return;
    }
    for &pair in layout.chords.iter().filter(|p| !layout.rigid.contains(p)).chain(&layout.rigid) {
        let straight: Vec<f64> = records.iter().map(|r| straight_length(r, pair)).collect();
        let center = median(&straight.iter().copied().filter(|s| s.is_finite()).collect::<Vec<_>>());
        let scale = spread(&straight.iter().copied().filter(|s| s.is_finite()).collect::<Vec<_>>())
            .max(AUDIT.length_least_spread * center);
        for (record, value) in records.iter().zip(&straight) {
            let (z, relative) = ((value - center) / scale, value / center - 1.0);
            let exceeds = |bar: (f64, f64)| z.abs() > bar.0 && relative.abs() > bar.1;
            if !exceeds(AUDIT.length_warning) {
                continue;
            }
            out.push(Finding {
                severity: if exceeds(AUDIT.length_faulty) { Severity::Faulty } else { Severity::Warning },
                record: record.index,
                place: Place::Pair(pair.0, pair.1),
                time_s: None,
                what: format!(
                    "their distance is {value:.4} m where the other records have {center:.4} m ({:+.1} %, robust z {z:+.1})",
                    100.0 * relative
                ),
                number: value - center,
                unit: "m",
                advice: "a marker sits elsewhere or the clamp was changed: leave the record out or give it its own lengths",
            });
        }
    }
}
