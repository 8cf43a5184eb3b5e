//! Curves over time: positions of markers, and how far the simulation is off.

use super::plot::{Frame, Point, range};
use super::shapes::Figure;
use crate::diagnose::Curve;
use crate::number::thousandths;

/// Markers shown per record, the worst ones first.
const PER_RECORD: usize = 2;
/// Records shown.
const MOST_RECORDS: usize = 3;

/// A marker's position, and below it the error, for the markers the baseline gets worst.
pub(super) fn figures(curves: &[Curve]) -> Vec<Figure> {
    let mut records: Vec<&str> = curves.iter().map(|c| c.record.as_str()).collect();
    records.dedup();
    records.truncate(MOST_RECORDS);
    let mut out = Vec::new();
    for record in records {
        let mut of_record: Vec<&Curve> = curves.iter().filter(|c| c.record == record && !c.time.is_empty()).collect();
        of_record.sort_by(|a, b| square(&b.before, &b.measured).total_cmp(&square(&a.before, &a.measured)));
        out.extend(of_record.into_iter().take(PER_RECORD).map(figure));
    }
    out
}

fn figure(curve: &Curve) -> Figure {
    let axis = (0..3).max_by(|&a, &b| along(curve, a).total_cmp(&along(curve, b))).unwrap_or(2);
    let of_marker = curve.quantity.is_empty();
    let name = if of_marker { ["x", "y", "z"][axis] } else { curve.quantity.as_str() };
    let what = if of_marker { format!("marker {}", curve.marker) } else { curve.quantity.clone() };
    let label = format!("{}, {what}", curve.record);
    let unit = if curve.unit.is_empty() { "m" } else { curve.unit.as_str() };
    let t = range_of_time(&curve.time);
    let series = |points: &[[f64; 3]]| -> Vec<Point> { curve.time.iter().zip(points).map(|(t, p)| (*t, p[axis])).collect() };
    let (measured, before, after) = (series(&curve.measured), series(&curve.before), series(&curve.after));
    let all = measured.iter().chain(&before).chain(&after).map(|p| p.1);
    let position = Frame::new(520.0, 220.0, t, range(all));
    let body = position.axes("time [s]", &format!("{name} [{unit}]"))
        + &position.dots("measured pale", 2.4, &measured)
        + &position.line("before", &before)
        + &position.line("after", &after);
    let above = position.svg(&format!("{name} of {label} over time"), &body);

    let (before, after) = (error(curve, &curve.before), error(curve, &curve.after));
    let high = range(before.iter().chain(&after).map(|p| p.1)).1.max(0.0);
    let off = Frame::new(520.0, 170.0, t, (0.0, high));
    let body = off.axes("time [s]", &format!("error [{}]", thousandths(unit)))
        + &off.line("before", &before)
        + &off.line("after", &after);
    let below = off.svg(&format!("Distance of simulated from measured, {label}"), &body);
    Figure::new(above + &below, format!("{label}: {name}, and the distance between simulated and measured"))
}

/// Distance of simulated from measured, in thousandths of the unit.
fn error(curve: &Curve, simulated: &[[f64; 3]]) -> Vec<Point> {
    let distance = |(p, m): (&[f64; 3], &[f64; 3])| 1e3 * (0..3).map(|a| (p[a] - m[a]).powi(2)).sum::<f64>().sqrt();
    curve.time.iter().copied().zip(simulated.iter().zip(&curve.measured).map(distance)).collect()
}

/// Sum of squared errors over the measured samples.
fn square(simulated: &[[f64; 3]], measured: &[[f64; 3]]) -> f64 {
    let pairs = simulated.iter().flatten().zip(measured.iter().flatten());
    pairs.map(|(s, m)| (s - m).powi(2)).filter(|e| e.is_finite()).sum()
}

/// Squared error of the baseline along an axis.
fn along(curve: &Curve, axis: usize) -> f64 {
    let pairs = curve.before.iter().zip(&curve.measured);
    pairs.map(|(s, m)| (s[axis] - m[axis]).powi(2)).filter(|e| e.is_finite()).sum()
}

fn range_of_time(time: &[f64]) -> (f64, f64) {
    (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(record: &str, marker: usize, error: f64) -> Curve {
        let at = |y: f64| vec![[0.0, y, 0.0]; 5];
        let time = (0..5).map(f64::from).collect();
        let measured = at(0.0);
        Curve { record: record.into(), marker, time, measured, before: at(error), after: at(0.1 * error), ..Curve::default() }
    }

    #[test]
    fn the_worst_markers_of_each_record_are_shown() {
        let curves = [curve("a", 0, 0.1), curve("a", 1, 0.3), curve("a", 2, 0.2), curve("b", 0, 0.1)];
        let captions: Vec<String> = figures(&curves).into_iter().map(|f| f.caption).collect();
        assert_eq!(captions.len(), 3);
        assert!(captions[0].starts_with("a, marker 1: y") && captions[1].starts_with("a, marker 2"), "{captions:?}");
    }

    #[test]
    fn missing_samples_and_empty_curves_do_no_harm() {
        let mut hidden = curve("a", 0, 0.1);
        hidden.measured[2] = [f64::NAN; 3];
        assert_eq!(figures(&[hidden, Curve::default()]).len(), 1);
    }
}
