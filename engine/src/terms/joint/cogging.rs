//! Cogging of motors.

use super::{JointLaw, JointState};
use pliant_math::Real;

/// Torque that repeats with the angle of a revolute joint, as of a motor's magnets that attract its teeth:
/// ```text
/// f = a sin(n q) + b cos(n q),      E = (a cos(n q) − b sin(n q))/n      [N·m, J]
/// ```
/// Parameters a, b [N·m]; the constant n [-] is the number of cycles per turn of the joint. a > 0 pushes away from q = 0. Where
/// a = b = 0 there is no force, but its derivatives by a and b exist. A step that turns the joint by more than a part of 2π/n does
/// not resolve it.
#[derive(Clone, Copy, Debug)]
pub struct Cogging;

impl JointLaw for Cogging {
    fn name(&self) -> &str {
        "cogging torque"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0 && p[1] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64], f: &mut [S]) {
        let (sin, cos) = (at.q[0] * constants[0]).sin_cos();
        f[0] += p[0] * sin + p[1] * cos;
    }

    fn energy<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64]) -> S {
        let (sin, cos) = (at.q[0] * constants[0]).sin_cos();
        (p[0] * cos - p[1] * sin) / constants[0]
    }
}
