//! Refusing motors that make no sense.

use super::{not_negative, positive};
use crate::actuator::{Actuator, ActuatorKind};
use crate::error::{Mistake, SceneError};
use crate::file::Scene;
use crate::words::nearest;

/// Longest delay, and longest time constant of a lag [s]: more betrays another unit.
const LONGEST: f64 = 10.0;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    scene.actuator.iter().enumerate().try_for_each(|(a, actuator)| one(scene, actuator, &format!("actuator[{a}]")))
}

fn one(scene: &Scene, actuator: &Actuator, field: &str) -> Result<(), SceneError> {
    let joints = || scene.body.iter().flat_map(|b| &b.joint);
    match joints().find(|j| j.name == actuator.joint) {
        None => {
            let mistake = Mistake::NoSuch {
                what: "joint",
                name: actuator.joint.clone(),
                nearest: nearest(&actuator.joint, joints().map(|j| j.name.as_str())).map(str::to_owned),
                known: joints().map(|j| j.name.as_str()).collect::<Vec<_>>().join(", "),
            };
            return Err(SceneError::at(format!("{field}.joint"), mistake));
        }
        Some(joint) if joint.kind.n_dofs() > 1 => {
            let mistake = Mistake::Refused {
                message: format!(
                    "joint \"{}\" has {} degrees of freedom; an actuator drives one",
                    joint.name,
                    joint.kind.n_dofs()
                ),
            };
            return Err(SceneError::at(format!("{field}.joint"), mistake));
        }
        Some(_) => {}
    }
    not_negative(&format!("{field}.stiffness"), actuator.stiffness, "N·m/rad")?;
    not_negative(&format!("{field}.damping"), actuator.damping, "N·m·s/rad")?;
    positive(&format!("{field}.gear"), actuator.gear.abs(), "-")?;
    signal(actuator, field)
}

/// Controller, delay, lag and saturation.
fn signal(actuator: &Actuator, field: &str) -> Result<(), SceneError> {
    if actuator.delta_scale.is_some() && actuator.kind != ActuatorKind::Position {
        let message = "only a position drive has a target to step".to_owned();
        return Err(SceneError::at(format!("{field}.delta_scale"), Mistake::Refused { message }));
    }
    for (key, value) in [("delay", actuator.delay), ("lag", actuator.lag)] {
        let Some(value) = value else { continue };
        not_negative(&format!("{field}.{key}"), value, "s")?;
        if value > LONGEST {
            let reason = ", more than any motor takes".to_owned();
            let mistake = Mistake::Unit { value, unit: "s", reason, likely: "ms", instead: 1e-3 * value };
            return Err(SceneError::at(format!("{field}.{key}"), mistake));
        }
    }
    if let Some(longest) = actuator.max_delay {
        let key = format!("{field}.max_delay");
        let Some(delay) = actuator.delay else {
            return Err(SceneError::at(field, Mistake::MissingKey { key: "delay".to_owned(), unit: Some("s".to_owned()) }));
        };
        positive(&key, longest, "s")?;
        if delay > longest {
            return Err(SceneError::at(format!("{field}.delay"), Mistake::Delay { delay, longest }));
        }
        if longest > LONGEST {
            return Err(SceneError::at(key, Mistake::Range { value: longest, low: delay, high: LONGEST }));
        }
    }
    match actuator.saturation {
        Some([low, high]) if low >= high => Err(SceneError::at(format!("{field}.saturation"), Mistake::Limits { low, high })),
        _ => Ok(()),
    }
}
