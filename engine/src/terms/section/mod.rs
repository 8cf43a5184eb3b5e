//! What bending and twisting a rod's section costs: one file per effect.
//!
//! A [`Section`] is written once, for one joint, as the moment it makes of the joint's strains and their rates; dual numbers give its
//! derivatives ([`AutomaticSection`]). Geometry stands elsewhere ([`crate::rods`]), so that a new effect is a few lines.

mod automatic;
mod elastic;
mod viscous;

pub use automatic::AutomaticSection;
pub use elastic::{Elastic, ElasticSection};
pub use viscous::{Viscous, ViscousSection};

use super::Real;
use std::fmt::Debug;
use std::sync::Arc;

/// A joint's strains: curvatures towards the two material axes [-] and twist \[rad\], integrated over the joint's length.
#[derive(Clone, Copy, Debug)]
pub struct SectionPoint<'a> {
    /// Number of the joint in the model.
    pub joint: usize,
    /// Its length as a fraction of the rod's.
    pub fraction: f64,
    /// κ₁, κ₂, τ.
    pub strain: [f64; 3],
    /// Their rates [1/s].
    pub rate: [f64; 3],
    /// The flat parameter vector θ.
    pub theta: &'a [f64],
}

/// Moments \[N·m\], M₁ and M₂ that bend towards the material axes and M₃ that twists, and their derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// M.
    pub m: [f64; 3],
    /// ∂M/∂strain, by rows.
    pub by_strain: [[f64; 3]; 3],
    /// ∂M/∂rate [N·m·s], by rows.
    pub by_rate: [[f64; 3]; 3],
}

/// What the solver asks of a section. Everything accumulates. A positive moment resists a positive strain.
pub trait SectionLaw: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Adds the moment.
    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]);

    /// Adds the moment and its derivatives.
    fn add(&self, at: &SectionPoint, out: &mut Moments);

    /// Calls `visit(parameter, ∂M/∂θ_parameter)` for every parameter it reads.
    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3]));

    /// Elastic energy \[J\]; zero for moments without one.
    fn energy(&self, _at: &SectionPoint) -> f64 {
        0.0
    }

    /// The law with a rest shape of these strains, joint by joint of the model; `None` if it has no rest shape.
    fn resting(&self, _strains: &[[f64; 3]]) -> Option<Arc<dyn SectionLaw>> {
        None
    }
}

/// A section's law for one joint, written once.
pub trait Section: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Indices in θ of what it reads, in the order it expects; at most [`AutomaticSection::MAX_PARAMS`].
    fn params(&self) -> &[usize];

    /// The moment \[N·m\] of a joint at `strain` and `rate`; `p`: the parameters' values; `fraction` of the rod's length.
    fn moment<S: Real>(&self, joint: usize, fraction: f64, strain: &[S; 3], rate: &[S; 3], p: &[S]) -> [S; 3];

    /// Elastic energy \[J\]; zero for moments without one.
    fn energy<S: Real>(&self, _joint: usize, _fraction: f64, _strain: &[S; 3], _p: &[S]) -> S {
        S::zero()
    }
}

#[cfg(test)]
pub(super) mod check {
    use super::*;

    /// Holds a kernel equal to the automatic derivatives of its law.
    pub fn same(kernel: &dyn SectionLaw, law: &dyn SectionLaw, theta: &[f64]) {
        let at = SectionPoint { joint: 1, fraction: 0.2, strain: [0.3, -0.2, 0.5], rate: [1.2, 0.4, -2.0], theta };
        let (mut a, mut b) = (Moments::default(), Moments::default());
        kernel.add(&at, &mut a);
        law.add(&at, &mut b);
        let flat = |m: &Moments| [m.m.to_vec(), m.by_strain.concat(), m.by_rate.concat()].concat();
        close(&flat(&a), &flat(&b));
        let (mut x, mut y) = ([0.0; 3], [0.0; 3]);
        kernel.add_moment(&at, &mut x);
        law.add_moment(&at, &mut y);
        close(&x, &y);
        close(&x, &a.m);
        close(&[kernel.energy(&at)], &[law.energy(&at)]);
        let slopes = |law: &dyn SectionLaw| {
            let mut out = vec![0.0; 3 * theta.len()];
            law.visit_theta(&at, &mut |k, m| (0..3).for_each(|s| out[3 * k + s] += m[s]));
            out
        };
        close(&slopes(kernel), &slopes(law));
    }

    fn close(a: &[f64], b: &[f64]) {
        let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * size), "{a:?} {b:?}");
    }
}
