//! Differences at their best step, with their own floor, and the Taylor slope.

use super::block::Block;
use super::{BlockReport, FLOOR_FACTOR, RELATIVE_ERROR, Sample};
use crate::AdjointError;

/// Steps tried, as powers of ten of the block's scale.
const EXPONENTS: std::ops::RangeInclusive<i32> = -14..=-2;
/// Two steps per decade.
const PER_DECADE: f64 = 2.0;
/// Rounding of L over the sum of its parts' sizes: a step's root is found to about this part of the velocity scale.
const ROUNDING: f64 = 1e-13;
/// Change of L, relative to the sum of its parts' sizes, below which an input without derivative has none: what the steps' tolerance leaves open.
const UNMOVED: f64 = 1e-11;
/// Largest scale given to a block of zeros, in its SI unit: an input that hardly matters is not moved without limit.
const ZERO_SCALE: f64 = 0.1;
/// Part of the scale within which an input without derivative must leave L unmoved: a wider move may reach another edge of a shape.
const NEAR: f64 = 0.02;
/// A remainder must exceed rounding by this factor to be given a slope.
const ABOVE_NOISE: f64 = 30.0;

struct Point {
    eps: f64,
    difference: f64,
    remainder: f64,
    switches: usize,
}

/// Compares the derivative along a block's direction with differences of `sample`.
pub(crate) fn judge(
    block: &Block,
    derivative: f64,
    by_jvp: f64,
    size: f64,
    sample: impl Fn(f64) -> Result<Sample, AdjointError>,
) -> Result<BlockReport, AdjointError> {
    let base = sample(0.0)?;
    let scale = if block.scale > 0.0 { block.scale } else { (0.1 * base.value.abs() / derivative.abs()).min(ZERO_SCALE) };
    let one_sided = block.range.0 >= 0.0;
    let mut points = Vec::new();
    for k in EXPONENTS {
        let eps = scale * 10f64.powf(f64::from(k) / PER_DECADE);
        let widest = if one_sided { 2.0 * eps } else { eps };
        if widest < block.range.1 && (one_sided || -eps > block.range.0) {
            // the widest moves may leave the range where a step has a solution: the narrower ones judge
            points.extend(point(eps, derivative, one_sided, &base, &sample).ok());
        }
    }
    let widest_difference = points.last().map_or(0.0, |p| p.difference.abs());
    let magnitude = derivative.abs().max(widest_difference);
    // an influence that the widest difference could not tell from rounding is none
    let widest = points.last().map_or(f64::INFINITY, |p| p.eps);
    let unseen = magnitude <= FLOOR_FACTOR * ROUNDING * base.value.abs() / widest;
    let unmoved = |p: &Point| p.difference.abs() * p.eps <= UNMOVED * base.parts;
    // Both laws of contact hold the square of the friction coefficient alone, so L is even in it: at 0 its derivative is 0, and a
    // central difference would be too, but no difference may go below 0. A one-sided one sees the derivative only at coefficients
    // below the rest gap over the distance slid in a step, which rounding hides; above, it finds the slope of Coulomb's cone.
    let even = block.even && one_sided && size * ZERO_SCALE <= UNMOVED * base.parts;
    let negligible = even
        || unseen
        || size == 0.0 && !points.is_empty() && points.iter().filter(|p| p.switches == 0 && p.eps <= NEAR * scale).all(unmoved);
    let best = best(&points, derivative);
    let (difference, floor, step, switches) = match best {
        Some(k) => {
            let rounding = noise(&points, &base) / points[k].eps;
            // relative to what the error is relative to: a wide difference over a switch may be of any size
            let size = derivative.abs().max(points[k].difference.abs());
            (points[k].difference, disagreement(&points, k).max(rounding) / size, points[k].eps, points[k].switches)
        }
        None => (f64::NAN, f64::INFINITY, 0.0, 0),
    };
    let relative_error = match (derivative - difference).abs() {
        // both may be 0 where an input matters only farther away
        error if negligible || error == 0.0 => 0.0,
        error => error / derivative.abs().max(difference.abs()),
    };
    let floor = if negligible { 0.0 } else { floor };
    // What an input does may cancel all but its last digits: a sliding ball's weight and inertia leave its mass a derivative of 1e-8.
    // A disagreement that moves L by less than its own last digit over the block's whole scale is rounding of what cancels.
    let last_digit = f64::EPSILON * base.parts / scale;
    let dot_test = if size == 0.0 { 0.0 } else { ((derivative - by_jvp).abs() - last_digit).max(0.0) / size };
    let taylor_slope = if negligible { None } else { slope(&points, &base) };
    let mut report = BlockReport {
        name: block.name.clone(),
        size: block.size,
        derivative,
        difference,
        relative_error,
        floor,
        step,
        taylor_slope,
        dot_test,
        contact_switches: switches,
        one_sided,
        pass: false,
    };
    report.pass = report.modes_agree() && report.agrees_with_differences();
    Ok(report)
}

