//! Cogging: a torque that repeats with the angle of a joint, τ = a sin(n q) + b cos(n q).
//!
//! The number n of cycles per turn is a datum of the motor (poles, slots, gear ratio) and no parameter: a search over it would have as
//! many local ends as there are integers, and each one tried would make the p of the others larger. So the scene has to give it, and the
//! dormant parameters of a scene have no cogging. Both amplitudes are freed, because nobody measures the phase.
//!
//! A scene refuses n = 1: once per turn is the weight of a mass off the axis, so `center_of_mass` and an inertia would move the readings
//! of a joint of the world in exactly the same way. From n = 2 on no other law of the library has this force. Over a small part of a cycle
//! it is nearly a constant torque and a spring.

use super::{Cause, Situation, joint_inertia};
use pliant_engine::bodies::{Joint, JointKind};

/// Amplitude that is a typical size, over the joint's inertia [rad/s²].
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let turning = at.plan.model.tree().joints().iter().filter(|joint| joint.kind == JointKind::Revolute);
    turning.filter_map(|joint| cause(at, joint)).collect()
}

fn cause(at: &Situation, joint: &Joint) -> Option<Cause> {
    let shape = Cause {
        object: Some(joint.name.clone()),
        meaning: "a motor's torque repeats with the joint's angle (cogging)",
        excitation: "turn the joint slowly through several cycles, both ways: friction changes its sign, cogging does not",
        ..Cause::default()
    };
    // an axis of a universal joint has no parameters of its own name, and no cogging
    let inertia = joint_inertia(&at.plan.model, &joint.name)?;
    at.plan.model.params().find(&format!("{}.armature", joint.name))?;
    let keys = ["sine", "cosine"].map(|key| format!("{}.cogging_{key}", joint.name));
    let unknowns: Vec<_> = keys.iter().filter_map(|path| at.theta(path, TYPICAL * inertia)).collect();
    if unknowns.is_empty() {
        let why = "the scene does not say how many cycles per turn: give the joint `cogging = { cycles = … }`";
        return at.has_actuators().then(|| Cause { untestable: Some(why.to_owned()), ..shape });
    }
    Some(Cause { unknowns, ..shape })
}
