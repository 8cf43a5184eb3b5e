//! Elastic bending and twisting of a section with two principal axes.

use super::{AutomaticSection, Moments, Section, SectionLaw, SectionPoint};
use pliant_math::Real;
use std::ops::Range;
use std::sync::Arc;

/// E = ½ [s EI₁ (k₁ − κ̄₁ l)² + s EI₂ (k₂ − κ̄₂ l)² + GJ (τ − τ₀ − τ̄ l)²]/l at a joint of length l, with the curvatures towards the
/// principal axes, (k₁, k₂) = R(−roll) (κ₁ − κ₀₁, κ₂ − κ₀₂). κ₀, τ₀: strains of the rest shape; κ̄, τ̄: what is added to it per length, κ̄ of
/// the whole rod and of this joint together; s: the joint's stiffness as a multiple of the rod's.
///
/// Parameters: rod length \[m\], EI₁, EI₂, GJ [N·m²], roll of the principal axes about the edge from the material axes \[rad\], κ̄₁, κ̄₂
/// [1/m], τ̄ [rad/m]; of every joint κ̄₁, κ̄₂ [1/m] and s [-]. Reference: Bergou et al. 2010, Discrete Viscous Threads, §3, with curvatures of their own for both axes.
#[derive(Clone, Debug)]
pub struct ElasticSection {
    /// Indices in θ, in the order above.
    pub params: [usize; 8],
    /// Index in θ of the first joint's own, three each.
    pub own: usize,
    /// The joints it belongs to.
    pub joints: Range<usize>,
    /// Strains at rest, joint by joint.
    pub rest: Vec<[f64; 3]>,
}

impl ElasticSection {
    fn rest(&self, joint: usize) -> &[f64; 3] {
        &self.rest[joint - self.joints.start]
    }
}

/// Strains beyond rest in the principal axes, and the stiffnesses over the length.
pub(super) fn excess<S: Real>(
    rest: &[f64; 3],
    fraction: f64,
    strain: &[S; 3],
    [p, own]: [&[S]; 2],
    [sin, cos]: [S; 2],
) -> ([S; 3], [S; 3]) {
    let length = p[0] * fraction;
    let (x, y) = (strain[0] - rest[0], strain[1] - rest[1]);
    let bent = [x * cos + y * sin - (p[5] + own[0]) * length, y * cos - x * sin - (p[6] + own[1]) * length];
    let excess = [bent[0], bent[1], strain[2] - rest[2] - p[7] * length];
    (excess, [own[2] * p[1] / length, own[2] * p[2] / length, p[3] / length])
}

impl Section for ElasticSection {
    fn name(&self) -> &str {
        "elastic rod"
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
        let (e, k) = excess(self.rest(joint), fraction, strain, [p, &p[8..]], [sin, cos]);
        let (m1, m2) = (k[0] * e[0], k[1] * e[1]);
        [m1 * cos - m2 * sin, m1 * sin + m2 * cos, k[2] * e[2]]
    }

    fn energy<S: Real>(&self, joint: usize, fraction: f64, strain: &[S; 3], p: &[S]) -> S {
        let (e, k) = excess(self.rest(joint), fraction, strain, [p, &p[8..]], p[4].sin_cos().into());
        (k[0] * e[0] * e[0] + k[1] * e[1] * e[1] + k[2] * e[2] * e[2]) * 0.5
    }
}

/// [`ElasticSection`] with its derivatives by hand.
#[derive(Clone, Debug)]
pub struct Elastic(AutomaticSection<ElasticSection>);

impl Elastic {
    /// The law on its joints.
    pub fn new(law: ElasticSection) -> Self {
        Self(AutomaticSection::new(law))
    }

    /// The moment, the stiffnesses over the length, and sine and cosine of the roll.
    #[inline]
    fn moment(&self, at: &SectionPoint) -> ([f64; 3], [f64; 3], [f64; 2]) {
        let mut p = [0.0; 11];
        p.iter_mut().zip(&self.0.law.params).for_each(|(p, k)| *p = at.theta[*k]);
        p[8..].copy_from_slice(&at.theta[self.0.law.own(at.joint)]);
        // no section is rolled unless the scene says so
        let (sin, cos) = if p[4] == 0.0 { (0.0, 1.0) } else { p[4].sin_cos() };
        let (e, k) = excess(self.0.law.rest(at.joint), at.fraction, &at.strain, [&p, &p[8..]], [sin, cos]);
        let (m1, m2) = (k[0] * e[0], k[1] * e[1]);
        ([m1 * cos - m2 * sin, m1 * sin + m2 * cos, k[2] * e[2]], k, [sin, cos])
    }
}

impl SectionLaw for Elastic {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]) {
        let (of_strain, ..) = self.moment(at);
        m.iter_mut().zip(of_strain).for_each(|(m, by)| *m += by);
    }

    fn add(&self, at: &SectionPoint, out: &mut Moments) {
        let (m, k, [sin, cos]) = self.moment(at);
        out.m.iter_mut().zip(m).for_each(|(m, by)| *m += by);
        out.add_bending([k[0], k[1], 0.0], [sin, cos]);
        out.by_strain[2][2] += k[2];
    }

    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3])) {
        self.0.visit_theta(at, visit);
    }

    fn energy(&self, at: &SectionPoint) -> f64 {
        self.0.energy(at)
    }

    fn resting(&self, strains: &[[f64; 3]]) -> Option<Arc<dyn SectionLaw>> {
        let joints = self.0.law.joints.clone();
        let law = ElasticSection { rest: strains[joints].to_vec(), ..self.0.law.clone() };
        Some(Arc::new(Self::new(law)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_the_law() {
        let law =
            ElasticSection { params: [0, 1, 2, 3, 4, 5, 6, 7], own: 8, joints: 0..2, rest: vec![[0.0; 3], [0.1, -0.05, 0.3]] };
        let theta = [0.7, 0.02, 0.05, 0.013, 0.4, 1.5, -0.7, 2.0, 0.3, -0.2, 1.1, -0.4, 0.6, 0.8];
        super::super::check::same(&Elastic::new(law.clone()), &AutomaticSection::new(law), &theta);
    }

    #[test]
    fn moments_are_slopes_of_the_energy() {
        let law = ElasticSection { params: [0, 1, 2, 3, 4, 5, 6, 7], own: 8, joints: 0..1, rest: vec![[0.1, -0.05, 0.3]] };
        let p = [0.7, 0.02, 0.05, 0.013, 0.4, 1.5, -0.7, 2.0, 0.3, -0.2, 1.1];
        let at = [0.3, -0.2, 0.5];
        let m = law.moment(0, 0.2, &at, &[0.0; 3], &p);
        for s in 0..3 {
            let energy = |by: f64| {
                let mut x = at;
                x[s] += by;
                law.energy(0, 0.2, &x, &p)
            };
            assert!(((energy(1e-5) - energy(-1e-5)) / 2e-5 - m[s]).abs() < 1e-9);
        }
    }
}
