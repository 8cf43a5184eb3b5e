//! Laws of bending and twisting of a rod's section: one file per effect.
//!
//! A [`Section`] is written once, for one joint, as the moment it makes of the joint's strains and their rates; dual numbers give its
//! derivatives ([`AutomaticSection`]). Geometry stands elsewhere ([`crate::rods`]), so that a new effect is a few lines. A section that
//! remembers is a [`RememberingSection`], of the strains at the beginning of the step and of numbers in z besides
//! ([`AutomaticMemory`]).

mod automatic;
mod constants;
mod creep;
mod dahl;
mod elastic;
mod plastic;
mod remembering;
mod stiffening;
mod viscous;

pub use automatic::AutomaticSection;
pub use creep::CreepSection;
pub(crate) use dahl::phase;
pub use dahl::{DahlSection, stick};
pub use elastic::{Elastic, ElasticSection};
pub use plastic::{PlasticSection, flow};
pub use remembering::{AutomaticMemory, RememberingSection, SectionState};
pub use stiffening::{Stiffening, StiffeningSection};
pub use viscous::{Viscous, ViscousSection};

use pliant_math::Real;
use std::fmt::Debug;
use std::ops::Range;
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
    /// The strains at the beginning of the (sub)step.
    pub past: [f64; 3],
    /// History variables of the joint there.
    pub memory: &'a [f64],
    /// Time since then \[s\]; 0 where nothing has moved since, as at an equilibrium: what is remembered stays as it is.
    pub elapsed: f64,
}

/// Inputs of the moment or the history of a section beside its rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SectionInput {
    /// A strain.
    Strain(usize),
    /// A strain at the beginning of the (sub)step.
    Past(usize),
    /// A number remembered there.
    Memory(usize),
    /// An entry of θ.
    Theta(usize),
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

impl Moments {
    /// Adds the slopes ∂M₁/∂k₁, ∂M₂/∂k₂ and ∂M₁/∂k₂ = ∂M₂/∂k₁ of bending towards principal axes, which are turned by an angle of this sine
    /// and cosine.
    pub(crate) fn add_bending(&mut self, [one, two, both]: [f64; 3], [sin, cos]: [f64; 2]) {
        let across = (one - two) * sin * cos + both * (cos * cos - sin * sin);
        self.by_strain[0][0] += one * cos * cos + two * sin * sin - 2.0 * both * sin * cos;
        self.by_strain[1][1] += one * sin * sin + two * cos * cos + 2.0 * both * sin * cos;
        self.by_strain[0][1] += across;
        self.by_strain[1][0] += across;
    }
}

/// Interface of a section to the solver. Everything accumulates. A positive moment resists a positive strain.
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

    /// Names of what it remembers of every joint; they begin at zero.
    fn memory(&self) -> &'static [&'static str] {
        &[]
    }

    /// Which branch of the law a joint is on; `None` if it has no kinks between branches.
    fn mode(&self, _at: &SectionPoint) -> Option<u8> {
        None
    }

    /// Calls `visit(input, ∂M/∂input)` for the strains at the beginning of the (sub)step and for what is remembered.
    fn visit_past(&self, _at: &SectionPoint, _visit: &mut dyn FnMut(SectionInput, [f64; 3])) {}

    /// Writes the history variables at `at`, the end of a (sub)step, into `z`.
    fn advance(&self, _at: &SectionPoint, _z: &mut [f64]) {}

    /// Calls `visit(number, input, ∂z_number/∂input)` of [`SectionLaw::advance`].
    fn visit_advance(&self, _at: &SectionPoint, _visit: &mut dyn FnMut(usize, SectionInput, f64)) {}
}

/// A section's law for one joint, written once.
pub trait Section: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Indices in θ of what it reads, in the order it expects; with those of [`Section::own`] at most [`AutomaticSection::MAX_PARAMS`].
    fn params(&self) -> &[usize];

    /// Indices in θ of what it reads of this joint alone; they follow the others.
    fn own(&self, _joint: usize) -> Range<usize> {
        0..0
    }

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

    /// A joint without strain that remembers nothing.
    pub fn resting(theta: &[f64]) -> SectionPoint<'_> {
        let (strain, rate, past) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        SectionPoint { joint: 0, fraction: 0.2, strain, rate, theta, past, memory: &[], elapsed: 0.0 }
    }

    /// Holds a kernel equal to the automatic derivatives of its law.
    pub fn same(kernel: &dyn SectionLaw, law: &dyn SectionLaw, theta: &[f64]) {
        let at = SectionPoint { joint: 1, fraction: 0.2, strain: [0.3, -0.2, 0.5], rate: [1.2, 0.4, -2.0], ..resting(theta) };
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

    /// Holds a law that remembers against differences: moment and memory by everything they depend on.
    pub fn slopes(law: &dyn SectionLaw, theta: &[f64], past: [f64; 3]) {
        let (strain, memory) = ([0.3, -0.2, 0.5], [0.02, -0.05, 0.1]);
        let n = law.memory().len();
        let make = |moved: Option<(SectionInput, f64)>| {
            let (mut strain, mut past, mut memory, mut theta) = (strain, past, memory, theta.to_vec());
            match moved {
                Some((SectionInput::Strain(s), by)) => strain[s] += by,
                Some((SectionInput::Past(s), by)) => past[s] += by,
                Some((SectionInput::Memory(k), by)) => memory[k] += by,
                Some((SectionInput::Theta(k), by)) => theta[k] += by,
                None => {}
            }
            let at = SectionPoint { strain, past, memory: &memory[..n], elapsed: 0.02, ..resting(&theta) };
            let (mut m, mut z) = ([0.0; 3], [0.0; 3]);
            law.add_moment(&at, &mut m);
            law.advance(&at, &mut z[..n]);
            [m, z]
        };
        let at = SectionPoint { strain, past, memory: &memory[..n], elapsed: 0.02, ..resting(theta) };
        let mut found: Vec<(SectionInput, [[f64; 3]; 2])> = Vec::new();
        let mut put = |input, which: usize, row: [f64; 3]| {
            let known = found.iter().position(|(i, _)| *i == input);
            let k = known.unwrap_or_else(|| {
                found.push((input, [[0.0; 3]; 2]));
                found.len() - 1
            });
            (0..3).for_each(|s| found[k].1[which][s] += row[s]);
        };
        let mut moments = Moments::default();
        law.add(&at, &mut moments);
        (0..3).for_each(|s| put(SectionInput::Strain(s), 0, [0, 1, 2].map(|r: usize| moments.by_strain[r][s])));
        law.visit_past(&at, &mut |input, m| put(input, 0, m));
        law.visit_theta(&at, &mut |k, m| put(SectionInput::Theta(k), 0, m));
        law.visit_advance(&at, &mut |k, input, d| {
            let mut row = [0.0; 3];
            row[k] = d;
            put(input, 1, row);
        });
        assert_eq!(found.len(), 6 + n + theta.len());
        for (input, slopes) in found {
            let (up, down) = (make(Some((input, 1e-6))), make(Some((input, -1e-6))));
            for (which, slope) in slopes.iter().enumerate() {
                for s in 0..3 {
                    let difference = (up[which][s] - down[which][s]) / 2e-6;
                    assert!((difference - slope[s]).abs() <= 1e-8, "{input:?}, {which}: {difference} {}", slope[s]);
                }
            }
        }
    }

    fn close(a: &[f64], b: &[f64]) {
        let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * size), "{a:?} {b:?}");
    }
}
