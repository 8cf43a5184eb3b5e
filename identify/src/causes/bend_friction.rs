//! Friction between the parts of a rod that is bent, the same however fast (Dahl's model): strands, a sheath, markers that rub.
//!
//! Without friction nothing determines the curvature over which it builds up: it is looked at for parts of the largest curvature that a record
//! begins with, the best one counts, at a price.

use super::{Cause, Situation};
use crate::unknown::Unknown;

/// Curvature over which friction builds up, over the largest one.
const GRID: [f64; 3] = [0.01, 0.1, 0.5];
/// A typical moment over that of the elastic section at the largest curvature.
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let in_pieces = at.plan.in_pieces();
    at.per_rod(|rod| {
        let largest = at.largest_curvature(rod);
        let scale = TYPICAL * largest * at.value(&format!("{rod}.bend_stiffness"));
        let entry = at.plan.model.params().find(&format!("{rod}.friction_curvature"));
        let none = at.value(&format!("{rod}.friction_moment")) == 0.0;
        let curvature = at.theta(&format!("{rod}.friction_curvature"), 1.0).filter(|_| none && !in_pieces);
        let unknowns: Vec<_> = at.theta(&format!("{rod}.friction_moment"), scale).into_iter().collect();
        Cause {
            meaning: "there is friction inside the rod that is bent, the same however fast (strands, a sheath)",
            unknowns: if in_pieces { Vec::new() } else { unknowns },
            untestable: in_pieces
                .then(|| "the records are fitted in pieces, and what has rubbed before a piece begins is unknown".to_owned()),
            excitation: "bend it slowly to and fro: it comes back on another way than it went",
            nuisance_grid: entry.filter(|_| none).map_or_else(Vec::new, |k| GRID.map(|part| vec![(k, part * largest)]).to_vec()),
            afterwards: curvature.into_iter().map(Unknown::logarithmic).collect(),
            ..Cause::default()
        }
    })
}
