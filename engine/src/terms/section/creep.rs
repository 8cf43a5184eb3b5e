//! A section part of whose stiffness relaxes.

use super::{RememberingSection, SectionState};
use crate::terms::joint::relax;
use pliant_math::Real;
use std::ops::Range;

/// A Maxwell element, a spring in series with a damper, beside the elastic section (standard linear solid). Of the strains it has
/// an elastic part e that relaxes:
/// ```text
/// M = R(roll) diag(s g EI₁, s g EI₂, g_t GJ) R(−roll) e/l,     ė = ε̇ − e/τ
/// ```
/// The section's own stiffnesses are those of long times; what changes fast meets (1 + g) times as much. A step takes e from its
/// beginning to where the moment is evaluated at constant rate, exactly: e⁺ = E e + (τ/t)(1 − E) Δε, E = e^{−t/τ}, whatever t/τ is.
/// The strains are those towards the axes half way, so that a turn of the whole rod changes nothing.
///
/// Parameters: rod length \[m\], EI₁, EI₂, GJ [N·m²], roll \[rad\], g, g_t [-] ≥ 0, τ \[s\] > 0; of every joint s [-], its stiffness
/// as a multiple of the rod's. Memory: e, zero as the scene begins: a rod that
/// has had its initial shape for ever. Energy ½ g EI e²/l. Limits: g = 0 nothing; τ → ∞ an elastic section of its own that is at rest in the
/// initial shape; τ → 0 a viscous one, M = g τ EI ε̇/l.
#[derive(Clone, Debug)]
pub struct CreepSection {
    /// Indices in θ, in the order above.
    pub params: [usize; 8],
    /// Index in θ of the first joint's s.
    pub own: usize,
    /// From one joint's to the next's.
    pub stride: usize,
    /// The first joint it belongs to.
    pub first: usize,
}

/// e where the moment is evaluated.
fn elastic<S: Real>(at: &SectionState<S>, p: &[S]) -> [S; 3] {
    if at.elapsed <= 0.0 {
        return at.memory;
    }
    std::array::from_fn(|s| relax(at.memory[s], at.strain[s] - at.past[s], at.elapsed, p[7], None))
}

impl RememberingSection for CreepSection {
    fn name(&self) -> &str {
        "creeping rod"
    }

    fn params(&self) -> &[usize] {
        &self.params
    }

    fn own(&self, joint: usize) -> Range<usize> {
        let k = self.own + self.stride * joint.saturating_sub(self.first);
        k..k + 1
    }

    fn memory(&self) -> &'static [&'static str] {
        &["creep[0]", "creep[1]", "creep[2]"]
    }

    fn moment<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        let (e, by_length) = (elastic(at, p), (p[0] * at.fraction).recip());
        let (sin, cos) = p[4].sin_cos();
        let bend = p[8] * p[5] * by_length;
        let (m1, m2) = (p[1] * bend * (e[0] * cos + e[1] * sin), p[2] * bend * (e[1] * cos - e[0] * sin));
        [m1 * cos - m2 * sin, m1 * sin + m2 * cos, p[3] * p[6] * by_length * e[2]]
    }

    fn advance<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3] {
        elastic(at, p)
    }

    fn silent(&self, p: &[f64]) -> bool {
        p[5] == 0.0 && p[6] == 0.0
    }

    fn energy<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> S {
        let (m, e) = (self.moment(at, p), elastic(at, p));
        (m[0] * e[0] + m[1] * e[1] + m[2] * e[2]) * 0.5
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{AutomaticMemory, SectionLaw, check};
    use super::*;
    use approx::assert_relative_eq;

    const THETA: [f64; 9] = [0.7, 0.02, 0.05, 0.013, 0.4, 0.6, 0.3, 0.07, 1.2];

    fn law() -> CreepSection {
        CreepSection { params: [0, 1, 2, 3, 4, 5, 6, 7], own: 8, stride: 0, first: 0 }
    }

    fn state(strain: [f64; 3], past: [f64; 3], memory: [f64; 3], elapsed: f64) -> SectionState<f64> {
        SectionState { joint: 0, fraction: 0.2, strain, past, memory, elapsed }
    }

    /// A strain that is held: M = g K ε e^{−t/τ}/l, in however many steps.
    #[test]
    fn a_held_strain_relaxes_exponentially() {
        let strain = [0.3, -0.2, 0.5];
        let whole = law().moment(&state(strain, strain, strain, 0.0), &THETA);
        for n in [1, 7, 100] {
            let h = 0.2 / f64::from(n);
            let mut e = strain;
            (0..n).for_each(|_| e = law().advance(&state(strain, strain, e, h), &THETA));
            let m = law().moment(&state(strain, strain, e, 0.0), &THETA);
            (0..3).for_each(|s| assert_relative_eq!(m[s], whole[s] * (-0.2_f64 / 0.07).exp(), max_relative = 1e-13));
        }
    }

    /// A strain that grows evenly: e = rate τ (1 − e^{−t/τ}), in however many steps.
    #[test]
    fn a_ramp_does_not_know_the_step() {
        let rate = [2.0, -0.7, 0.4];
        for n in [1, 3, 64] {
            let h = 0.3 / f64::from(n);
            let at = |k: u32| rate.map(|r| r * h * f64::from(k));
            let mut e = [0.0; 3];
            (0..n).for_each(|k| e = law().advance(&state(at(k + 1), at(k), e, h), &THETA));
            (0..3).for_each(|s| assert_relative_eq!(e[s], rate[s] * 0.07 * -(-0.3_f64 / 0.07).exp_m1(), max_relative = 1e-13));
        }
    }

    #[test]
    fn its_derivatives_are_its_slopes() {
        check::slopes(&AutomaticMemory::new(law()), &THETA, [0.1, -0.3, 0.2]);
    }

    #[test]
    fn nothing_is_left_of_it_without_a_fraction_but_the_slope() {
        let mut theta = THETA;
        (theta[5], theta[6]) = (0.0, 0.0);
        let law = AutomaticMemory::new(law());
        let at =
            super::super::SectionPoint { strain: [0.3, 0.1, 0.2], elapsed: 0.01, memory: &[0.0; 3], ..check::resting(&theta) };
        let mut m = [0.0; 3];
        law.add_moment(&at, &mut m);
        assert_eq!(m, [0.0; 3]);
        let mut slope = [0.0; 3];
        law.visit_theta(&at, &mut |k, m| slope = if k == 5 { m } else { slope });
        assert!(slope[0].abs() > 1e-3, "{slope:?}");
    }
}
