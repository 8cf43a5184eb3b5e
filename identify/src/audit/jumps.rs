//! Points and inputs that jump: samples that the motion before and after does not allow.

use super::constants::AUDIT;
use super::record::Prepared;
use super::report::{Finding, Place, Severity};
use super::series::{median, noise_sigma, quantile, rms, runs};

struct Jump {
    start: usize,
    end: usize,
    /// Largest distance from the curve through the motion on both sides.
    size: f64,
}

pub(super) fn check(record: &Prepared, swapped: &[(usize, usize, usize)], out: &mut Vec<Finding>) {
    check_points(record, swapped, out);
    for input in 0..record.layout.inputs {
        check_input(record, input, out);
    }
}

fn check_points(record: &Prepared, swapped: &[(usize, usize, usize)], out: &mut Vec<Finding>) {
    let d = record.layout.dimension;
    let series: Vec<Vec<Vec<f64>>> =
        (0..record.layout.points).map(|p| (p * d..(p + 1) * d).map(|c| record.channel(c)).collect()).collect();
    let rough: Vec<Vec<f64>> = series.iter().map(|s| third_differences(s)).collect();
    let typical = median(&rough.concat());
    let spacing = spacing(record);
    let mut small: Vec<(usize, f64)> = Vec::new();
    for (point, (axes, rough)) in series.iter().zip(&rough).enumerate() {
        let noise = record.point_sigma(point);
        let bar = AUDIT.jump_over_median * typical.max(median(rough));
        let mut jumps = find(axes, rough, bar, AUDIT.jump_over_noise * noise);
        jumps.retain(|j| !record.near_lost(j.start, AUDIT.jump_around) && !record.near_lost(j.end, AUDIT.jump_around));
        jumps.retain(|j| !(j.start..=j.end).any(|t| record.missing_near(t, point, AUDIT.jump_around)));
        jumps.retain(|j| {
            !swapped.iter().any(|&(t, a, b)| {
                (a == point || b == point) && t + AUDIT.jump_around >= j.start && t <= j.end + AUDIT.jump_around
            })
        });
        let warning =
            if spacing > 0.0 { AUDIT.jump_warning * spacing } else { AUDIT.jump_warning_alone * AUDIT.jump_over_noise * noise };
        small.extend(jumps.iter().filter(|j| j.size <= warning).map(|j| (j.start, j.size)));
        jumps.retain(|j| j.size > warning);
        report_point(record, point, &jumps, spacing, out);
    }
    if let Some(&(start, size)) = small.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
        out.push(Finding {
            severity: Severity::Info,
            record: record.index,
            place: Place::Record,
            time_s: record.at(start),
            what: format!("{} small isolated jumps of points; the largest is given", small.len()),
            number: size,
            unit: "m",
            advice: "a robust loss will do",
        });
    }
}

fn report_point(record: &Prepared, point: usize, jumps: &[Jump], spacing: f64, out: &mut Vec<Finding>) {
    let Some(worst) = jumps.iter().max_by(|a, b| a.size.total_cmp(&b.size)) else { return };
    let samples: usize = jumps.iter().map(|j| j.end - j.start + 1).sum();
    let faulty = (spacing > 0.0 && worst.size > AUDIT.jump_faulty * spacing)
        || samples as f64 > AUDIT.jumps_faulty * record.times() as f64;
    out.push(Finding {
        severity: if faulty { Severity::Faulty } else { Severity::Warning },
        record: record.index,
        place: Place::Point(point),
        time_s: record.at(worst.start),
        what: format!(
            "leaves the motion before and after, {} times, {samples} samples in all; the largest is given",
            jumps.len()
        ),
        number: worst.size,
        unit: "m",
        advice: "leave these samples out (unless something hit the point there)",
    });
}

fn check_input(record: &Prepared, input: usize, out: &mut Vec<Finding>) {
    let series = [record.input(input)];
    let rough = third_differences(&series);
    let ordinary =
        quantile(&series[0].windows(2).map(|w| (w[1] - w[0]).abs()).collect::<Vec<_>>(), AUDIT.input_ordinary_quantile);
    let range = quantile(&series[0], 1.0) - quantile(&series[0], 0.0);
    let size = (AUDIT.jump_over_noise * noise_sigma(&series[0]))
        .max(AUDIT.input_over_ordinary * ordinary)
        .max(AUDIT.input_over_range * range);
    let mut jumps = find(&series, &rough, AUDIT.jump_over_median * median(&rough), size);
    jumps.retain(|j| !record.near_lost(j.start, AUDIT.jump_around) && !record.near_lost(j.end, AUDIT.jump_around));
    let Some(worst) = jumps.iter().max_by(|a, b| a.size.total_cmp(&b.size)) else { return };
    out.push(Finding {
        severity: Severity::Warning,
        record: record.index,
        place: Place::Input(input),
        time_s: record.at(worst.start),
        what: match jumps.len() {
            1 => "the input jumps".to_owned(),
            many => format!("the input jumps {many} times; the largest is given"),
        },
        number: worst.size,
        unit: "",
        advice: "the simulation takes it as a blow: where the motor gave none, repair the input or cut the record there",
    });
}

/// |x_{t+3} − 3x_{t+2} + 3x_{t+1} − x_t| over all axes.
fn third_differences(axes: &[Vec<f64>]) -> Vec<f64> {
    let times = axes.first().map_or(0, Vec::len);
    let one = |t: usize| axes.iter().map(|x| (x[t + 3] - 3.0 * x[t + 2] + 3.0 * x[t + 1] - x[t]).powi(2)).sum::<f64>().sqrt();
    (0..times.saturating_sub(3)).map(one).collect()
}

fn find(axes: &[Vec<f64>], rough: &[f64], bar: f64, least_size: f64) -> Vec<Jump> {
    let marked: Vec<usize> = (0..rough.len()).filter(|&t| rough[t] > bar).collect();
    let jump = |(a, b): (usize, usize)| {
        let worst = rough[a..=b].iter().copied().fold(0.0, f64::max) / 3.0;
        let inside = b + 3 - a <= AUDIT.jump_longest && a >= 1 && b + 4 < axes[0].len();
        let size = if inside { off_curve(axes, a, b + 3) } else { worst };
        Jump { start: a + 1, end: b + 2, size }
    };
    runs(&marked, 3).into_iter().map(jump).filter(|j| j.size > least_size).collect()
}

/// Largest distance, between samples a and b, from the cubic with the positions and velocities at both.
fn off_curve(axes: &[Vec<f64>], a: usize, b: usize) -> f64 {
    let length = (b - a) as f64;
    let at = |t: usize| {
        let s = (t - a) as f64 / length;
        let off = axes.iter().map(|x| {
            let (v0, v1) = ((x[a] - x[a - 1]) * length, (x[b + 1] - x[b]) * length);
            let h = (2.0 * s - 3.0) * s * s + 1.0;
            let curve = h * x[a] + (1.0 - h) * x[b] + s * (1.0 - s) * ((1.0 - s) * v0 - s * v1);
            x[t] - curve
        });
        off.map(|e| e * e).sum::<f64>().sqrt()
    };
    (a..=b).map(at).fold(0.0, f64::max)
}

/// Median distance of neighbouring points: the scale that says whether a jump is large.
fn spacing(record: &Prepared) -> f64 {
    let lengths: Vec<f64> = record.layout.chords.iter().map(|&p| rms(&record.distances(p).1)).collect();
    median(&lengths)
}