/// Central difference, or the second-order forward one at a bound; and the first-order Taylor remainder.
fn point(
    eps: f64,
    derivative: f64,
    one_sided: bool,
    base: &Sample,
    sample: &impl Fn(f64) -> Result<Sample, AdjointError>,
) -> Result<Point, AdjointError> {
    let plus = sample(eps)?;
    let other = sample(if one_sided { 2.0 * eps } else { -eps })?;
    let difference = if one_sided {
        (4.0 * plus.value - 3.0 * base.value - other.value) / (2.0 * eps)
    } else {
        (plus.value - other.value) / (2.0 * eps)
    };
    let changed =
        |s: &Sample| s.modes.len().abs_diff(base.modes.len()) + s.modes.iter().zip(&base.modes).filter(|(a, b)| a != b).count();
    let remainder_at = |s: &Sample, eps: f64| (s.value - base.value - eps * derivative).abs();
    // the larger of both sides: on one of them terms of second and third order may cancel, which has no slope at all
    let remainder = remainder_at(&plus, eps).max(if one_sided { 0.0 } else { remainder_at(&other, -eps) });
    Ok(Point { eps, difference, remainder, switches: changed(&plus) + changed(&other) })
}

/// The difference that agrees best with its neighbours: of those within which nothing switches, if one of them is good enough to judge.
fn best(points: &[Point], derivative: f64) -> Option<usize> {
    let best_of = |kept: &dyn Fn(usize) -> bool| {
        (1..points.len()).filter(|&k| kept(k)).min_by(|&a, &b| disagreement(points, a).total_cmp(&disagreement(points, b)))
    };
    let unswitched = best_of(&|k| points[k].switches == 0);
    let judges =
        |&k: &usize| FLOOR_FACTOR * disagreement(points, k) <= RELATIVE_ERROR * derivative.abs().max(points[k].difference.abs());
    unswitched.filter(judges).or_else(|| best_of(&|_| true))
}

fn disagreement(points: &[Point], k: usize) -> f64 {
    let before = (points[k].difference - points[k - 1].difference).abs();
    let after = points.get(k + 1).map_or(0.0, |p| (p.difference - points[k].difference).abs());
    before.max(after)
}

/// Rounding of L as seen in the smallest steps, where the true remainder has vanished; at least that of its parts.
fn noise(points: &[Point], base: &Sample) -> f64 {
    points.iter().take(3).map(|p| p.remainder).fold(f64::EPSILON * base.parts, f64::max)
}

/// Slope of log remainder over log ε between the two smallest steps whose remainder stands clear of rounding.
fn slope(points: &[Point], base: &Sample) -> Option<f64> {
    let noise = ABOVE_NOISE * noise(points, base);
    let clear: Vec<&Point> = points.iter().filter(|p| p.remainder > noise && p.switches == 0).collect();
    let (a, b) = (clear.first()?, clear.get(2)?);
    Some((b.remainder / a.remainder).ln() / (b.eps / a.eps).ln())
}
