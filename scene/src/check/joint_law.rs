//! Refusing laws of joints that make no sense: creep, gravity compensation, cogging, friction that differs by
//! direction, builds up along the way or grows with load.

use super::{not_negative, positive};
use crate::body::{Joint, JointKind};
use crate::error::{Mistake, SceneError};

/// Once per turn is the weight of a mass off the axis, for which the body has a centre of mass: with another inertia it moves a joint of
/// the world in exactly the same way.
const FEWEST_CYCLES: u32 = 2;

pub(super) fn check(joint: &Joint, field: &str) -> Result<(), SceneError> {
    let at = |key: &str| format!("{field}.{key}");
    let refused = |key: &str, message: &str| Err(SceneError::at(at(key), Mistake::Refused { message: message.to_owned() }));
    let numbers = joint.kind.n_dofs();
    if joint.kind == JointKind::Free {
        let creeps = joint.plastic_time.is_some() || joint.gravity_compensation.is_some();
        if creeps {
            return refused("kind", "a free joint has no spring that could creep and no motor");
        }
    }
    if let Some(time) = joint.plastic_time {
        positive(&at("plastic_time"), time, "s")?;
        if joint.stiffness == 0.0 && joint.cubic_stiffness == 0.0 {
            return refused("plastic_time", "the joint has no spring, so nothing in it creeps: give it `stiffness`");
        }
    } else if joint.yield_at.is_some() || !joint.plastic_start.is_empty() {
        return Err(SceneError::at(field, Mistake::MissingKey { key: "plastic_time".to_owned(), unit: Some("s".to_owned()) }));
    }
    if let Some(limit) = joint.yield_at {
        positive(&at("yield"), limit, "rad")?;
    }
    if !joint.plastic_start.is_empty() && joint.plastic_start.len() != numbers {
        let mistake = Mistake::Count { found: joint.plastic_start.len(), expected: numbers };
        return Err(SceneError::at(at("plastic_start"), mistake));
    }
    if let Some(cogging) = joint.cogging {
        if joint.kind != JointKind::Revolute {
            return refused("cogging", "a torque repeats with the angle of a revolute joint only");
        }
        if cogging.cycles < FEWEST_CYCLES {
            return Err(SceneError::at(at("cogging.cycles"), Mistake::Cycles { found: cogging.cycles, fewest: FEWEST_CYCLES }));
        }
    }
    if let Some(presliding) = joint.presliding {
        if numbers > 2 {
            return refused("presliding", "friction that builds up along the way is for joints of one or two axes");
        }
        not_negative(&at("presliding.friction"), presliding.friction, "N·m")?;
        positive(&at("presliding.distance"), presliding.distance, "rad")?;
    }
    for (key, value, unit) in [("friction_backward", joint.friction_backward, "N·m"), ("load_friction", joint.load_friction, "-")]
    {
        let Some(value) = value else { continue };
        not_negative(&at(key), value, unit)?;
        if numbers > 2 {
            return refused(key, "dry friction is for joints of one or two axes");
        }
    }
    Ok(())
}
