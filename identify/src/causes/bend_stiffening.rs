//! A rod that becomes stiffer, or softer, the more it is bent: M = EI x (1 + c x²).

use super::{Cause, Situation};

/// Change of the stiffness at the largest curvature that is typical.
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let scale = TYPICAL / at.largest_curvature(rod).powi(2);
        Cause {
            meaning: "the rod becomes stiffer, or softer, the more it is bent",
            unknowns: at.theta(&format!("{rod}.stiffening"), scale).into_iter().collect(),
            excitation: "bend it sharply, and hold it nearly straight",
            ..Cause::default()
        }
    })
}
