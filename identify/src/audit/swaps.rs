//! Two markers that exchange their names from one sample to the next.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::distance;

/// Reports, and returns the samples (first after the exchange) with the points concerned.
///
/// Each point is carried on by its last velocity. If the two land where the other was expected, and nowhere near their own
/// expectation, the names are exchanged.
pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) -> Vec<(usize, usize, usize)> {
    let mut swaps = Vec::new();
    for t in 2..record.times() {
        let miss: Vec<f64> = (0..record.layout.points).map(|p| distance(&expected(record, t, p), record.point(t, p))).collect();
        for a in 0..record.layout.points {
            for b in a + 1..record.layout.points {
                let apart = distance(record.point(t - 1, a), record.point(t - 1, b));
                if miss[a].min(miss[b]) < AUDIT.swap_miss * apart || apart == 0.0 {
                    continue;
                }
                let crossed = distance(&expected(record, t, a), record.point(t, b))
                    .max(distance(&expected(record, t, b), record.point(t, a)));
                if crossed < AUDIT.swap_better * miss[a].min(miss[b]) && crossed < AUDIT.swap_close * apart {
                    swaps.push((t, a, b));
                }
            }
        }
    }
    let mut pairs: Vec<(usize, usize)> = swaps.iter().map(|s| (s.1, s.2)).collect();
    pairs.sort_unstable();
    pairs.dedup();
    for pair in pairs {
        let events: Vec<usize> = swaps.iter().filter(|s| (s.1, s.2) == pair).map(|s| s.0).collect();
        out.push(Finding {
            severity: Severity::Faulty,
            record: record.index,
            place: Place::Pair(pair.0, pair.1),
            time_s: record.at(events[0]),
            what: format!("the two markers exchange their names {} times", events.len()),
            number: events.len() as f64,
            unit: "times",
            advice: "exchange them back from there on",
        });
    }
    swaps
}

fn expected(record: &Prepared, t: usize, point: usize) -> Vec<f64> {
    record.point(t - 1, point).iter().zip(record.point(t - 2, point)).map(|(x, y)| 2.0 * x - y).collect()
}
