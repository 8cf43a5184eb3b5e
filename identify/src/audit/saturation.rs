//! Flat tops: a channel held at its extreme although it came with speed.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{median, noise_sigma};

pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) {
    let d = record.layout.dimension;
    for channel in 0..record.layout.points * d {
        let floor = record.sigma[channel].max(record.quantum[channel]);
        report(record, &record.channel(channel), floor, Place::Coordinate(channel / d, channel % d), out);
    }
    for input in 0..record.layout.inputs {
        let series = record.input(input);
        let floor = noise_sigma(&series);
        report(record, &series, floor, Place::Input(input), out);
    }
}

fn report(record: &Prepared, series: &[f64], floor: f64, place: Place, out: &mut Vec<Finding>) {
    for (name, extreme) in [("largest", f64::max as fn(f64, f64) -> f64), ("smallest", f64::min)] {
        let limit = series.iter().copied().fold(series.first().copied().unwrap_or(0.0), extreme);
        let flat = flat_runs(series, limit, floor);
        let Some(&(start, _)) = flat.first() else { continue };
        let held: usize = flat.iter().map(|r| r.1 - r.0 + 1).sum();
        out.push(Finding {
            severity: Severity::Warning,
            record: record.index,
            place,
            time_s: record.at(start),
            what: format!(
                "held at its {name} value {limit:.6} for {held} samples in {} runs after arriving with speed",
                flat.len()
            ),
            number: held as f64,
            unit: "samples",
            advice: "saturated: leave these samples out, or model the limit",
        });
    }
}

/// Runs at the limit that are entered or left by a step no smooth peak would take.
fn flat_runs(series: &[f64], limit: f64, floor: f64) -> Vec<(usize, usize)> {
    let moves: Vec<f64> = series.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|m| *m > 0.0).collect();
    if moves.is_empty() {
        return Vec::new();
    }
    let bar = (AUDIT.flat_over_noise * floor).max(AUDIT.flat_over_moves * median(&moves));
    let at_limit: Vec<usize> = (0..series.len()).filter(|&t| series[t] == limit).collect();
    let mut runs = super::series::runs(&at_limit, 0);
    let steep = |a: usize, b: usize| (series[a] - series[b]).abs() > bar;
    runs.retain(|&(start, end)| {
        let long = end - start + 1 >= AUDIT.flat_run && end - start + 1 < series.len() / 2;
        // At rest before and after (hold, move, hold) is no saturation: it must come and go.
        long && start > 0 && end + 1 < series.len() && steep(start - 1, start) && steep(end, end + 1)
    });
    runs
}
