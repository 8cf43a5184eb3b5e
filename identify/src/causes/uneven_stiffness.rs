//! A bending stiffness that differs from place to place: joints, sleeves, markers that stiffen, a hold that is softer than a clamp.

use super::{Cause, Situation};

/// Size of a change that is typical.
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let paths = at.joints_of(rod, "bend_factor");
        // all together are the stiffness itself: the one in the middle stays as it is
        let middle = paths.len() / 2;
        let others = paths.iter().enumerate().filter(|(k, _)| *k != middle).map(|(_, path)| path);
        Cause {
            name: "uneven_stiffness",
            meaning: "the bending stiffness differs from place to place (sleeves, joints, markers, a soft hold)",
            unknowns: others.filter_map(|path| at.theta(path, TYPICAL)).collect(),
            excitation: "bend the rod sharply in several places: hold it close together, far apart, and with ends of other slopes",
            ..Cause::default()
        }
    })
}
