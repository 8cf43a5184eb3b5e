//! A force of one's own on a node.

use super::{Automatic, Law, Vec3};
use pliant_math::Real;
use pliant_math::formula::Formula;

/// f_a = s F_a(x, y, z, vx, vy, vz, p), a = x, y, z, by three formulas F of the node's position \[m\] and velocity [m/s] in the world's
/// axes and of parameters p.
///
/// Nodes: one. Either all F are forces \[N\]: parameters p, no constant, s = 1. Or they are densities, [N/m] of a rope and [N/m²] of a
/// sheet: parameters are then the length \[m\] or the area \[m²\] and p, and the constant is the part of it that belongs to the node;
/// s is the product of both. No energy is known. Non-smooth points and their slopes are those of [`pliant_math::formula`]; where a
/// formula is not defined the force is not finite, and the step fails with an error that names it.
#[derive(Clone, Debug)]
pub struct ByFormulas {
    /// `force` and the name that the scene gives it.
    pub name: String,
    /// F, one per axis.
    pub formulas: Vec<Formula>,
}

/// Position and velocity.
const VARIABLES: usize = 6;

impl Law for ByFormulas {
    fn name(&self) -> &str {
        &self.name
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let (scale, own) = match (constants, p) {
            ([fraction], [extent, own @ ..]) => (Some(*extent * *fraction), own),
            _ => (None, p),
        };
        let mut values = [S::zero(); VARIABLES + Automatic::<Self>::MAX_PARAMS];
        let given = q[0].iter().chain(v[0].iter()).chain(own);
        values.iter_mut().zip(given).for_each(|(value, given)| *value = *given);
        for (f, formula) in f[0].iter_mut().zip(&self.formulas) {
            let density = formula.eval(&values);
            *f += scale.map_or(density, |scale| density * scale);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::{Drag, Point, Term, check};

    fn law(texts: [&str; 3], own: &[&str]) -> ByFormulas {
        let names: Vec<&str> = ["x", "y", "z", "vx", "vy", "vz"].iter().chain(own).copied().collect();
        let formulas = texts.iter().map(|text| Formula::parse(text, &names).unwrap()).collect();
        ByFormulas { name: "force".to_owned(), formulas }
    }

    /// Force and all derivatives, also by the length that a density is per.
    #[test]
    fn drag_as_a_density_is_drag() {
        let own = ["linear", "quadratic", "w0", "w1", "w2"];
        let speed = "sqrt((vx - w0)**2 + (vy - w1)**2 + (vz - w2)**2)";
        let texts = ["vx - w0", "vy - w1", "vz - w2"].map(|u| format!("-(linear + quadratic*{speed})*({u})"));
        let elements = check::elements(1, 6);
        let law = law([&texts[0], &texts[1], &texts[2]], &own);
        let (known, own) = (Drag::new(elements.clone()), Automatic::new(law, elements));
        let sample = check::Sample::new(3);
        let [a, b] = [&known as &dyn Term, &own].map(|term| check::dense(term, &sample.at()));
        let pairs = [(a.dq, b.dq), (a.dv, b.dv), (a.dtheta, b.dtheta)];
        assert!((&a.f - &b.f).norm() < 1e-13 * a.f.norm(), "{} N apart of {}", (&a.f - &b.f).norm(), a.f.norm());
        for (known, own) in pairs {
            assert!((&known - &own).norm() <= 1e-13 * known.norm(), "{} apart of {}", (&known - &own).norm(), known.norm());
        }
        assert!(!own.symmetric(&sample.theta)); // nobody knows of a formula
    }

    #[test]
    fn a_listed_node_has_the_whole_force() {
        let law = law(["a*x", "b*vy", "a + b*z"], &["a", "b"]);
        let element = crate::terms::Element { nodes: vec![1], params: vec![1, 0], constants: Vec::new() };
        let term = Automatic::new(law, vec![element]);
        let (q, v) = ([0.0, 0.0, 0.0, 2.0, 3.0, 5.0], [0.0, 0.0, 0.0, 7.0, 11.0, 13.0]);
        let mut f = [0.0; 6];
        term.add_force(&Point { q: &q, v: &v, theta: &[0.5, 10.0] }, &mut f);
        assert_eq!(f, [0.0, 0.0, 0.0, 20.0, 5.5, 12.5]);
    }
}
