//! Viscous resistance to bending and twisting.

use super::{AutomaticSection, Moments, Section, SectionLaw, SectionPoint};
use pliant_math::Real;

/// M = (c_b κ̇₁, c_b κ̇₂, c_t τ̇)/l at a joint of length l: a Kelvin–Voigt section. The curvatures are those towards the material axes, so a
/// bent rod that spins about its own axis dissipates.
///
/// Parameters: rod length \[m\], c_b, c_t [N·m²·s].
#[derive(Clone, Debug)]
pub struct ViscousSection {
    /// Indices in θ, in the order above.
    pub params: [usize; 3],
}

impl Section for ViscousSection {
    fn name(&self) -> &str {
        "viscous rod"
    }

    fn params(&self) -> &[usize] {
        &self.params
    }

    fn moment<S: Real>(&self, _joint: usize, fraction: f64, _strain: &[S; 3], rate: &[S; 3], p: &[S]) -> [S; 3] {
        let by_length = (p[0] * fraction).recip();
        let (bend, twist) = (p[1] * by_length, p[2] * by_length);
        [bend * rate[0], bend * rate[1], twist * rate[2]]
    }
}

/// [`ViscousSection`] with its derivatives by hand.
#[derive(Clone, Debug)]
pub struct Viscous(AutomaticSection<ViscousSection>);

impl Viscous {
    /// The law.
    pub fn new(law: ViscousSection) -> Self {
        Self(AutomaticSection::new(law))
    }
}

impl SectionLaw for Viscous {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]) {
        let [length, bend, twist] = self.0.law.params.map(|k| at.theta[k]);
        let by_length = 1.0 / (length * at.fraction);
        for (s, c) in [bend, bend, twist].into_iter().enumerate() {
            m[s] += c * by_length * at.rate[s];
        }
    }

    fn add(&self, at: &SectionPoint, out: &mut Moments) {
        let [length, bend, twist] = self.0.law.params.map(|k| at.theta[k]);
        for (s, c) in [bend, bend, twist].into_iter().enumerate() {
            let c = c / (length * at.fraction);
            out.m[s] += c * at.rate[s];
            out.by_rate[s][s] += c;
        }
    }

    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3])) {
        self.0.visit_theta(at, visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_the_law() {
        let law = ViscousSection { params: [0, 1, 2] };
        let theta = [0.7, 0.02, 0.005];
        super::super::check::same(&Viscous::new(law.clone()), &AutomaticSection::new(law), &theta);
    }
}
