//! A section that takes a set: elastic within a yield curvature, flowing beyond it.

use super::elastic::excess;
use super::stiffening::{beyond, by_length, energy_beyond, slopes_beyond};
use super::{Moments, RememberingSection, SectionState};
use pliant_math::Real;
use std::ops::Range;

/// The elastic section of [`super::ElasticSection`], of whose bending p is plastic: with k the strains in the principal axes without those at
/// rest and x = k − p the elastic part of bending,
/// ```text
/// E = ½ [EI₁ x₁² + EI₂ x₂² + GJ k₃²]/l,     ẋ = k̇ − max(|x| − κ_y l, 0)/τ x/|x|
/// ```
/// Bending yields by the norm of its elastic part, to all sides alike; twisting stays elastic. How a step integrates this: [`flow`]. Where
/// the section stiffens, it is its elastic part that does, by the moment of [`super::StiffeningSection`] at x instead of k.
///
/// Parameters: those of the elastic section (rod length \[m\], EI₁, EI₂, GJ [N·m²], roll \[rad\], κ̄₁, κ̄₂ [1/m], τ̄ [rad/m]), then the yield
/// curvature κ_y [1/m] > 0 and the time τ \[s\] > 0 of the flow beyond, and c \[m²\] if it stiffens. Memory: p [-], curvature times the joint's length, towards the principal
/// axes, zero as the scene begins. Limits: τ → 0 is perfect plasticity independent of the rate; κ_y or τ → ∞ the elastic section.
#[derive(Clone, Debug)]
pub struct PlasticSection {
    /// Indices in θ, in the order above: ten, or eleven.
    pub params: Vec<usize>,
    /// Index in θ of the first joint's own (κ̄₁, κ̄₂, multiple of the stiffness), three each.
    pub own: usize,
    /// The joints it belongs to.
    pub joints: Range<usize>,
    /// Strains at rest, joint by joint.
    pub rest: Vec<[f64; 3]>,
}

/// Stiffnesses over the length, strains without those at rest, and of bending the elastic part.
struct Flowed<S> {
    stiffness: [S; 3],
    strain: [S; 3],
    elastic: [S; 2],
    /// c over the square of the joint's length, if it stiffens.
    stiffening: Option<S>,
    phases: u8,
    roll: [S; 2],
}

impl PlasticSection {
    fn flowed<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> Flowed<S> {
        let (sin, cos) = p[4].sin_cos();
        let (rest, z, own) = (&self.rest[at.joint - self.joints.start], &at.memory, &p[self.params.len()..]);
        let (k, stiffness) = excess(rest, at.fraction, &at.strain, [p, own], [sin, cos]);
        let (past, _) = excess(rest, at.fraction, &at.past, [p, own], [sin, cos]);
        let (elastic, phases) = if at.elapsed > 0.0 {
            let begin = [past[0] - z[0], past[1] - z[1]];
            flow_by_phases(begin, [k[0] - past[0], k[1] - past[1]], at.elapsed, p[9], p[8] * p[0] * at.fraction)
        } else {
            ([k[0] - z[0], k[1] - z[1]], WITHIN)
        };
        let stiffening = (self.params.len() > 10).then(|| by_length(p[10], p[0] * at.fraction));
        Flowed { stiffness, strain: k, elastic, stiffening, phases, roll: [sin, cos] }
    }
}

impl RememberingSection for PlasticSection {
    fn name(&self) -> &str {
        "plastic rod"
    }

    fn params(&self) -> &[usize] {
        &self.params
    }

    fn own(&self, joint: usize) -> Range<usize> {
        let first = self.own + 3 * joint.saturating_sub(self.joints.start);
        first..first + 3
    }

