//! A force from an energy alone.

use super::Law;
use super::automatic::{MAX_NODES, MAX_PARAMS};
use nalgebra::{Const, U1};
use num_dual::{Derivative, DualSVec};
use pliant_math::{Real, Vec3};
use std::fmt::Debug;

/// A potential energy on a small stencil of nodes, written once; [`FromEnergy`] makes it a [`Law`].
pub trait EnergyLaw: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Energy \[J\] of the element; `q`: positions \[m\] of its nodes, `p`: its parameters, `constants`: those of the
    /// [`Element`](super::Element).
    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S;
}

/// f = −∂E/∂q by dual numbers, three directions at a time, over whatever scalar the law is evaluated with.
///
/// With [`Automatic`](super::Automatic) around it the Jacobian comes from dual numbers of dual numbers: convenient, and an order
/// of magnitude slower than a force written out.
#[derive(Clone, Copy, Debug, Default)]
pub struct FromEnergy<E>(pub E);

impl<E: EnergyLaw> Law for FromEnergy<E> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let fixed = |x: S| DualSVec::<S, 3>::new(x, Derivative::none());
        let zero = fixed(S::zero());
        let (mut x, mut params) = ([Vec3::repeat(zero); MAX_NODES], [zero; MAX_PARAMS]);
        for (x, q) in x.iter_mut().zip(q) {
            *x = q.map(fixed);
        }
        for (param, &value) in params.iter_mut().zip(p) {
            *param = fixed(value);
        }
        for (k, f) in f.iter_mut().enumerate() {
            for (a, component) in x[k].iter_mut().enumerate() {
                component.eps = Derivative::derivative_generic(Const::<3>, U1, a);
            }
            let energy = self.0.energy(&x[..q.len()], &params[..p.len()], constants);
            if let Some(slope) = energy.eps.0 {
                *f -= slope;
            }
            x[k] = q[k].map(fixed);
        }
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        self.0.energy(q, p, constants)
    }

    /// A potential has symmetric second derivatives, and no force depends on velocities here.
    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::check;
    use crate::terms::{Automatic, Bend, BendLaw, Gravity, GravityLaw, Stretch, StretchLaw};

    /// The energy of a law, and nothing else of it.
    #[derive(Debug)]
    struct Only<L>(L);

    impl<L: Law> EnergyLaw for Only<L> {
        fn name(&self) -> &str {
            "energy only"
        }

        fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
            self.0.energy(q, p, constants)
        }
    }

    #[test]
    fn an_energy_alone_gives_the_forces_of_stretch_bend_and_gravity() {
        let elements = check::elements(2, 2);
        check::same(&Stretch::new(elements.clone()), &Automatic::new(FromEnergy(Only(StretchLaw)), elements));
        let elements = check::elements(3, 2);
        check::same(&Bend::new(elements.clone()), &Automatic::new(FromEnergy(Only(BendLaw)), elements));
        let elements = check::elements(1, 6);
        check::same(&Gravity::new(elements.clone()), &Automatic::new(FromEnergy(Only(GravityLaw)), elements));
    }
}
