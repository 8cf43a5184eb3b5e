//! A constant error of where a gripper holds a rope or sheet; a candidate per gripper.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let drives = at.plan.model.drives().iter();
    drives
        .map(|drive| {
            let testable = drive.is_prescribed();
            let unknowns = (0..3).filter_map(|a| at.theta(&format!("{}.offset[{a}]", drive.name), 1e-3)).collect();
            Cause {
                object: Some(drive.name.clone()),
                meaning: "a gripper holds the rope or cloth beside where its reading says",
                unknowns: if testable { unknowns } else { Vec::new() },
                untestable: (!testable)
                    .then(|| format!("gripper `{}` is controlled by velocity and has no measured position", drive.name)),
                excitation: "measure a marker on the gripper itself: it shows an offset of the gripper and not one of the sensor",
                ..Cause::default()
            }
        })
        .collect()
}
