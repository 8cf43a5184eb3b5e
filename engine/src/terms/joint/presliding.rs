//! Friction of a joint that builds up along the way.

use super::{JointLaw, JointState};
use crate::terms::section::{phase, stick};
use pliant_math::Real;

/// Dahl's friction at a joint: what touches gives way elastically before it slides. With e the elastic part of the coordinate,
/// ```text
/// f = −F e/d,      ė = q̇ − |q̇| e/d      [N·m or N]
/// ```
/// Parameters: F [N·m or N] ≥ 0 and d [rad or m] > 0. Internal variable e [rad or m], zero as the scene begins. After a way x from there the
/// force has grown to F (1 − exp(−x/d)); a reversal is met by the stiffness 2 F/d and stores energy, so that a joint that is pushed by less than F
/// moves a little and comes back part of the way. Between ±x a loop takes up 4 F (x − d tanh(x/d)), however fast.
///
/// The way of a step is integrated exactly ([`stick`]), so that e does not depend on the steps but where the joint turns round within one.
/// Limits: F = 0 nothing, exactly, but its slope; d → 0 dry friction of the bound F; d → ∞ at one F/d a spring whose rest is the start.
///
/// Reference: P. R. Dahl, A Solid Friction Model, The Aerospace Corporation, TOR-0158(3107-18)-1, 1968.
#[derive(Clone, Copy, Debug)]
pub struct Presliding;

impl JointLaw for Presliding {
    fn name(&self) -> &str {
        "presliding friction"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        f[0] -= p[0] * elastic(at, p) / p[1];
    }

    fn advance<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], z: &mut [S]) {
        z[0] = elastic(at, p);
    }

    fn energy<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64]) -> S {
        let e = elastic(at, p);
        p[0] * e * e / p[1] * 0.5
    }

    fn mode(&self, at: &JointState<f64>, p: &[f64]) -> Option<u8> {
        Some(phase(at.z[0] * (at.q[0] - at.q_past[0]) / (p[1] * p[1])))
    }
}

/// The elastic part where the force is evaluated; where nothing has moved since the step began, as at an equilibrium, it is what it was.
fn elastic<S: Real>(at: &JointState<S>, p: &[S]) -> S {
    if at.elapsed <= 0.0 {
        return at.z[0];
    }
    let [e] = stick([at.z[0]], [at.q[0] - at.q_past[0]], p[1]);
    e
}
