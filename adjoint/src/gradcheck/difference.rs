//! Differences along a block's direction, their uncertainty, and the verdict on a derivative.
//!
//! Along the direction d of a block, L is sampled at ε_k = scale · 10^{k/2} on both sides (at ε and 2 ε if only one side is
//! admissible). Three neighbouring steps give an estimate of the derivative and its uncertainty:
//! ```text
//! D_k = (L(ε_k) − L(−ε_k)) / 2ε_k                 central difference (one-sided: of second order)
//! E_k = (10 D_k − D_{k+1}) / 9                    its error of order ε² eliminated (Richardson)
//! G_k                                             right derivative of the cubic through L(0), L(ε_k), L(ε_{k+1}), L(ε_{k+2})
//! U_k = max(|E_k − E_{k+1}|, |E_k − G_k|, rounding)
//! ```
//! Curvature, noise and kinks, also one exactly at the base point, make U large: the estimate with the smallest U judges, or none. It
//! fails a derivative only by more than it misses narrower estimates itself.

use super::block::Block;
use super::{BlockReport, GRADCHECK, Sample, Verdict};
use crate::AdjointError;

/// Exponents k of the steps in the order in which they are taken: from the middle outward.
const ORDER: [i32; 13] = [-8, -7, -6, -9, -5, -10, -4, -11, -3, -12, -2, -13, -14];
/// The smallest of them.
const FIRST: i32 = -14;
/// Ratio of neighbouring steps, √10.
const RATIO: f64 = 3.162_277_660_168_379_5;

/// Samples at one step.
struct Point {
    eps: f64,
    difference: f64,
    /// (L(ε) − L(0)) / ε
    forward: f64,
    /// |L(±ε) − L(0) ∓ ε ⟨∇L, d⟩|, the larger of both sides: on one of them terms of second and third order may cancel.
    remainder: f64,
    switches: usize,
}

/// Estimate of the derivative from three neighbouring steps.
#[derive(Clone, Copy)]
struct Estimate {
    value: f64,
    uncertainty: f64,
    /// Smallest of the three steps.
    eps: f64,
    slope: Option<f64>,
}

/// Points by exponent, as far as they were taken.
#[derive(Default)]
struct Points([Option<Point>; ORDER.len()]);

impl Points {
    fn at(&self, k: usize) -> Option<&Point> {
        self.0.get(k).and_then(Option::as_ref).filter(|p| p.switches == 0)
    }

    /// From the steps k, k + 1 and k + 2, if nothing switches within them.
    fn estimate(&self, k: usize, rounding: f64) -> Option<Estimate> {
        let [a, b, c] = [self.at(k)?, self.at(k + 1)?, self.at(k + 2)?];
        let without_square = |fine: f64, coarse: f64| (RATIO * RATIO * fine - coarse) / (RATIO * RATIO - 1.0);
        let (value, wider) = (without_square(a.difference, b.difference), without_square(b.difference, c.difference));
        let without_linear = |fine: f64, coarse: f64| (RATIO * fine - coarse) / (RATIO - 1.0);
        let right = without_square(without_linear(a.forward, b.forward), without_linear(b.forward, c.forward));
        let uncertainty = (value - wider).abs().max((value - right).abs()).max(rounding / a.eps);
        let clear = [a, b, c].iter().all(|p| p.remainder > GRADCHECK.above_noise * uncertainty * a.eps);
        let slope = clear.then(|| (c.remainder / a.remainder).ln() / (c.eps / a.eps).ln());
        Some(Estimate { value, uncertainty, eps: a.eps, slope })
    }

    /// The estimate of least uncertainty.
    fn best(&self, rounding: f64) -> Option<Estimate> {
        let estimates = (0..ORDER.len()).filter_map(|k| self.estimate(k, rounding));
        estimates.filter(|e| (e.value + e.uncertainty).is_finite()).min_by(|a, b| a.uncertainty.total_cmp(&b.uncertainty))
    }

