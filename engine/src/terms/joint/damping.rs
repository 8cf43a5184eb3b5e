//! Viscous friction at joints.

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
