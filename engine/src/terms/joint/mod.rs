//! Forces between bodies at their joints, springs to motors: one file per effect.
//!
//! A [`JointLaw`] writes the generalized force once, generic over the scalar; [`AutomaticJoint`] makes a [`JointTerm`] of it.

mod automatic;
mod cogging;
mod compensation;
mod damping;
mod drive;
mod formula;
mod plastic;
mod presliding;
mod spring;

pub use automatic::AutomaticJoint;
pub use cogging::Cogging;
pub use compensation::GravityCompensation;
pub use damping::{Damping, QuadraticDamping};
pub use drive::{PositionDrive, TorqueDrive, VelocityDrive};
pub use formula::ByFormula;
pub use plastic::{PlasticSpring, relax};
pub use presliding::Presliding;
pub use spring::{CubicSpring, Spring};

use crate::bodies::Tree;
use crate::bodies::dynamics::Displacement;
use crate::memory::Past;
use nalgebra::Matrix3;
use pliant_math::{Input, Real};
use std::fmt::Debug;

/// Where joint forces are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct JointPoint<'a> {
    /// The bodies and joints.
    pub tree: &'a Tree,
    /// The bodies' coordinates q̄.
    pub q: &'a [f64],
    /// Their velocities v̄.
    pub v: &'a [f64],
    /// Signals of motors from all controls of the step.
    pub u: &'a [f64],
    /// The flat parameter vector θ.
    pub theta: &'a [f64],
    /// The beginning of the step.
    pub past: Past<'a>,
}

/// Interface of a joint force to the solver. Everything accumulates.
pub trait JointTerm: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// `f += f(q, v, u; θ)` [N·m or N].
    fn add_force(&self, at: &JointPoint, f: &mut [f64]);

    /// Adds the change of f for displacements δv̄ = cv δ, δq̄ = cq J δ to the row-major matrix `out` (rows `stride` apart); `turns` as in
    /// [`crate::bodies::dynamics::Partials::add`].
    fn add_change(&self, at: &JointPoint, by: Displacement, turns: &[Option<Matrix3<f64>>], out: &mut [f64], stride: usize);

    /// Calls `visit(degree of freedom, input, ∂f/∂input)` for every control, and for every parameter if `all`.
    fn visit_inputs(&self, at: &JointPoint, all: bool, visit: &mut dyn FnMut(usize, Input, f64));

    /// Whether the force depends on controls.
    fn is_prescribed(&self) -> bool;

    /// Calls `visit(degree of freedom, input, ∂f/∂input)` for every internal variable (`Z`) and coordinate (`Q`) at the beginning of
    /// the step that the force depends on.
    fn visit_past(&self, _at: &JointPoint, _visit: &mut dyn FnMut(usize, Input, f64)) {}

    /// Appends which branch of its law each element is on, if it has kinks between branches: 1 and 2 saturated, 0 not.
    fn modes(&self, _at: &JointPoint, _out: &mut Vec<u8>) {}

    /// Writes into `z` what the force remembers of a step that ended at `at`.
    fn advance(&self, _at: &JointPoint, _z: &mut [f64]) {}

    /// Calls `visit(place in z, input, ∂z⁺/∂input)` for everything that [`JointTerm::advance`] depends on: `QNext` is a coordinate at
    /// the end of the step, `Q` and `Z` belong to its beginning.
    fn visit_advance(&self, _at: &JointPoint, _visit: &mut dyn FnMut(usize, Input, f64)) {}

    /// Potential energy \[J\]; zero for forces without one.
    fn energy(&self, _at: &JointPoint) -> f64 {
        0.0
    }
}

/// Arguments of one element of a joint law: coordinates (rad, m; a rotation vector for a ball, in the axes of the body before it
/// turned as in those after), velocities and controls.
#[derive(Clone, Copy, Debug)]
pub struct JointState<'a, S> {
    /// Coordinates, three for a ball.
    pub q: &'a [S],
    /// Velocities.
    pub v: &'a [S],
    /// Controls.
    pub u: &'a [S],
    /// Of a law that remembers: coordinates at the beginning of the step; otherwise empty.
    pub q_past: &'a [S],
    /// Its internal variables there.
    pub z: &'a [S],
    /// Time since then \[s\].
    pub elapsed: f64,
}

/// One occurrence of a joint law.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointElement {
    /// Joints, in the order the law expects.
    pub joints: Vec<usize>,
    /// Indices into the controls.
    pub controls: Vec<usize>,
    /// Indices into θ.
    pub params: Vec<usize>,
    /// Constants that are not parameters.
    pub constants: Vec<f64>,
    /// Places in z, one per degree of freedom of the one joint of a law that remembers; otherwise empty.
    pub memory: Vec<usize>,
}

/// A force at joints, written once. At most [`AutomaticJoint::MAX_DOFS`] degrees of freedom, and as many controls and parameters as
/// [`AutomaticJoint::MAX_INPUTS`] together.
pub trait JointLaw: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Adds the generalized force to `f`, one entry per degree of freedom.
    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64], f: &mut [S]);

    /// Whether the force vanishes at these parameters wherever the joint is, so that it need not be evaluated.
    fn vanishes(&self, _p: &[f64]) -> bool {
        false
    }

    /// Which branch of the law this is, if it has kinks between branches.
    fn mode(&self, _at: &JointState<f64>, _p: &[f64]) -> Option<u8> {
        None
    }

    /// Internal variables z⁺ at the end of a step that ended at `at`, one per degree of freedom.
    fn advance<S: Real>(&self, _at: &JointState<S>, _p: &[S], _constants: &[f64], _z: &mut [S]) {}

    /// Potential energy \[J\]; zero for forces without one.
    fn energy<S: Real>(&self, _at: &JointState<S>, _p: &[S], _constants: &[f64]) -> S {
        S::zero()
    }
}
