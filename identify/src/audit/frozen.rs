//! Points that stop dead in mid-motion while the capture goes on.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{distance, median, runs};

pub(super) fn check(record: &Prepared, out: &mut Vec<Finding>) {
    for point in 0..record.layout.points {
        let moved: Vec<f64> = (1..record.times()).map(|t| distance(record.point(t, point), record.point(t - 1, point))).collect();
        let still: Vec<usize> = (0..moved.len()).filter(|&t| moved[t] == 0.0).collect();
        let frozen: Vec<(usize, usize)> = runs(&still, 0)
            .into_iter()
            .filter(|r| !(r.0..=r.1).any(|t| record.missing_near(t, point, 1)) && is_frozen(record, point, &moved, *r))
            .collect();
        let Some(longest) = frozen.iter().max_by_key(|r| r.1 - r.0) else { continue };
        let length = longest.1 - longest.0 + 1;
        out.push(Finding {
            severity: if length >= AUDIT.frozen_faulty { Severity::Faulty } else { Severity::Warning },
            record: record.index,
            place: Place::Point(point),
            time_s: record.at(longest.0),
            what: format!("stands exactly still for {length} steps in mid-motion ({} such stretches)", frozen.len()),
            number: length as f64,
            unit: "steps",
            advice: "the marker was lost and its last place repeated: leave these samples out",
        });
    }
}

/// A lost marker catches up when it is found again: the step out of the run is far longer than those around it. (A gripper
/// that holds still and starts again does not leap.) A run to the end of the record counts when it begins in full motion.
fn is_frozen(record: &Prepared, point: usize, moved: &[f64], (start, end): (usize, usize)) -> bool {
    let length = end - start + 1;
    let d = record.layout.dimension;
    let grid = record.quantum[point * d..(point + 1) * d].iter().copied().fold(0.0, f64::max);
    let floor = AUDIT.frozen_over_noise * grid.max(record.point_sigma(point));
    let before = moved[start.saturating_sub(AUDIT.frozen_around)..start].iter().copied().fold(0.0, f64::max);
    match moved.get(end + 1) {
        Some(&exit) => {
            let later = median(&moved[(end + 2).min(moved.len())..(end + 2 + AUDIT.frozen_around).min(moved.len())]);
            length >= AUDIT.frozen_run && exit > floor && exit > AUDIT.frozen_catch_up * later.max(before)
        }
        None => {
            length >= AUDIT.frozen_faulty
                && start > 0
                && before > AUDIT.frozen_last_over_noise * floor
                && before * length as f64 > floor
        }
    }
}
