//! A rod part of whose stiffness relaxes (one Prony branch): a slow change under load, hysteresis at the branch's own speed.
//!
//! Without a branch nothing determines its time, so the effect is looked at for several; the best one counts, at a price.

use super::{Cause, Situation};
use crate::unknown::Unknown;

/// Times of relaxation \[s\].
const GRID: [f64; 3] = [0.05, 0.5, 5.0];
/// A typical part of the stiffness.
const TYPICAL: f64 = 0.1;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let in_pieces = at.plan.in_pieces();
    at.per_rod(|rod| {
        let entry = at.plan.model.params().find(&format!("{rod}.creep_time"));
        let none = at.value(&format!("{rod}.creep_fraction")) == 0.0;
        let unknowns: Vec<_> = at.theta(&format!("{rod}.creep_fraction"), TYPICAL).into_iter().collect();
        Cause {
            meaning: "part of the rod's stiffness relaxes with time (creep)",
            unknowns: if in_pieces { Vec::new() } else { unknowns },
            untestable: in_pieces
                .then(|| "the records are fitted in pieces, and what has relaxed before a piece begins is unknown".to_owned()),
            excitation: "bend it, hold it, and let go: it comes back at once, and then slowly a little more",
            afterwards: at
                .theta(&format!("{rod}.creep_time"), 1.0)
                .filter(|_| none && !in_pieces)
                .into_iter()
                .map(Unknown::logarithmic)
                .collect(),
            nuisance_grid: entry.filter(|_| none).map_or_else(Vec::new, |entry| GRID.map(|time| vec![(entry, time)]).to_vec()),
            ..Cause::default()
        }
    })
}