    fn memory(&self) -> &'static [&'static str] {
        &["plastic[0]", "plastic[1]"]
    }

    fn moment<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        let Flowed { stiffness, strain, elastic, stiffening, roll: [sin, cos], .. } = self.flowed(at, p);
        let (mut m1, mut m2) = (stiffness[0] * elastic[0], stiffness[1] * elastic[1]);
        if let Some(c) = stiffening {
            let more = beyond([stiffness[0], stiffness[1]], elastic, c);
            (m1, m2) = (m1 + more[0], m2 + more[1]);
        }
        [m1 * cos - m2 * sin, m1 * sin + m2 * cos, stiffness[2] * strain[2]]
    }

    /// Within the yield: an elastic section, of which x is the strain.
    fn add_by_hand(&self, at: &SectionState<f64>, p: &[f64], out: &mut Moments) -> bool {
        let Flowed { stiffness: k, strain, elastic: x, stiffening, phases, roll } = self.flowed(at, p);
        if phases != WITHIN {
            return false;
        }
        let (mut m, mut slopes) = ([k[0] * x[0], k[1] * x[1]], [k[0], k[1], 0.0]);
        if let Some(c) = stiffening {
            let more = beyond([k[0], k[1]], x, c);
            (m[0], m[1]) = (m[0] + more[0], m[1] + more[1]);
            slopes.iter_mut().zip(slopes_beyond([k[0], k[1]], x, c)).for_each(|(s, more)| *s += more);
        }
        let [sin, cos] = roll;
        out.m[0] += m[0] * cos - m[1] * sin;
        out.m[1] += m[0] * sin + m[1] * cos;
        out.m[2] += k[2] * strain[2];
        out.add_bending(slopes, roll);
        out.by_strain[2][2] += k[2];
        true
    }

    fn advance<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        let Flowed { strain, elastic, .. } = self.flowed(at, p);
        [strain[0] - elastic[0], strain[1] - elastic[1], S::zero()]
    }

    fn energy<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> S {
        let Flowed { stiffness: k, strain, elastic: x, stiffening, .. } = self.flowed(at, p);
        let linear = (k[0] * x[0] * x[0] + k[1] * x[1] * x[1] + k[2] * strain[2] * strain[2]) * 0.5;
        stiffening.map_or(linear, |c| linear + energy_beyond([k[0], k[1]], x, c))
    }

    fn mode(&self, at: &SectionState<f64>, p: &[f64]) -> Option<u8> {
        Some(self.flowed(at, p).phases)
    }

    fn rested(&self, strains: &[[f64; 3]]) -> Option<Self> {
        Some(Self { rest: strains[self.joints.clone()].to_vec(), ..self.clone() })
    }
}

/// Phases of a flow, which add up: none within the yield.
const WITHIN: u8 = 0;
const LEAVES: u8 = 1;
const BEGAN_BEYOND: u8 = 2;
const ENTERS: u8 = 4;

/// The elastic part of bending after the time `t` \[s\] in which the strain changed by `change` at a constant rate, from `begin`;
/// `tau` \[s\] the time of the flow beyond the radius `limit` of what is elastic.
///
/// Within the circle x moves with the strain, and leaves it at a time known in closed form. Beyond, its excess d = |x| − limit follows
/// ḋ = ρ − d/τ exactly, ρ the rate along x where this began, and its direction is that of the strain as if nothing flowed (radial
/// return); it enters the circle again where d = 0. Hence: exact where x and the rate are on one line through the origin, reversals and
/// all, whatever t/τ is, and where the strain is held; where the direction turns beyond the yield, of first order in the change per
/// step, as radial return is at τ → 0, which this then becomes. The map is continuous; so is its derivative on a line, and else up to
/// kinks in proportion to the turn within the step where the circle is entered. Plastic power is not negative.
pub fn flow<S: Real>(begin: [S; 2], change: [S; 2], t: f64, tau: S, limit: S) -> [S; 2] {
    flow_by_phases(begin, change, t, tau, limit).0
}