    /// The most by which an estimate misses narrower ones, beyond their own uncertainty: a derivative is a limit, and an input of size
    /// zero may saturate before the steps are wide enough to be seen.
    fn missed(&self, wide: &Estimate, rounding: f64) -> f64 {
        let narrower = (0..ORDER.len()).filter_map(|k| self.estimate(k, rounding)).take_while(|e| e.eps < wide.eps);
        narrower.map(|e| (wide.value - e.value).abs() - e.uncertainty).fold(0.0, f64::max)
    }

    /// The smallest step that was taken, and the switches within it.
    fn smallest(&self) -> Option<&Point> {
        self.0.iter().flatten().next()
    }
}

/// Derivatives along a block's direction, and the size of their terms.
pub(crate) struct Derivative {
    pub by_vjp: f64,
    pub by_jvp: f64,
    pub size: f64,
    /// What rounding is seen to make of both.
    pub rounding: f64,
}

/// Judges the derivative along a block's direction by differences of `sample`, which takes steps ε along it; `base` is `sample(0)`.
pub(crate) fn judge(
    block: &Block,
    derivative: &Derivative,
    base: &Sample,
    sample: impl Fn(f64) -> Result<Sample, AdjointError>,
) -> BlockReport {
    let (by_vjp, size) = (derivative.by_vjp, derivative.size);
    let scale =
        if block.scale > 0.0 { block.scale } else { (GRADCHECK.moved * base.parts / by_vjp.abs()).min(GRADCHECK.of_zeros) };
    let one_sided = block.range.0 >= 0.0;
    let rounding = f64::EPSILON * base.parts;
    let magnitude = |value: f64| by_vjp.abs().max(value.abs()).max(GRADCHECK.insignificant * base.parts / scale);
    let error = |e: &Estimate| (by_vjp - e.value).abs() / magnitude(e.value);
    let floor = |e: &Estimate| e.uncertainty / magnitude(e.value);

    let mut points = Points::default();
    let mut best = None;
    if block.even {
        // L(−ε) = L(ε): the central difference is 0 at every step, though no step may go below 0
        best = Some(Estimate { value: 0.0, uncertainty: rounding / scale, eps: 0.0, slope: None });
    } else {
        let mut widest = i32::MAX;
        for k in ORDER {
            let eps = scale * RATIO.powi(k);
            let end = if one_sided { 2.0 * eps } else { eps };
            if k > widest || end >= block.range.1 || (!one_sided && -eps <= block.range.0) {
                continue;
            }
            let point = point(eps, by_vjp, one_sided, base, &sample).ok();
            // where a step has no solution, or something switches, wider ones are no better
            if point.as_ref().is_none_or(|p| p.switches > 0) {
                widest = k;
            }
            points.0[(k - FIRST) as usize] = point;
            best = points.best(rounding);
            if best
                .as_ref()
                .is_some_and(|e| !exceeds(floor(e), GRADCHECK.judging_floor) && !exceeds(error(e), admissible(floor(e))))
            {
                break;
            }
        }
    }

    // What an input does may cancel all but its last digits: a sliding ball's weight and inertia leave its mass a derivative of 1e-8.
    // A disagreement that moves L by less than its own last digit over the block's whole scale is rounding of terms that cancel.
    let digits = rounding / scale + GRADCHECK.floor_factor * derivative.rounding;
    let dot_test = if size == 0.0 { 0.0 } else { ((by_vjp - derivative.by_jvp).abs() - digits).max(0.0) / size };
    let modes_disagree = exceeds(dot_test, GRADCHECK.dot_test)
        .then(|| format!("jvp and vjp disagree by {dot_test:.1e}, at most {:.0e} is admissible", GRADCHECK.dot_test));
    let (verdict, reason) = match (modes_disagree, by_differences(&points, best, floor, error)) {
        (Some(reason), _) => (Verdict::Fail, Some(reason)),
        (None, (Verdict::Fail, reason)) => match &best {
            Some(e)
                if exceeds(error(e), admissible(floor(e)))
                    && !exceeds(error(e), admissible(points.missed(e, rounding) / magnitude(e.value))) =>
            {
                let reason =
                    format!("narrower differences contradict the one at ε = {:.0e}, which disagrees by {:.1e}", e.eps, error(e));
                (Verdict::Inconclusive, Some(reason))
            }
            _ => (Verdict::Fail, reason),
        },
        (None, verdict) => verdict,
    };
    BlockReport {
        name: block.name.clone(),
        size: block.size,
        derivative: by_vjp,
        difference: best.map_or(f64::NAN, |e| e.value),
        relative_error: best.as_ref().map_or(f64::NAN, error),
        floor: best.as_ref().map_or(f64::INFINITY, floor),
        step: best.map_or(0.0, |e| e.eps),
        taylor_slope: best.and_then(|e| e.slope),
        dot_test,
        switches: if best.is_some() { 0 } else { points.smallest().map_or(0, |p| p.switches) },
        one_sided,
        verdict,
        reason,
    }
}

