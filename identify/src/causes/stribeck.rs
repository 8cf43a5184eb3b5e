//! Friction at rest beyond that in motion (Stribeck): the bound of dry friction is c + s exp(−(v/v_s)²).
//!
//! Without an excess s nothing determines the speed v_s it fades at, so the effect is looked at for several; the best one counts, at a
//! price. Once the excess is there, the speed is fitted too where the data determine it, and stays at that value where not. An excess that
//! fades at a speed which is never reached is dry friction.

use super::{Cause, Situation};

/// Speeds over the joint's own root mean square.
const GRID: [f64; 3] = [0.03, 0.1, 0.3];

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "friction is larger at rest than in motion",
        excitation: "pull slowly until it breaks away, and reverse slowly",
        becomes: Some("coulomb_friction"),
        ..Cause::default()
    };
    let mut out = at.per_joint("stiction", 0.1, &shape);
    for cause in &mut out {
        let joint = cause.object.clone().unwrap_or_default();
        let entry = at.plan.model.params().find(&format!("{joint}.stribeck_velocity"));
        let speed = at.typical_speed(&joint);
        cause.nuisance_grid = entry.map_or_else(Vec::new, |entry| GRID.map(|part| vec![(entry, part * speed)]).to_vec());
    }
    out
}
