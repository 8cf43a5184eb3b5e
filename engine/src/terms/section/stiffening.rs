//! A section that becomes stiffer, or softer, the more it is bent.

use super::elastic::excess;
use super::{AutomaticSection, Moments, Section, SectionLaw, SectionPoint};
use pliant_math::Real;
use std::ops::Range;
use std::sync::Arc;

/// Bending energy beyond the quadratic term: with k the strains in the principal axes without those at rest, as in [`super::ElasticSection`],
/// x = k/l the curvature at a joint of length l and s the joint's stiffness as a multiple of the rod's,
/// ```text
/// E = ¼ c s (EI₁ x₁² + EI₂ x₂²) |x|² l,     M₁ = c s x₁ [EI₁ x₁² + ½ (EI₁ + EI₂) x₂²]
/// ```
/// beside the elastic section: M = EI x (1 + c |x|²) where the section is round, and towards either principal axis alone, M₁ = EI₁ x₁ (1 + c x₁²).
/// It is the first term that an elastic law without a preferred side may have beyond Hooke's: of a round section whose fibres have the
/// stress E (ε + b ε³), ∫ E b ε³ y dA = E b π r⁶ x³/8 gives c = b r²/2. Twisting stays linear.
///
/// Parameters: those of the elastic section (rod length \[m\], EI₁, EI₂, GJ [N·m²], roll \[rad\], κ̄₁, κ̄₂ [1/m], τ̄ [rad/m]), then c \[m²\], of
/// either sign; of every joint κ̄₁, κ̄₂ [1/m] and s [-]. Limits: c = 0 adds nothing, exactly. c > 0: convex while neither stiffness is more than
/// 17 + 12√2 = 34 times the other. c < 0, softening: the moment is largest, ⅔ EI x, at |x| = 1/√(−3c), falls beyond and pulls on beyond
/// 1/√(−c), which no bound of c can exclude, since curvature has none; the law is meant for what stays below.
#[derive(Clone, Debug)]
pub struct StiffeningSection {
    /// Indices in θ, in the order above.
    pub params: [usize; 9],
    /// Index in θ of the first joint's own, three each.
    pub own: usize,
    /// The joints it belongs to.
    pub joints: Range<usize>,
    /// Strains at rest, joint by joint.
    pub rest: Vec<[f64; 3]>,
}

/// The moments that bending `x` [-] of the stiffnesses `k` over the length meets beyond the elastic ones, towards the principal axes; `c`:
/// the coefficient over the square of the joint's length [-].
pub(super) fn beyond<S: Real>(k: [S; 2], x: [S; 2], c: S) -> [S; 2] {
    let (mean, squares) = ((k[0] + k[1]) * 0.5, x.map(|x| x * x));
    [c * x[0] * (k[0] * squares[0] + mean * squares[1]), c * x[1] * (k[1] * squares[1] + mean * squares[0])]
}

/// Their slopes by `x`: ∂M₁/∂x₁, ∂M₂/∂x₂ and ∂M₁/∂x₂ = ∂M₂/∂x₁.
pub(super) fn slopes_beyond(k: [f64; 2], x: [f64; 2], c: f64) -> [f64; 3] {
    let (mean, squares) = (0.5 * (k[0] + k[1]), x.map(|x| x * x));
    let own = [0, 1].map(|a| c * (3.0 * k[a] * squares[a] + mean * squares[1 - a]));
    [own[0], own[1], 2.0 * c * mean * x[0] * x[1]]
}

/// The energy of the same.
pub(super) fn energy_beyond<S: Real>(k: [S; 2], x: [S; 2], c: S) -> S {
    let squares = x.map(|x| x * x);
    c * (k[0] * squares[0] + k[1] * squares[1]) * (squares[0] + squares[1]) * 0.25
}

/// c over the square of the joint's length.
pub(super) fn by_length<S: Real>(c: S, length: S) -> S {
    c / (length * length)
}

impl StiffeningSection {
    fn rest(&self, joint: usize) -> &[f64; 3] {
        &self.rest[joint - self.joints.start]
    }

