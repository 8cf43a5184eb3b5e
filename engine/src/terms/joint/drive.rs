//! Motors.

use super::{JointLaw, JointState};
use crate::terms::Real;

/// A motor that takes a torque: f = G (g u + f₀) [N·m or N]; parameters gain g [N·m per unit of u], offset f₀ [N·m] and gear G [-].
#[derive(Clone, Copy, Debug)]
pub struct TorqueDrive;

impl JointLaw for TorqueDrive {
    fn name(&self) -> &str {
        "torque drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        f[0] += p[2] * (p[0] * at.u[0] + p[1]);
    }
}

/// A servo that holds a position: f = G (k (u − G q) − d G v + f₀) [N·m or N]; parameters stiffness k [N·m/rad], damping
/// d [N·m·s/rad], offset f₀ [N·m] and gear G [-] (the motor turns G times as far as the joint). u is the wanted position of the motor \[rad\].
#[derive(Clone, Copy, Debug)]
pub struct PositionDrive;

impl JointLaw for PositionDrive {
    fn name(&self) -> &str {
        "position drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        let [k, d, offset, gear] = [p[0], p[1], p[2], p[3]];
        f[0] += gear * (k * (at.u[0] - gear * at.q[0]) - d * gear * at.v[0] + offset);
    }
}

/// A servo that holds a velocity: f = G (d (u − G v) + f₀) [N·m or N]; parameters damping d [N·m·s/rad], offset f₀ [N·m] and
/// gear G [-]. u is the wanted velocity of the motor [rad/s].
#[derive(Clone, Copy, Debug)]
pub struct VelocityDrive;

impl JointLaw for VelocityDrive {
    fn name(&self) -> &str {
        "velocity drive"
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], _constants: &[f64], f: &mut [S]) {
        let [d, offset, gear] = [p[0], p[1], p[2]];
        f[0] += gear * (d * (at.u[0] - gear * at.v[0]) + offset);
    }
}
