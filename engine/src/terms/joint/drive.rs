//! Motors.

use super::{JointLaw, JointState};
use pliant_math::Real;

/// A motor that takes a torque: f = G τ, τ = g u + f₀ [N·m or N]; parameters gain g [N·m per unit of u], offset f₀ [N·m], gear G [-],
/// and of a motor that saturates the least and the largest τ, beyond which it stays.
#[derive(Clone, Copy, Debug)]
pub struct TorqueDrive;

impl JointLaw for TorqueDrive {
    fn name(&self) -> &str {
        "torque drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        f[0] += p[2] * limited(Self::torque(at, p), &p[3..]);
    }

    fn mode(&self, at: &JointState<f64>, p: &[f64]) -> Option<u8> {
        branch(Self::torque(at, p), &p[3..])
    }
}

/// A servo that holds a position: f = G τ, τ = k (u − G q) − d G v + f₀ [N·m or N]; parameters stiffness k [N·m/rad], damping
/// d [N·m·s/rad], offset f₀ [N·m], gear G [-] (the motor turns G times as far as the joint) and limits of τ as for [`TorqueDrive`]. u is
/// the wanted position of the motor \[rad\].
#[derive(Clone, Copy, Debug)]
pub struct PositionDrive;

impl JointLaw for PositionDrive {
    fn name(&self) -> &str {
        "position drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        f[0] += p[3] * limited(Self::torque(at, p), &p[4..]);
    }

    fn mode(&self, at: &JointState<f64>, p: &[f64]) -> Option<u8> {
        branch(Self::torque(at, p), &p[4..])
    }
}

/// A servo that holds a velocity: f = G τ, τ = d (u − G v) + f₀ [N·m or N]; parameters damping d [N·m·s/rad], offset f₀ [N·m],
/// gear G [-] and limits of τ as for [`TorqueDrive`]. u is the wanted velocity of the motor [rad/s].
#[derive(Clone, Copy, Debug)]
pub struct VelocityDrive;

impl JointLaw for VelocityDrive {
    fn name(&self) -> &str {
        "velocity drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        f[0] += p[2] * limited(Self::torque(at, p), &p[3..]);
    }

    fn mode(&self, at: &JointState<f64>, p: &[f64]) -> Option<u8> {
        branch(Self::torque(at, p), &p[3..])
    }
}

impl TorqueDrive {
    fn torque<S: Real>(at: &JointState<S>, p: &[S]) -> S {
        p[0] * at.u[0] + p[1]
    }
}

impl PositionDrive {
    fn torque<S: Real>(at: &JointState<S>, p: &[S]) -> S {
        let [k, d, offset, gear] = [p[0], p[1], p[2], p[3]];
        k * (at.u[0] - gear * at.q[0]) - d * gear * at.v[0] + offset
    }
}

impl VelocityDrive {
    fn torque<S: Real>(at: &JointState<S>, p: &[S]) -> S {
        let [d, offset, gear] = [p[0], p[1], p[2]];
        d * (at.u[0] - gear * at.v[0]) + offset
    }
}

/// Of a motor with limits: 1 below the least torque, 2 above the largest, 0 between.
fn branch(torque: f64, limits: &[f64]) -> Option<u8> {
    match limits {
        [least, largest] => Some(if torque < *least { 1 } else { 2 * u8::from(torque > *largest) }),
        _ => None,
    }
}

/// The torque τ of a motor [N·m or N] between its `limits` (least, largest), if it has any: min(max(τ, least), largest). Beyond, the
/// derivative with respect to τ is 0 and that with respect to the limit 1; at a limit it is that from within.
fn limited<S: Real>(torque: S, limits: &[S]) -> S {
    match limits {
        [least, _] if torque.re() < least.re() => *least,
        [_, largest] if torque.re() > largest.re() => *largest,
        _ => torque,
    }
}
