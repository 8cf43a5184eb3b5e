//! Torque or force of a joint's actuators, as a torque sensor reads it.

use crate::log::Setup;
use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};
use pliant_engine::model::Model;
use pliant_engine::terms::joint::{JointLaw, JointState, PositionDrive, TorqueDrive, VelocityDrive};
use pliant_scene::ActuatorKind;

/// Numbers of θ that an actuator has at most.
const PARAMS: usize = 4;
/// Coordinate, velocity, control, numbers of θ.
const INPUTS: usize = 3 + PARAMS;

/// An actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivePlace {
    /// Its law from control to torque.
    pub kind: ActuatorKind,
    /// Number of its control.
    pub control: usize,
    /// Indices of its numbers in θ, in the order of its law.
    pub params: Vec<usize>,
}

/// A torque [N·m or N] and its derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Torque {
    pub value: f64,
    pub by_q: f64,
    pub by_v: f64,
    /// By the actuators' controls.
    pub by_u: Vec<(usize, f64)>,
    /// By entries of θ.
    pub by_theta: Vec<(usize, f64)>,
}

/// The actuators of a joint.
pub(crate) fn drives_of(setup: &Setup, model: &Model, joint: &str) -> Vec<DrivePlace> {
    let first = model.nu() - setup.scene.actuator.len();
    let place = |(k, actuator): (usize, &pliant_scene::Actuator)| {
        let numbers: &[&str] = match actuator.kind {
            ActuatorKind::Torque => &["gain", "offset", "gear"],
            ActuatorKind::Position => &["stiffness", "damping", "offset", "gear"],
            ActuatorKind::Velocity => &["damping", "offset", "gear"],
        };
        let params = numbers.iter().filter_map(|n| model.params().find(&format!("{}.{n}", actuator.name))).collect();
        DrivePlace { kind: actuator.kind, control: first + k, params }
    };
    setup.scene.actuator.iter().enumerate().filter(|(_, a)| a.joint == joint).map(place).collect()
}

/// Sum over a joint's actuators at coordinate q, velocity v and all controls u.
pub(crate) fn torque(drives: &[DrivePlace], q: f64, v: f64, u: &[f64], theta: &[f64]) -> Torque {
    type Dual = DualSVec64<INPUTS>;
    let seeded = |x: f64, k: usize| {
        let mut unit = SVector::zeros();
        unit[k] = 1.0;
        Dual::new(x, Derivative::some(unit))
    };
    let mut out = Torque::default();
    for drive in drives {
        let state = JointState {
            q: &[seeded(q, 0)],
            v: &[seeded(v, 1)],
            u: &[seeded(u[drive.control], 2)],
            q_past: &[],
            z: &[],
            elapsed: 0.0,
        };
        let p: Vec<Dual> = drive.params.iter().enumerate().map(|(k, &entry)| seeded(theta[entry], 3 + k)).collect();
        let mut f = [Dual::from_re(0.0)];
        match drive.kind {
            ActuatorKind::Torque => TorqueDrive.force(&state, &p, &[], &mut f),
            ActuatorKind::Position => PositionDrive.force(&state, &p, &[], &mut f),
            ActuatorKind::Velocity => VelocityDrive.force(&state, &p, &[], &mut f),
        }
        let by = f[0].eps.0.unwrap_or_else(SVector::zeros);
        out.value += f[0].re;
        out.by_q += by[0];
        out.by_v += by[1];
        out.by_u.push((drive.control, by[2]));
        out.by_theta.extend(drive.params.iter().enumerate().map(|(k, &entry)| (entry, by[3 + k])));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_reads_what_it_exerts() {
        // G (k (u − G q) − d G v + f₀) with k, d, f₀, G = 50, 2, 0.1, 3
        let theta = [50.0, 2.0, 0.1, 3.0];
        let drive = DrivePlace { kind: ActuatorKind::Position, control: 0, params: vec![0, 1, 2, 3] };
        let t = torque(&[drive], 0.2, -0.5, &[0.7], &theta);
        let expected = 3.0 * (50.0 * (0.7 - 3.0 * 0.2) + 2.0 * 3.0 * 0.5 + 0.1);
        assert!((t.value - expected).abs() < 1e-12);
        assert!((t.by_q + 450.0).abs() < 1e-12 && (t.by_v + 18.0).abs() < 1e-12, "{t:?}");
        assert!((t.by_u[0].1 - 150.0).abs() < 1e-12 && (t.by_theta[2].1 - 3.0).abs() < 1e-12, "{t:?}");
    }
}