    /// Stiffnesses and strains of bending, c, all as [`beyond`] wants them.
    fn bent<S: Real>(&self, joint: usize, fraction: f64, strain: &[S; 3], p: &[S], roll: [S; 2]) -> ([S; 2], [S; 2], S) {
        let (x, k) = excess(self.rest(joint), fraction, strain, [p, &p[9..]], roll);
        ([k[0], k[1]], [x[0], x[1]], by_length(p[8], p[0] * fraction))
    }
}

impl Section for StiffeningSection {
    fn name(&self) -> &str {
        "stiffening rod"
    }

    fn params(&self) -> &[usize] {
        &self.params
    }

    fn own(&self, joint: usize) -> Range<usize> {
        let first = self.own + 3 * joint.saturating_sub(self.joints.start);
        first..first + 3
    }

    fn moment<S: Real>(&self, joint: usize, fraction: f64, strain: &[S; 3], _rate: &[S; 3], p: &[S]) -> [S; 3] {
        let (sin, cos) = p[4].sin_cos();
        let (k, x, c) = self.bent(joint, fraction, strain, p, [sin, cos]);
        let [m1, m2] = beyond(k, x, c);
        [m1 * cos - m2 * sin, m1 * sin + m2 * cos, S::zero()]
    }

    fn energy<S: Real>(&self, joint: usize, fraction: f64, strain: &[S; 3], p: &[S]) -> S {
        let (k, x, c) = self.bent(joint, fraction, strain, p, p[4].sin_cos().into());
        energy_beyond(k, x, c)
    }
}

/// [`StiffeningSection`] with its derivatives by hand.
#[derive(Clone, Debug)]
pub struct Stiffening(AutomaticSection<StiffeningSection>);

impl Stiffening {
    /// The law on its joints.
    pub fn new(law: StiffeningSection) -> Self {
        Self(AutomaticSection::new(law))
    }

    /// Whether the section does not stiffen.
    #[inline]
    fn is_silent(&self, at: &SectionPoint) -> bool {
        at.theta[self.0.law.params[8]] == 0.0
    }

    /// Stiffnesses, strains, c, and sine and cosine of the roll.
    #[inline]
    fn bent(&self, at: &SectionPoint) -> ([f64; 2], [f64; 2], f64, [f64; 2]) {
        let law = &self.0.law;
        let mut p = [0.0; 12];
        p.iter_mut().zip(&law.params).for_each(|(p, k)| *p = at.theta[*k]);
        p[9..].copy_from_slice(&at.theta[law.own(at.joint)]);
        // no section is rolled unless the scene says so
        let (sin, cos) = if p[4] == 0.0 { (0.0, 1.0) } else { p[4].sin_cos() };
        let (k, x, c) = law.bent(at.joint, at.fraction, &at.strain, &p, [sin, cos]);
        (k, x, c, [sin, cos])
    }
}

