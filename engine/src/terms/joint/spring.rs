//! Springs at joints.

use super::{JointLaw, JointState};
use pliant_math::Real;

/// A linear spring, f = −k (q − q₀) [N·m or N]; parameters k [N·m/rad or N/m] ≥ 0 and, for a revolute or prismatic joint, the rest
/// coordinate q₀ [rad or m].
///
/// At a ball q is the rotation vector, turned by at most π, q₀ = 0, and f the moment in the body's axes: the energy is
/// ½ k |q|², and the moment along q.
#[derive(Clone, Copy, Debug)]
pub struct Spring;

impl JointLaw for Spring {
    fn name(&self) -> &str {
        "joint stiffness"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        for (f, q) in f.iter_mut().zip(at.q) {
            *f -= p[0] * stretch(*q, p);
        }
    }

    fn energy<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64]) -> S {
        at.q.iter().fold(S::zero(), |sum, q| sum + p[0] * stretch(*q, p) * stretch(*q, p) * 0.5)
    }
}

/// A stiffening spring, f = −k₃ (q − q₀)³ [N·m or N]; parameters k₃ [N·m/rad³ or N/m³] and q₀ as for [`Spring`]. At a ball
/// f = −k₃ |q|² q.
#[derive(Clone, Copy, Debug)]
pub struct CubicSpring;

impl JointLaw for CubicSpring {
    fn name(&self) -> &str {
        "cubic joint stiffness"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        let size = squared(at.q, p);
        for (f, q) in f.iter_mut().zip(at.q) {
            *f -= p[0] * size * stretch(*q, p);
        }
    }

    fn energy<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64]) -> S {
        let size = squared(at.q, p);
        p[0] * size * size * 0.25
    }
}

fn stretch<S: Real>(q: S, p: &[S]) -> S {
    p.get(1).map_or(q, |rest| q - *rest)
}

fn squared<S: Real>(q: &[S], p: &[S]) -> S {
    q.iter().fold(S::zero(), |sum, q| sum + stretch(*q, p) * stretch(*q, p))
}
