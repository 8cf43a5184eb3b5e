//! A joint that follows another, or is held: gears, belts, screws.
//!
//! ```text
//! q₂ − p(d) = −C f,      p(d) = c₀ + c₁ d + … + c₄ d⁴,      d = q₁ − ref
//! ```
//! with the force f [N·m or N] on the joint that follows and −p′(d) f on the one that leads, which is the same power. The compliance C
//! [rad/(N·m) or m/N] is that of the scene, and what gives way by a rest gap under the weight of the inertia at the coupling: as hard
//! as a stop. It holds at the end of a step, so it does not drift. The impulse γ = h f is eliminated as those of friction and stops are:
//! ```text
//! F = ρ ((q₂ − p(d))/h + C γ/h²) = 0          [N·m·s or N·s]
//! ```

use super::joint_law::{RowLinear, RowPoint};

/// One joint's coordinate as a polynomial of another's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Degree of freedom and coordinate of the joint that leads, counted from the first of the bodies', and the index in θ of ref;
    /// none if the other is held at c₀.
    pub lead: Option<Lead>,
    /// First index in θ of the coefficients.
    pub coefficients: usize,
    /// How many there are.
    pub count: usize,
    /// Index in θ of the scene's part of the compliance, if it has one.
    pub compliance: Option<usize>,
    /// Inertia seen from the joint that follows, as the scene begins, all other joints held or yielding [kg·m² or kg]. They do not
    /// follow θ.
    pub held: f64,
    /// All others yielding.
    pub yielding: f64,
}

/// The joint that leads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Degree of freedom.
    pub dof: usize,
    /// Coordinate.
    pub q: usize,
    /// Index in θ of ref.
    pub reference: usize,
}

impl Coupling {
    /// p, p′ and p″ at d, by Horner's rule.
    fn polynomial(&self, d: f64, theta: &[f64]) -> [f64; 3] {
        let coefficients = &theta[self.coefficients..self.coefficients + self.count];
        coefficients.iter().rev().fold([0.0; 3], |[p, slope, bend], c| [p * d + c, slope * d + p, bend * d + 2.0 * slope])
    }

    /// d, 0 if nobody leads.
    fn distance(&self, lead: f64, theta: &[f64]) -> f64 {
        self.lead.map_or(0.0, |joint| lead - theta[joint.reference])
    }

    /// Where the joint that follows should be, for the coordinate `lead` of the one that leads [rad or m]; and how fast that moves.
    pub fn wanted(&self, lead: f64, theta: &[f64]) -> [f64; 2] {
        let [p, slope, _] = self.polynomial(self.distance(lead, theta), theta);
        [p, slope]
    }

    /// Impulse on the joint that leads per unit of γ, −p′(d).
    pub(crate) fn lever(&self, at: &RowPoint, theta: &[f64]) -> f64 {
        -self.wanted(at.lead, theta)[1]
    }

    /// Compliance over h² [1/(kg·m²) or 1/kg].
    fn compliance_per_h2(&self, at: &RowPoint, theta: &[f64]) -> f64 {
        (self.compliance.map_or(0.0, |k| theta[k]) + at.rest_gap / at.weight) / (at.h * at.h)
    }

    /// F.
    pub(crate) fn residual(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> f64 {
        at.rho * ((at.q - self.wanted(at.lead, theta)[0]) / at.h + self.compliance_per_h2(at, theta) * gamma)
    }

    /// F and its derivatives.
    pub(crate) fn linearize(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> RowLinear {
        let [p, slope, bend] = self.polynomial(self.distance(at.lead, theta), theta);
        let compliance_per_h2 = self.compliance_per_h2(at, theta);
        RowLinear {
            f: at.rho * ((at.q - p) / at.h + compliance_per_h2 * gamma),
            f_q: at.rho / at.h,
            f_v: 0.0,
            f_gamma: at.rho * compliance_per_h2,
            lever: -slope,
            lever_bend: -bend,
        }
    }

    /// ∂F/∂θ and ∂lever/∂θ of each number it reads.
    pub(crate) fn visit_theta(&self, at: &RowPoint, gamma: f64, theta: &[f64], visit: &mut dyn FnMut(usize, [f64; 2])) {
        let d = self.distance(at.lead, theta);
        let mut power = [1.0, 0.0]; // dᵏ and k dᵏ⁻¹
        for k in 0..self.count {
            visit(self.coefficients + k, [-at.rho / at.h * power[0], -power[1]]);
            power = [power[0] * d, (k + 1) as f64 * power[0]];
        }
        if let Some(joint) = self.lead {
            let [_, slope, bend] = self.polynomial(d, theta);
            visit(joint.reference, [at.rho / at.h * slope, bend]);
        }
        if let Some(compliance) = self.compliance {
            visit(compliance, [at.rho * gamma / (at.h * at.h), 0.0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const THETA: [f64; 7] = [0.2, -1.5, 0.7, 0.3, -0.4, 0.15, 1e-3];

    fn coupling() -> Coupling {
        let lead = Some(Lead { dof: 0, q: 0, reference: 5 });
        Coupling { lead, coefficients: 0, count: 5, compliance: Some(6), held: 0.1, yielding: 0.08 }
    }

    fn point(q: f64, lead: f64) -> RowPoint {
        RowPoint { q, lead, v: 0.0, h: 0.01, rest_gap: 1e-6, sharpness: 1.0, weight: 1.0, rho: 0.02, load: 0.0 }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let (c, step) = (coupling(), 1e-6);
        let at = |lead: f64| c.linearize(&point(0.9, lead), 0.3, &THETA);
        let here = at(0.6);
        let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-8 * b.abs().max(1.0), "{a} {b}");
        // F depends on the leading coordinate by lever times the way it depends on the other
        close((at(0.6 + step).f - at(0.6 - step).f) / (2.0 * step), here.lever * here.f_q);
        close((at(0.6 + step).lever - at(0.6 - step).lever) / (2.0 * step), here.lever_bend);
        let gamma = |g: f64| c.residual(&point(0.9, 0.6), g, &THETA);
        close(gamma(1.3) - gamma(0.3), here.f_gamma);
        assert_eq!(here.f, gamma(0.3));
        let mut seen = Vec::new();
        c.visit_theta(&point(0.9, 0.6), 0.3, &THETA, &mut |k, by| {
            let moved = |s: f64| {
                let mut theta = THETA;
                theta[k] += s;
                [c.residual(&point(0.9, 0.6), 0.3, &theta), c.lever(&point(0.9, 0.6), &theta)]
            };
            let (up, down) = (moved(step), moved(-step));
            (0..2).for_each(|i| close((up[i] - down[i]) / (2.0 * step), by[i]));
            seen.push(k);
        });
        assert_eq!(seen, [0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn nobody_need_lead() {
        let held = Coupling { lead: None, count: 1, compliance: None, ..coupling() };
        let linear = held.linearize(&point(0.9, 0.0), 0.0, &THETA);
        assert!((linear.f - 0.02 * 0.7 / 0.01).abs() < 1e-15, "{}", linear.f);
        assert_eq!((linear.lever, linear.lever_bend), (0.0, 0.0));
    }
}