/// The verdict of differences, and why it is not [`Verdict::Pass`].
fn by_differences(
    points: &Points,
    best: Option<Estimate>,
    floor: impl Fn(&Estimate) -> f64,
    error: impl Fn(&Estimate) -> f64,
) -> (Verdict, Option<String>) {
    let Some(best) = best else {
        let taken = points.0.iter().flatten().count();
        let free = points.0.iter().flatten().filter(|p| p.switches == 0).count();
        let reason = match points.smallest() {
            Some(p) if free == 0 => format!("{} switches within the smallest difference, ε = {:.0e}", p.switches, p.eps),
            Some(_) => format!("{free} of {taken} differences are free of switches, no three of neighbouring steps"),
            None => "no difference could be taken".to_owned(),
        };
        return (Verdict::Inconclusive, Some(reason));
    };
    let (floor, error) = (floor(&best), error(&best));
    if exceeds(floor, GRADCHECK.judging_floor) {
        let reason = format!("differences agree among themselves to {floor:.0e}, which is above {:.0e}", GRADCHECK.judging_floor);
        return (Verdict::Inconclusive, Some(reason));
    }
    if exceeds(error, admissible(floor)) {
        let most = admissible(floor);
        let reason = format!("gradient and difference disagree by {error:.1e}, at most {most:.0e} is admissible");
        return (Verdict::Fail, Some(reason));
    }
    match best.slope.filter(|slope| *slope <= 2.0 - GRADCHECK.slope) {
        Some(slope) => (Verdict::Fail, Some(format!("the Taylor slope is {slope:.2} instead of 2"))),
        None => (Verdict::Pass, None),
    }
}

/// Largest admissible error against a difference with this floor.
fn admissible(floor: f64) -> f64 {
    GRADCHECK.relative_error.max(GRADCHECK.floor_factor * floor)
}

/// Whether `x` is above `most`, or no number.
fn exceeds(x: f64, most: f64) -> bool {
    x.is_nan() || x > most
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
    let forward = (plus.value - base.value) / eps;
    let difference = if one_sided {
        (4.0 * plus.value - 3.0 * base.value - other.value) / (2.0 * eps)
    } else {
        (plus.value - other.value) / (2.0 * eps)
    };
    let changed =
        |s: &Sample| s.modes.len().abs_diff(base.modes.len()) + s.modes.iter().zip(&base.modes).filter(|(a, b)| a != b).count();
    let remainder_at = |s: &Sample, eps: f64| (s.value - base.value - eps * derivative).abs();
    let remainder = remainder_at(&plus, eps).max(if one_sided { 0.0 } else { remainder_at(&other, -eps) });
    Ok(Point { eps, difference, forward, remainder, switches: changed(&plus) + changed(&other) })
}
