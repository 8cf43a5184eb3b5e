//! A section that is easier to bend one way than across: flat cables, ribbons.
//!
//! As long as both stiffnesses are equal nothing determines where the principal axes are, so the effect is looked at for two places, 45°
//! apart, whose effects span all others; the best one counts, at a price.

use super::{Cause, Situation};
use std::f64::consts::FRAC_PI_4;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let roll = at.plan.model.params().find(&format!("{rod}.section_roll"));
        let stiffness = at.value(&format!("{rod}.bend_stiffness")).max(1e-12);
        let same = at.value(&format!("{rod}.bend_stiffness_2")) == at.value(&format!("{rod}.bend_stiffness"));
        Cause {
            meaning: "the section is easier to bend one way than across",
            unknowns: at.theta(&format!("{rod}.bend_stiffness_2"), 0.1 * stiffness).into_iter().collect(),
            excitation: "turn both ends about the rod's own direction by 90°: a round section does not mind",
            nuisance_grid: match roll {
                Some(roll) if same => vec![vec![(roll, 0.0)], vec![(roll, FRAC_PI_4)]],
                _ => Vec::new(),
            },
            ..Cause::default()
        }
    })
}
