//! Friction inside a section that does not know how fast it is bent.

use super::constants::SECTION;
use super::{RememberingSection, SectionState};
use pliant_math::Real;

/// Dahl's model of friction (1968; Bouc and Wen's with n = 1) as a law of two numbers: of bending k it has an elastic part e that is
/// forgotten along the way that k goes,
/// ```text
/// M = M_f e/(κ_f l),     ė = k̇ − |k̇| e/(κ_f l)
/// ```
/// beside whatever else the section has, at a joint of length l. Begun afresh, friction stiffens the rod by M_f/κ_f and tends to the moment
/// M_f against the way of bending, by 1 − exp(−κ/κ_f); turned round, it is met twice as stiffly. Between ±κ the loop takes up
/// 4 M_f (κ − κ_f tanh(κ/κ_f)) per length and cycle, however fast. It is the same to all sides, about the material axes half way: a
/// turn of the whole rod changes nothing, and a bent rod that spins about itself meets it. Twisting is without.
///
/// A way on a line, from `past` to where the moment is evaluated, is integrated exactly: with s = |Δk| and E = exp(−s/κ_f l),
/// e⁺ = E e + κ_f l (1 − E) Δk/s. So e does not depend on time, and on the steps only as far as these cut corners. Friction has a kink
/// where the way turns round, at s = 0 (its slopes there are those of loading and unloading), so s is √(|Δk|² + ε²) − ε with ε = 1e-11 κ_f l,
/// which has derivatives everywhere: at rest those of the elastic part, half way between loading and unloading. The moment is monotone in the
/// strain, and the power left over, M_f |k̇| |e|²/(κ_f l)², is not negative; nor is that of a whole step by Euler or midpoint.
///
/// Parameters: rod length \[m\], M_f [N·m] ≥ 0, κ_f [1/m] > 0. Memory: e [-], curvature times the joint's length, towards the material axes half way, zero as
/// the scene begins; |e| ≤ κ_f l if it begins so. Energy ½ M_f |e|²/(κ_f l). Limits: M_f = 0 nothing, exactly, but its slope;
/// κ_f → 0 dry friction of the moment M_f; κ_f → ∞ at one M_f/κ_f an elastic section at rest in the initial shape.
///
/// Reference: P. R. Dahl, A Solid Friction Model, The Aerospace Corporation, TOR-0158(3107-18)-1, 1968.
#[derive(Clone, Debug)]
pub struct DahlSection {
    /// Indices in θ, in the order above.
    pub params: [usize; 3],
}

/// (1 − e^{−y})/y.
fn mean_decay<S: Real>(y: S) -> S {
    if y.re() < SECTION.series {
        return (((y * (1.0 / 120.0) - 1.0 / 24.0) * y + 1.0 / 6.0) * y - 0.5) * y + 1.0;
    }
    -(-y).exp_m1() / y
}

/// The elastic part after `change` on a line, from `e`; `limit`: κ_f l. See [`DahlSection`].
pub fn stick<S: Real, const N: usize>(e: [S; N], change: [S; N], limit: S) -> [S; N] {
    let rounded = limit * SECTION.rounded;
    let square = change.iter().fold(S::zero(), |sum, x| sum + *x * *x);
    let way = square / ((square + rounded * rounded).sqrt() + rounded) / limit;
    let (kept, new) = ((-way).exp(), mean_decay(way));
    std::array::from_fn(|k| kept * e[k] + new * change[k])
}

/// 0 neither, 1 loads, 2 unloads, between which the law has its kink; `along`: e·Δk over the square of its limit.
pub(crate) fn phase(along: f64) -> u8 {
    if along.abs() < SECTION.rests { 0 } else { 1 + u8::from(along < 0.0) }
}

/// e where the moment is evaluated, and κ_f l.
fn elastic<S: Real>(at: &SectionState<S>, p: &[S]) -> ([S; 2], S) {
    let (e, limit) = ([at.memory[0], at.memory[1]], p[2] * p[0] * at.fraction);
    if at.elapsed <= 0.0 {
        return (e, limit);
    }
    (stick(e, [at.strain[0] - at.past[0], at.strain[1] - at.past[1]], limit), limit)
}

impl RememberingSection for DahlSection {
    fn name(&self) -> &str {
        "rod with friction"
    }

    fn params(&self) -> &[usize] {
        &self.params
    }