impl SectionLaw for Stiffening {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]) {
        if self.is_silent(at) {
            return;
        }
        let (k, x, c, [sin, cos]) = self.bent(at);
        let [m1, m2] = beyond(k, x, c);
        m[0] += m1 * cos - m2 * sin;
        m[1] += m1 * sin + m2 * cos;
    }

    fn add(&self, at: &SectionPoint, out: &mut Moments) {
        if self.is_silent(at) {
            return;
        }
        self.add_moment(at, &mut out.m);
        let (k, x, c, [sin, cos]) = self.bent(at);
        out.add_bending(slopes_beyond(k, x, c), [sin, cos]);
    }

    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3])) {
        self.0.visit_theta(at, visit);
    }

    fn energy(&self, at: &SectionPoint) -> f64 {
        self.0.energy(at)
    }

    fn resting(&self, strains: &[[f64; 3]]) -> Option<Arc<dyn SectionLaw>> {
        let law = StiffeningSection { rest: strains[self.0.law.joints.clone()].to_vec(), ..self.0.law.clone() };
        Some(Arc::new(Self::new(law)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::check;
    use super::*;
    use approx::assert_relative_eq;

    const THETA: [f64; 12] = [0.7, 0.02, 0.05, 0.013, 0.4, 1.5, -0.7, 2.0, 0.06, 0.3, -0.2, 1.1];

    fn law() -> StiffeningSection {
        let rest = vec![[0.1, -0.05, 0.3], [0.0; 3]];
        StiffeningSection { params: [0, 1, 2, 3, 4, 5, 6, 7, 8], own: 9, joints: 0..2, rest }
    }

    #[test]
    fn the_kernel_is_the_law() {
        let theta = [&THETA[..], &[-0.4, 0.6, 0.8]].concat();
        check::same(&Stiffening::new(law()), &AutomaticSection::new(law()), &theta);
    }

    #[test]
    fn moments_are_slopes_of_the_energy() {
        let at = [0.3, -0.2, 0.5];
        let m = law().moment(0, 0.2, &at, &[0.0; 3], &THETA);
        for s in 0..3 {
            let energy = |by: f64| {
                let mut x = at;
                x[s] += by;
                law().energy(0, 0.2, &x, &THETA)
            };
            assert!(((energy(1e-5) - energy(-1e-5)) / 2e-5 - m[s]).abs() < 1e-9);
        }
    }

    /// M = EI x c |x|² towards any side of a round section.
    #[test]
    fn a_round_section_knows_no_direction() {
        let (ei, c, l) = (0.03, 0.06, 0.14);
        for turn in [0.0, 0.7, 2.5] {
            let size: f64 = 5.0;
            let x = [size * f64::cos(turn), size * f64::sin(turn)];
            let m = beyond([ei / l; 2], x.map(|x| x * l), by_length(c, l));
            (0..2).for_each(|k| assert_relative_eq!(m[k], ei * c * size * size * x[k], max_relative = 1e-13));
        }
    }

    /// The moment of fibres, ∫ E b ε³ y dA over a round section with ε = x y, by quadrature.
    #[test]
    fn a_round_section_of_stiffening_fibres_has_this_coefficient() {
        let (young, b, r, x) = (3.0e9, 40.0, 0.004_f64, 7.0);
        let n = 100_000;
        let fibres: f64 = (0..n)
            .map(|k| {
                let angle = std::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(n);
                // y = r cos, chords of 2 r sin, dy = r sin
                let (y, chord) = (r * angle.cos(), 2.0 * r * angle.sin());
                young * b * (x * y).powi(3) * y * chord * r * angle.sin() * std::f64::consts::PI / f64::from(n)
            })
            .sum();
        let ei = young * std::f64::consts::PI * r.powi(4) / 4.0;
        assert_relative_eq!(fibres, ei * (b * r * r / 2.0) * x.powi(3), max_relative = 1e-9);
    }

    /// Smallest eigenvalue of the slope over all directions of bending.
    fn least(ratio: f64) -> f64 {
        let slope = |turn: f64| {
            let (sin, cos) = turn.sin_cos();
            let (k, mean) = ([1.0, ratio], 0.5 * (1.0 + ratio));
            let one = 3.0 * k[0] * cos * cos + mean * sin * sin;
            let two = 3.0 * k[1] * sin * sin + mean * cos * cos;
            let both = 2.0 * mean * sin * cos;
            0.5 * (one + two) - (0.25 * (one - two).powi(2) + both * both).sqrt()
        };
        (0..10_000).map(|k| slope(f64::from(k) * 3.2e-4)).fold(f64::MAX, f64::min)
    }

    #[test]
    fn it_is_convex_up_to_a_ratio_of_stiffnesses() {
        let limit = 17.0 + 12.0 * 2.0_f64.sqrt();
        assert!(least(0.99 * limit) > 0.0 && least(1.0 / (0.99 * limit)) > 0.0);
        assert!(least(1.01 * limit) < 0.0);
    }

    #[test]
    fn a_coefficient_of_zero_adds_nothing_but_its_slope() {
        let mut theta = THETA;
        theta[8] = 0.0;
        let law = Stiffening::new(law());
        let at = SectionPoint { strain: [0.3, 0.1, 0.2], ..check::resting(&theta) };
        let mut out = Moments::default();
        law.add(&at, &mut out);
        assert_eq!(out, Moments::default());
        let mut slope = [0.0; 3];
        law.visit_theta(&at, &mut |k, m| slope = if k == 8 { m } else { slope });
        assert!(slope[0].abs() > 1e-3, "{slope:?}");
    }
}
