//! Markers that are not on the centreline: stuck on the skin, or on a stem, and turning with the cable.

use super::{Cause, Situation};
use crate::log::offset_path;
use crate::unknown::Unknown;

/// A typical offset \[m\]: the radius of a marker or a cable.
const TYPICAL: f64 = 3e-3;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let markers = at.markers_on(rod);
        let one = |&k: &usize| [0, 1].map(|a| Unknown::beside(offset_path(k, a), vec![k], a, TYPICAL));
        Cause {
            meaning: "the markers are beside the centreline of the rod and turn with it",
            unknowns: markers.iter().flat_map(one).collect(),
            excitation: "turn both ends about the rod's axis: what is on the centreline stays",
            ..Cause::default()
        }
    })
}
