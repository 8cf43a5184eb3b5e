//! The size of gravity, where bodies or cloth are watched by a sensor of positions.
//!
//! For a body in free fall it cannot be told from the sensor's scale unless a length is known. In scenes with ropes it would be all
//! their forces together, and at joints that only encoders watch, all masses. Of a sheet all forces together are [`super::cloth_mass`].

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let seen = at.ropes().is_empty() && !at.plan.markers.is_empty() && at.value("gravity.magnitude") > 0.0;
    let unknown = at.theta("gravity.magnitude", 1.0).filter(|_| seen);
    let cause = |unknown| Cause {
        meaning: "gravity is stronger or weaker than simulated, or the clock runs fast or slow",
        unknowns: vec![unknown],
        excitation: "measure a known length: a wrong scale of the sensor changes it, gravity does not",
        ..Cause::default()
    };
    unknown.map(cause).into_iter().collect()
}
