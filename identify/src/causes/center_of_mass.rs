//! Where the mass of a body is.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let one = |name: &String| {
        let unknowns: Vec<_> = (0..3).filter_map(|a| at.theta(&format!("{name}.center_of_mass[{a}]"), 0.01)).collect();
        (!unknowns.is_empty()).then(|| Cause {
            object: Some(name.clone()),
            meaning: "a link's centre of mass is elsewhere",
            unknowns,
            excitation: "hold the link in several poses by known torques; or balance it on an edge",
            ..Cause::default()
        })
    };
    at.plan.model.tree().bodies().iter().filter_map(|body| one(&body.name)).collect()
}
