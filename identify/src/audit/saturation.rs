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

/// Runs at the limit that are entered and left by a step no smooth peak would take, longer than any such run between the limits: what stands elsewhere
/// as long, as a command that is held and then stepped, is not cut off.
fn flat_runs(series: &[f64], limit: f64, floor: f64) -> Vec<(usize, usize)> {
    let moves: Vec<f64> = series.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|m| *m > 0.0).collect();
    if moves.is_empty() {
        return Vec::new();
    }
    let bar = (AUDIT.flat_over_noise * floor).max(AUDIT.flat_over_moves * median(&moves));
    let steep = |a: usize, b: usize| (series[a] - series[b]).abs() > bar;
    // At rest before and after (hold, move, hold) is no saturation: it must come and go.
    let comes_and_goes =
        |(start, end): (usize, usize)| start > 0 && end + 1 < series.len() && steep(start - 1, start) && steep(end, end + 1);
    let length = |(start, end): (usize, usize)| end - start + 1;
    let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max].map(|end| series.iter().copied().fold(limit, end));
    let between = |(start, _): (usize, usize)| series[start] != low && series[start] != high;
    let elsewhere = still(series).filter(|run| between(*run) && comes_and_goes(*run)).map(length).max().unwrap_or(0);
    let is_cut = |run: &(usize, usize)| {
        let long = length(*run) >= AUDIT.flat_run && length(*run) < series.len() / 2 && length(*run) > elsewhere;
        series[run.0] == limit && long && comes_and_goes(*run)
    };
    still(series).filter(is_cut).collect()
}

/// First and last sample of each run of one value.
fn still(series: &[f64]) -> impl Iterator<Item = (usize, usize)> {
    let mut start = 0;
    series.chunk_by(|a, b| a == b).map(move |run| {
        let first = start;
        start += run.len();
        (first, start - 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_cut_off_is_told_from_what_is_held() {
        let swing: Vec<f64> = (0..400).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let cut: Vec<f64> = swing.iter().map(|x| x.min(0.7)).collect();
        let cuts = flat_runs(&cut, 0.7, 1e-3);
        assert!(flat_runs(&swing, 1.0, 1e-3).is_empty() && !cuts.is_empty());
        // a new command every ten samples, which stands in between wherever it is
        let stepped: Vec<f64> = (0..400).map(|k| f64::from((k / 10 * 7) % 19) / 19.0).collect();
        let top = stepped.iter().copied().fold(0.0, f64::max);
        assert!(flat_runs(&stepped, top, 0.0).is_empty());
        // standing at the start says nothing of how it moves later
        let late: Vec<f64> = std::iter::repeat_n(0.0, 100).chain(cut).collect();
        assert_eq!(flat_runs(&late, 0.7, 1e-3).len(), cuts.len());
    }
}
