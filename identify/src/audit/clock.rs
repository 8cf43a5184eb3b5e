//! Time stamps: order, duplicates, gaps, jitter.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::spread;

pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) {
    let intervals: Vec<f64> = record.time.windows(2).map(|w| w[1] - w[0]).collect();
    if intervals.is_empty() {
        return;
    }
    let mut add = |severity, time_s, what: String, number, unit, advice| {
        out.push(Finding { severity, record: record.index, place: Place::Clock, time_s, what, number, unit, advice });
    };
    let bad: Vec<usize> = (0..intervals.len()).filter(|&t| intervals[t].is_nan() || intervals[t] <= 0.0).collect();
    if let Some(&first) = bad.first() {
        let what = format!("{} time stamps repeat, run backwards or are missing", bad.len());
        add(Severity::Faulty, record.at(first), what, bad.len() as f64, "stamps", "sort and deduplicate, or rebuild the clock");
        return;
    }
    let typical = record.interval();
    let long = (AUDIT.gap * typical).max(typical + AUDIT.gap_over_jitter * spread(&intervals));
    let gaps: Vec<usize> = (0..intervals.len()).filter(|&t| intervals[t] > long).collect();
    if let Some(&worst) = gaps.iter().max_by(|a, b| intervals[**a].total_cmp(&intervals[**b])) {
        let lost: f64 = gaps.iter().map(|&t| (intervals[t] / typical).round() - 1.0).sum();
        let severe = gaps.len() as f64 > AUDIT.gaps_faulty * intervals.len() as f64;
        let what = format!("{} gaps in the time stamps, {lost:.0} samples short; the longest is given", gaps.len());
        let advice =
            "step the simulation with the stamps, or cut the record at the gaps, as fits and diagnoses do at those of over 0.1 s";
        add(if severe { Severity::Faulty } else { Severity::Warning }, record.at(worst), what, intervals[worst], "s", advice);
    }
    let jitter = spread(&intervals) / typical;
    if jitter > AUDIT.jitter_info {
        let severity = if jitter > AUDIT.jitter_warning { Severity::Warning } else { Severity::Info };
        let what = format!("intervals scatter around {typical:.6} s");
        add(
            severity,
            None,
            what,
            100.0 * jitter,
            "%",
            "use the stamps as they are, or resample; add velocity × jitter to the noise",
        );
    }
}
