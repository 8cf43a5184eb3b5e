//! Viscous friction at joints, and damping by the square of the speed.

use super::{JointLaw, JointState};
use pliant_math::Real;

/// f = −d v [N·m or N]; parameter d [N·m·s/rad or N·s/m] ≥ 0.
#[derive(Clone, Copy, Debug)]
pub struct Damping;

impl JointLaw for Damping {
    fn name(&self) -> &str {
        "joint damping"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        for (f, v) in f.iter_mut().zip(at.v) {
            *f -= p[0] * *v;
        }
    }
}

/// Damping that grows with the square of the speed, as of air and fluids, f = −k |v| v [N·m or N]; parameter k
/// [N·m·s²/rad² or N·s²/m²] ≥ 0. At a ball |v| is the length of the angular velocity.
///
/// |v| is given the slope 0 at v = 0, where the force is C¹.
#[derive(Clone, Copy, Debug)]
pub struct QuadraticDamping;

impl JointLaw for QuadraticDamping {
    fn name(&self) -> &str {
        "quadratic joint damping"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        let speed = speed(at.v);
        for (f, v) in f.iter_mut().zip(at.v) {
            *f -= p[0] * speed * *v;
        }
    }
}

fn speed<S: Real>(v: &[S]) -> S {
    match *v {
        // the root of a square would lose small speeds
        [v] if v.re() < 0.0 => -v,
        [v] => v,
        _ => {
            let squared = v.iter().fold(S::zero(), |sum, v| sum + *v * *v);
            // the root has no slope at 0
            if squared.re() == 0.0 { S::zero() } else { squared.sqrt() }
        }
    }
}
