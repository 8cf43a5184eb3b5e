//! A wrong twisting stiffness.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| Cause {
        meaning: "the rod resists twisting more or less than simulated",
        unknowns: at.theta(&format!("{rod}.twist_stiffness"), 0.1 * at.value(&format!("{rod}.bend_stiffness"))).into_iter().collect(),
        excitation: "turn one end about the rod's own direction, the other held: a slack rod leaves its plane at an angle that GJ decides",
        ..Cause::default()
    })
}