    fn memory(&self) -> &'static [&'static str] {
        &["friction[0]", "friction[1]"]
    }

    fn moment<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        let (e, limit) = elastic(at, p);
        [p[1] * (e[0] / limit), p[1] * (e[1] / limit), S::zero()]
    }

    fn advance<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        let (e, _) = elastic(at, p);
        [e[0], e[1], S::zero()]
    }

    fn silent(&self, p: &[f64]) -> bool {
        p[1] == 0.0
    }

    fn energy<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> S {
        let (e, limit) = elastic(at, p);
        p[1] * ((e[0] * e[0] + e[1] * e[1]) / limit) * 0.5
    }

    fn mode(&self, at: &SectionState<f64>, p: &[f64]) -> Option<u8> {
        let limit = p[2] * p[0] * at.fraction;
        let along: f64 = (0..2).map(|s| at.memory[s] * (at.strain[s] - at.past[s])).sum::<f64>() / (limit * limit);
        Some(phase(along))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{AutomaticMemory, SectionLaw, SectionPoint, check};
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::Dual64;

    const LIMIT: f64 = 0.07;
    const THETA: [f64; 3] = [0.7, 0.05, 0.5];

    fn size(x: [f64; 2]) -> f64 {
        x[0].hypot(x[1])
    }

    fn less(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        [a[0] - b[0], a[1] - b[1]]
    }

    /// e after a polygon of bending from zero.
    fn along(corners: &[[f64; 2]], n: u32) -> [f64; 2] {
        let mut e = [0.0; 2];
        for w in corners.windows(2) {
            let change = less(w[1], w[0]).map(|x| x / f64::from(n));
            (0..n).for_each(|_| e = stick(e, change, LIMIT));
        }
        e
    }

    /// e' = n − e/limit along a way of unit direction n, by many steps of second order.
    fn by_steps(mut e: [f64; 2], change: [f64; 2], n: u32) -> [f64; 2] {
        let h = size(change) / f64::from(n);
        let slope = |e: [f64; 2]| less(change.map(|x| x / size(change)), e.map(|x| x / LIMIT));
        for _ in 0..n {
            let (here, mut middle) = (slope(e), e);
            (0..2).for_each(|k| middle[k] += 0.5 * h * here[k]);
            let there = slope(middle);
            (0..2).for_each(|k| e[k] += h * there[k]);
        }
        e
    }

    #[test]
    fn it_is_its_differential_equation() {
        for (e, change) in [([0.0, 0.0], [0.1, 0.03]), ([0.05, 0.02], [-0.2, 0.1]), ([-0.03, 0.06], [0.002, 0.05])] {
            let (found, exact) = (stick(e, change, LIMIT), by_steps(e, change, 100_000));
            assert!(size(less(found, exact)) < 1e-10, "{found:?} {exact:?}");
        }
    }

    /// Ways on a line, and around corners that the steps do not cut, are the same in however many steps.
    #[test]
    fn it_does_not_know_the_step() {
        let corners = [[0.0, 0.0], [0.13, 0.02], [0.05, -0.04], [0.3, 0.2], [0.3, 0.1]];
        let once = along(&corners, 1);
        for n in [3, 100] {
            // every step forgets by up to the rounding of its length too little
            let bound = 4.0 * f64::from(n) * SECTION.rounded * LIMIT;
            assert!(size(less(along(&corners, n), once)) < bound, "{n}: {:?} {once:?}", along(&corners, n));
        }
    }

    /// Cycled between ±k, e comes to ±limit tanh(k/limit), and each loop takes up 4 limit (k − limit tanh(k/limit)).
    #[test]
    fn a_loop_has_its_area() {
        for k in [0.3 * LIMIT, LIMIT, 6.0 * LIMIT] {
            let n = 4000;
            let half = |mut e: f64, to: f64| {
                let (mut area, change) = (0.0, (2.0 * to) / f64::from(n));
                for _ in 0..n {
                    let middle = stick([e, 0.0], [0.5 * change, 0.0], LIMIT)[0];
                    let end = stick([e, 0.0], [change, 0.0], LIMIT)[0];
                    // Simpson's rule
                    area += change * (e + 4.0 * middle + end) / 6.0;
                    e = end;
                }
                (e, area)
            };
            let mut e = stick([0.0; 2], [k, 0.0], LIMIT)[0];
            let mut area = 0.0;
            for _ in 0..30 {
                let (down, one) = half(e, -k);
                let (up, two) = half(down, k);
                (e, area) = (up, one + two);
            }
            let turned = LIMIT * (k / LIMIT).tanh();
            assert_relative_eq!(e, turned, max_relative = 1e-6);
            assert_relative_eq!(area, 4.0 * LIMIT * (k - turned), max_relative = 1e-6);
        }
    }

    /// Pseudo-random numbers within ±1.
    fn random(k: u32) -> f64 {
        (f64::from(k) * 12.9898 + 0.3).sin() * 43758.5453 % 1.0
    }

    /// Wherever it goes, e stays within the circle, the moment is monotone, and no step by Euler or midpoint gives energy.
    #[test]
    fn it_is_monotone_and_passive() {
        let (mut e, mut worst) = ([0.0; 2], [f64::MAX; 3]);
        for k in 0..30_000 {
            let reach = LIMIT * 10.0_f64.powf(2.5 * random(3 * k) - 1.5);
            let change = [reach * random(3 * k + 1), reach * random(3 * k + 2)];
            let (end, middle) = (stick(e, change, LIMIT), stick(e, change.map(|x| 0.5 * x), LIMIT));
            assert!(size(end) <= LIMIT * (1.0 + 1e-9), "{end:?}");
            let work = |e: [f64; 2]| (e[0] * change[0] + e[1] * change[1]) / LIMIT;
            let stored = 0.5 * (size(end).powi(2) - size(e).powi(2)) / LIMIT;
            let scale = size(change).powi(2) / LIMIT;
            worst[0] = worst[0].min((work(end) - stored) / scale);
            worst[1] = worst[1].min((work(middle) - stored) / scale);
            let slope = [0, 1].map(|s| {
                let seed = std::array::from_fn(|k| Dual64::new(change[k], f64::from(u8::from(k == s))));
                stick(e.map(Dual64::from), seed, Dual64::from(LIMIT)).map(|x| x.eps)
            });
            let across = 0.5 * (slope[0][1] + slope[1][0]);
            let apart = (0.25 * (slope[0][0] - slope[1][1]).powi(2) + across * across).sqrt();
            worst[2] = worst[2].min(0.5 * (slope[0][0] + slope[1][1]) - apart);
            e = end;
        }
        println!("least work left over {:.1e}, {:.1e}, slope {:.1e}", worst[0], worst[1], worst[2]);
        assert!(worst.iter().all(|x| *x > -1e-9), "{worst:?}");
        // also where friction is turned round after it has been wholly built up
        for k in 0..4000 {
            let (s, turn) = (LIMIT * 10.0_f64.powf(f64::from(k) * 1e-3 - 3.0), f64::from(k) * 0.7);
            let (e, change) = ([-LIMIT * turn.cos(), -LIMIT * turn.sin()], [s, 0.0]);
            let (end, middle) = (stick(e, change, LIMIT), stick(e, [0.5 * s, 0.0], LIMIT));
            let stored = 0.5 * (size(end).powi(2) - size(e).powi(2));
            assert!(end[0] * s - stored >= -1e-12 * s * s && middle[0] * s - stored >= -1e-12 * s * s, "{k}");
        }
    }

    /// At rest the derivative is that of the elastic part; a little further on, that of loading or unloading.
    #[test]
    fn its_derivative_at_a_turn_is_half_way() {
        let slope = |at: f64| {
            stick([Dual64::from(LIMIT), Dual64::from(0.0)], [Dual64::new(at, 1.0), Dual64::from(0.0)], Dual64::from(LIMIT))[0].eps
        };
        assert_eq!(slope(0.0), 1.0);
        assert_relative_eq!(slope(1e-6), 0.0, epsilon = 1e-4);
        assert_relative_eq!(slope(-1e-6), 2.0, epsilon = 1e-4);
    }

    #[test]
    fn the_mean_of_a_decay_is_one_function() {
        for y in [1e-300, 1e-9, 0.5 * SECTION.series, 0.999_999 * SECTION.series, 1.000_001 * SECTION.series, 0.3] {
            let exact =
                if y < 0.1 { 1.0 - y / 2.0 + y * y / 6.0 - y.powi(3) / 24.0 + y.powi(4) / 120.0 } else { -f64::exp_m1(-y) / y };
            assert_relative_eq!(mean_decay(y), exact, max_relative = 1e-15);
        }
        let slope = |y: f64| mean_decay(Dual64::new(y, 1.0)).eps;
        assert_relative_eq!(slope(0.999_999 * SECTION.series), slope(1.000_001 * SECTION.series), max_relative = 1e-6);
    }

    fn law() -> AutomaticMemory<DahlSection> {
        AutomaticMemory::new(DahlSection { params: [0, 1, 2] })
    }

    #[test]
    fn its_derivatives_are_its_slopes() {
        for past in [[0.1, -0.3, 0.2], [0.29, -0.22, 0.4], [0.3, -0.6, 0.0]] {
            check::slopes(&law(), &THETA, past);
        }
    }

    #[test]
    fn a_moment_of_zero_adds_nothing_but_its_slope() {
        let theta = [0.7, 0.0, 0.5];
        let at = SectionPoint { strain: [0.3, 0.1, 0.2], elapsed: 0.01, memory: &[0.01, 0.02], ..check::resting(&theta) };
        let mut out = super::super::Moments::default();
        law().add(&at, &mut out);
        assert_eq!(out, super::super::Moments::default());
        let mut slope = [0.0; 3];
        law().visit_theta(&at, &mut |k, m| slope = if k == 1 { m } else { slope });
        assert!(slope[0].abs() > 1e-3, "{slope:?}");
        let mut z = [0.0; 2];
        law().advance(&at, &mut z);
        assert!(z[0] > 0.02, "{z:?}");
    }
}
