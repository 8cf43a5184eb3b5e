//! A bending stiffness that differs from place to place: joints, sleeves, markers that stiffen, a hold that is softer than a clamp.

use super::{Cause, Situation};

/// Size of a change that is typical.
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let mut others = at.along(&at.joints_of(rod, "bend_factor"), TYPICAL);
        // all together are the stiffness itself: the one in the middle stays as it is
        if !others.is_empty() {
            others.remove(others.len() / 2);
        }
        Cause {
            meaning: "the bending stiffness differs from place to place (sleeves, joints, markers, a soft hold)",
            unknowns: others,
            excitation: "bend the rod sharply in several places: hold it close together, far apart, and with ends of other slopes",
            ..Cause::default()
        }
    })
}