/// [`flow`], and through which phases it went.
fn flow_by_phases<S: Real>(begin: [S; 2], change: [S; 2], t: f64, tau: S, limit: S) -> ([S; 2], u8) {
    let end = add(begin, change, S::one());
    let square = limit.re() * limit.re();
    let starts_within = dot(begin, begin).re() <= square;
    if t <= 0.0 || (starts_within && dot(end, end).re() <= square) {
        return (end, WITHIN);
    }
    let before = if starts_within { WITHIN } else { BEGAN_BEYOND + ENTERS };
    let rate = change.map(|x| x / t);
    let (mut x, mut left) = (begin, S::from(t));
    let leaves = if starts_within {
        time_to_leave(begin, rate, limit)
    } else {
        let size = dot(begin, begin).sqrt();
        let (excess, steady) = (size - limit, dot(rate, begin) / size * tau);
        let d = excess + (steady - excess) * -(-left / tau).exp_m1();
        if d.re() >= 0.0 {
            return (scaled(end, limit + d), BEGAN_BEYOND);
        }
        let inside_after = tau * (-excess / steady).ln_1p();
        x = scaled(add(begin, rate, inside_after), limit);
        left -= inside_after;
        let inwards = -dot(x, rate);
        if inwards.re() > 0.0 { inwards * 2.0 / dot(rate, rate) } else { S::zero() }
    };
    if leaves.re() >= left.re() {
        return (add(x, rate, left), before);
    }
    x = add(x, rate, leaves);
    left -= leaves;
    let steady = dot(rate, x) / limit * tau;
    (scaled(add(x, rate, left), limit + steady * -(-left / tau).exp_m1()), before + LEAVES)
}

/// When `x`, within the circle of that radius, leaves it at this rate.
fn time_to_leave<S: Real>(x: [S; 2], rate: [S; 2], radius: S) -> S {
    let (a, b, c) = (dot(rate, rate), dot(x, rate), dot(x, x) - radius * radius);
    let square = b * b - a * c;
    if square.re() <= 0.0 {
        return S::zero(); // on the circle, moving along it
    }
    let root = square.sqrt();
    if b.re() > 0.0 { -c / (b + root) } else { (root - b) / a }
}

fn dot<S: Real>(a: [S; 2], b: [S; 2]) -> S {
    a[0] * b[0] + a[1] * b[1]
}

fn add<S: Real>(a: [S; 2], b: [S; 2], by: S) -> [S; 2] {
    [a[0] + b[0] * by, a[1] + b[1] * by]
}

