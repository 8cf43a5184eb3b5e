//! Forces: one file per physical effect.
//!
//! A [`Law`] writes a force once, for one element, generic over the scalar; [`Automatic`] turns it into a [`Term`] with all
//! derivatives by forward-mode dual numbers. Hot laws implement [`Term`] by hand beside their generic form, and a test holds
//! the two equal.

use pliant_linalg::NodeMatrix;
use std::fmt::Debug;

mod automatic;
mod bend;
mod bend_damping;
#[cfg(test)]
mod check;
mod drag;
mod energy;
mod formula;
mod gravity;
pub mod joint;
mod rest_strain;
pub mod section;
pub mod sheet;
mod stencil;
mod stretch;
mod stretch_damping;

pub use automatic::Automatic;
pub use bend::{Bend, BendLaw};
pub use bend_damping::{BendDamping, BendDampingLaw};
pub use drag::{Drag, DragLaw};
pub use energy::{EnergyLaw, FromEnergy};
pub use formula::ByFormulas;
pub use gravity::{Gravity, GravityLaw, gravity_vector};
pub use pliant_math::{Real, Vec3};
pub use rest_strain::{RestStrain, RestStrainLaw};
pub use stretch::{Stretch, StretchLaw};
pub use stretch_damping::{StretchDamping, StretchDampingLaw};

/// Where forces are evaluated: positions \[m\] and velocities [m/s] of all nodes (flat, three per node), and all parameters.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Node positions q̄ \[m\].
    pub q: &'a [f64],
    /// Node velocities v̄ [m/s].
    pub v: &'a [f64],
    /// The flat parameter vector θ.
    pub theta: &'a [f64],
}

impl Point<'_> {
    /// Position of node `i`.
    #[inline]
    pub fn position(&self, i: usize) -> Vec3<f64> {
        let x = &self.q[3 * i..3 * i + 3];
        Vec3::new(x[0], x[1], x[2])
    }

    /// Velocity of node `i`.
    #[inline]
    pub fn velocity(&self, i: usize) -> Vec3<f64> {
        let x = &self.v[3 * i..3 * i + 3];
        Vec3::new(x[0], x[1], x[2])
    }
}

/// [`Term::pull_theta`] by way of [`Term::visit_theta`].
#[inline]
pub(crate) fn contraction(weights: &[f64], sums: &mut [f64]) -> impl FnMut(usize, usize, f64) {
    |row, param, df| sums[param] += weights[row] * df
}

/// Interface of a force to the solver. Everything accumulates; nothing is cleared here.
pub trait Term: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// `f += f(q, v; θ)` \[N\].
    fn add_force(&self, at: &Point, f: &mut [f64]);

    /// As [`Term::add_force`], and `dq += ∂f/∂q` [N/m], `dv += ∂f/∂v` [N·s/m].
    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix);

    /// Number of axial forces \[N\] that Newton's method carries as unknowns of their own; none unless a term is so stiff that
    /// its force at an iterate says nothing about its force at the root.
    fn n_axial(&self) -> usize {
        0
    }

    /// The axial forces at `q + dq` to first order in `dq`.
    fn predict_axial(&self, _at: &Point, _dq: &[f64], _axial: &mut [f64]) {}

    /// As [`Term::add_jacobian`], with `axial` in place of the forces at q in the geometric part of ∂f/∂q.
    fn add_mixed_jacobian(&self, at: &Point, _axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.add_jacobian(at, f, dq, dv);
    }

    /// As [`Term::add_mixed_jacobian`], without the part of ∂f/∂q that may push on along a displacement: −∂f/∂q is positive
    /// semidefinite. For iterates where the other one is not.
    fn add_stable_jacobian(&self, at: &Point, axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.add_mixed_jacobian(at, axial, f, dq, dv);
    }

    /// Whether [`Term::add_stable_jacobian`] is another one.
    fn buckles(&self) -> bool {
        false
    }

    /// Calls `visit(row, parameter, ∂f_row/∂θ_parameter)` for every structural nonzero.
    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64));

    /// [`Term::visit_theta`] contracted: `sums[parameter] += Σ_row weights[row] ∂f_row/∂θ_parameter`.
    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        self.visit_theta(at, &mut contraction(weights, sums));
    }

    /// Potential energy \[J\]; zero for forces without one.
    fn energy(&self, _at: &Point) -> f64 {
        0.0
    }

    /// Whether this is a force between nodes, elastic or viscous, so that a step by which its energy grows of itself is too long.
    fn inner(&self) -> bool {
        false
    }

    /// Whether ∂f/∂q and ∂f/∂v are symmetric at every point for these parameters.
    fn symmetric(&self, theta: &[f64]) -> bool;

    /// Calls `visit(nodes)` with the nodes that act on each other, element by element.
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize]));
}

/// One occurrence of a law: the nodes it acts on, the entries of θ it reads, and constants of its geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Nodes, in the order the law expects.
    pub nodes: Vec<usize>,
    /// Indices into θ, in the order the law expects.
    pub params: Vec<usize>,
    /// Constants that are not parameters (fractions of the length, for example).
    pub constants: Vec<f64>,
}

/// A force on a small stencil of nodes, written once. This is the only thing a new physical effect has to provide.
///
/// At most [`Automatic::MAX_NODES`] nodes and [`Automatic::MAX_PARAMS`] parameters per element.
pub trait Law: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Adds the force \[N\] on each node of the stencil to `f`. `q`, `v`: positions \[m\] and velocities [m/s] of the element's
    /// nodes; `p`: its parameters; `constants`: [`Element::constants`].
    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]);

    /// Potential energy \[J\] of the element; zero for forces without one.
    fn energy<S: Real>(&self, _q: &[Vec3<S>], _p: &[S], _constants: &[f64]) -> S {
        S::zero()
    }

    /// Whether ∂f/∂q and ∂f/∂v are symmetric for parameter values `p`; `false` is always safe.
    fn symmetric(&self, _p: &[f64]) -> bool {
        false
    }
}