/// A vector along `x` of that size.
fn scaled<S: Real>(x: [S; 2], size: S) -> [S; 2] {
    let by = size / dot(x, x).sqrt();
    [x[0] * by, x[1] * by]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{AutomaticMemory, ElasticSection, Section, check};
    use super::*;
    use crate::terms::joint::relax;
    use approx::assert_relative_eq;

    const LIMIT: f64 = 0.1;
    const TAU: f64 = 0.07;

    /// ẋ = rate − max(|x| − limit, 0)/τ x/|x| in many steps of second order.
    fn by_steps(mut x: [f64; 2], rate: [f64; 2], t: f64, n: u32) -> [f64; 2] {
        let h = t / f64::from(n);
        let slope = |x: [f64; 2]| {
            let size = dot(x, x).sqrt();
            add(rate, x, -(size - LIMIT).max(0.0) / TAU / size.max(1e-300))
        };
        for _ in 0..n {
            let middle = add(x, slope(x), 0.5 * h);
            x = add(x, slope(middle), h);
        }
        x
    }

    /// On a line through the origin it is the law of one number, reversals and all.
    #[test]
    fn on_a_line_it_is_exact() {
        let (sin, cos) = 0.7_f64.sin_cos();
        for (x, change) in [(0.0, 0.4), (0.05, -0.6), (0.6, -1.2), (-0.6, 0.06), (0.6, 0.0), (0.2, -0.15), (0.3, 0.2)] {
            let end = flow([x * cos, x * sin], [change * cos, change * sin], 0.3, TAU, LIMIT);
            let one = relax(x, change, 0.3, TAU, Some(LIMIT));
            assert_relative_eq!(end[0], one * cos, epsilon = 1e-15);
            assert_relative_eq!(end[1], one * sin, epsilon = 1e-15);
        }
    }

    /// Around corners it converges to the differential equation, to first order.
    #[test]
    fn around_corners_it_is_of_first_order() {
        for (begin, rate) in [([0.05, 0.02], [1.5, 0.9]), ([0.3, 0.0], [-0.5, 1.0]), ([0.2, 0.1], [-1.5, 0.3])] {
            let exact = by_steps(begin, rate, 0.3, 1_000_000);
            let errors = [10_u32, 20, 40, 80].map(|n| {
                let change = rate.map(|r| r * 0.3 / f64::from(n));
                let x = (0..n).fold(begin, |x, _| flow(x, change, 0.3 / f64::from(n), TAU, LIMIT));
                dot(add(x, exact, -1.0), add(x, exact, -1.0)).sqrt()
            });
            println!("{begin:?}: {errors:?}");
            assert!(errors.windows(2).all(|e| e[0] / e[1] > 1.7) && errors[3] < 2e-3, "{errors:?}");
        }
    }

    /// τ → 0: the excess is at most ρτ, so the elastic part stays on the circle, in the direction of radial return.
    #[test]
    fn it_tends_to_perfect_plasticity() {
        let (begin, change) = ([0.08, 0.0], [0.05, 0.15]);
        let end = flow(begin, change, 1.0, 1e-12, LIMIT);
        let outside = time_to_leave(begin, change, LIMIT);
        let returned = scaled(add(begin, change, 1.0), LIMIT);
        assert!(outside < 1.0);
        for k in 0..2 {
            assert_relative_eq!(end[k], returned[k], epsilon = 1e-12);
        }
        for tau in [1e-2, 1e-3, 1e-4] {
            let end = flow(begin, change, 1.0, tau, LIMIT);
            let excess = dot(end, end).sqrt() - LIMIT;
            assert!(excess > 0.0 && excess <= tau * dot(change, change).sqrt(), "{excess}");
        }
    }

    /// Largest jumps of the map and of its slope along a path of steps, of which phases begin and end.
    fn jumps(path: impl Fn(f64) -> ([f64; 2], [f64; 2])) -> [f64; 2] {
        let n = 20_000;
        let h = 1.0 / f64::from(n);
        let at = |k: u32| {
            let (begin, change) = path(f64::from(k) * h);
            flow(begin, change, 0.1, TAU, LIMIT)
        };
        let moved = |k: u32| add(at(k + 1), at(k), -1.0);
        let size = |x: [f64; 2]| dot(x, x).sqrt();
        (1..n - 1).fold([0.0, 0.0], |[map, slope]: [f64; 2], k| {
            [map.max(size(moved(k))), slope.max(size(add(moved(k), moved(k - 1), -1.0)) / h)]
        })
    }

    #[test]
    fn phases_join() {
        let on_a_line = jumps(|s| ([0.16 * (1.0 - s), 0.02 * (1.0 - s)], [0.1 - 0.4 * s, 0.0125 - 0.05 * s]));
        assert!(on_a_line[0] < 1e-4 && on_a_line[1] < 2e-3, "{on_a_line:?}");
        // where the strain turns by a fifth of a turn in one step: a kink
        let around_a_corner = jumps(|s| ([0.16 * (1.0 - s), 0.02], [-0.3 * s + 0.1, 0.08 * s - 0.02]));
        assert!(around_a_corner[0] < 1e-4 && around_a_corner[1] < 5e-2, "{around_a_corner:?}");
    }

    #[test]
    fn plastic_power_is_not_negative() {
        let (mut x, mut worst) = ([0.0, 0.0], 0.0_f64);
        for k in 0..2000 {
            let (a, b) = ((0.37 * f64::from(k)).sin(), (0.23 * f64::from(k) + 1.0).cos());
            let change = [0.09 * a, 0.07 * b];
            let end = flow(x, change, 0.02, TAU, LIMIT);
            let flowed = add(add(x, change, 1.0), end, -1.0);
            // what flowed, against the elastic part
            worst = worst.min(dot(flowed, end));
            x = end;
        }
        assert!(worst > -1e-15, "{worst}");
    }

    const THETA: [f64; 13] = [0.7, 0.02, 0.05, 0.013, 0.4, 1.5, -0.7, 2.0, 1.2, 0.07, 0.3, -0.2, 1.1];

    fn law() -> PlasticSection {
        PlasticSection { params: (0..10).collect(), own: 10, joints: 0..1, rest: vec![[0.1, -0.05, 0.3]] }
    }

    #[test]
    fn its_derivatives_are_its_slopes() {
        for past in [[0.1, -0.3, 0.2], [0.35, -0.1, 0.4], [0.9, 0.6, 0.0]] {
            check::slopes(&AutomaticMemory::new(law()), &THETA, past);
            check::slopes(&AutomaticMemory::new(stiffening()), &stiff(0.06), past);
        }
    }

    /// That stiffens, and θ with such a coefficient.
    fn stiffening() -> PlasticSection {
        PlasticSection { params: (0..11).collect(), own: 11, ..law() }
    }

    fn stiff(c: f64) -> Vec<f64> {
        [&THETA[..10], &[c], &THETA[10..]].concat()
    }

    /// Within the yield the slopes are those of an elastic section, by hand.
    #[test]
    fn within_the_yield_the_kernel_is_the_law() {
        for (law, mut theta) in [(law(), THETA.to_vec()), (stiffening(), stiff(0.06))] {
            theta[8] = 1e3;
            let at = SectionState { joint: 0, fraction: 0.2, strain: [0.3; 3], past: [0.2; 3], memory: [0.01; 3], elapsed: 0.02 };
            assert!(law.add_by_hand(&at, &theta, &mut Moments::default()));
            check::slopes(&AutomaticMemory::new(law), &theta, [0.2, -0.1, 0.4]);
        }
    }

    /// Beyond the yield too, the moment is that of the elastic law at the elastic part; without a coefficient to the last bit the one without.
    #[test]
    fn what_is_elastic_stiffens() {
        use super::super::StiffeningSection;
        let (strain, past) = ([0.9, -0.4, 0.5], [0.85, -0.4, 0.1]);
        let state = SectionState { joint: 0, fraction: 0.2, strain, past, memory: [0.4, -0.1, 0.0], elapsed: 0.01 };
        assert_eq!(stiffening().moment(&state, &stiff(0.0)), law().moment(&state, &THETA));
        let Flowed { strain, elastic, .. } = law().flowed(&state, &THETA);
        assert!(dot(elastic, elastic).sqrt() > 1.2 * 0.7 * 0.2, "{elastic:?}");
        // a section whose strain without that at rest is the elastic part
        let beside = StiffeningSection { params: std::array::from_fn(|k| k), own: 9, joints: 0..1, rest: vec![[0.0; 3]] };
        let mut theta = [&THETA[..8], &[0.06], &THETA[10..]].concat();
        for k in [5, 6, 7, 9, 10] {
            theta[k] = 0.0;
        }
        let (sin, cos) = THETA[4].sin_cos();
        let turned = [elastic[0] * cos - elastic[1] * sin, elastic[0] * sin + elastic[1] * cos, strain[2]];
        let more = beside.moment(0, 0.2, &turned, &[0.0; 3], &theta);
        let (with, without) = (stiffening().moment(&state, &stiff(0.06)), law().moment(&state, &THETA));
        (0..3).for_each(|s| assert_relative_eq!(with[s] - without[s], more[s], max_relative = 1e-10, epsilon = 1e-15));
        let energy = stiffening().energy(&state, &stiff(0.06)) - law().energy(&state, &THETA);
        assert_relative_eq!(energy, beside.energy(0, 0.2, &turned, &theta), max_relative = 1e-10);
    }

    #[test]
    fn within_the_yield_it_is_the_elastic_section() {
        let elastic = ElasticSection { params: [0, 1, 2, 3, 4, 5, 6, 7], own: 10, joints: 0..1, rest: vec![[0.1, -0.05, 0.3]] };
        let strain = [0.2, -0.1, 0.5];
        let state = SectionState { joint: 0, fraction: 0.2, strain, past: [0.15, -0.05, 0.1], memory: [0.0; 3], elapsed: 0.01 };
        let mut theta = THETA;
        theta[8] = 5.0;
        let without = [&THETA[..8], &THETA[10..]].concat();
        let (a, b) = (law().moment(&state, &theta), elastic.moment(0, 0.2, &strain, &[0.0; 3], &without));
        (0..3).for_each(|s| assert_relative_eq!(a[s], b[s], max_relative = 1e-14));
    }
}
