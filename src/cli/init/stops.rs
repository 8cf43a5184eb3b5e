//! Stops of joints that no log comes near.
//!
//! Stops need an integrator for impacts, which is of first order: with steps of 2.5 ms its error was 15 mrad over 4 s of an arm's motion, read with a
//! noise of 0.35 mrad. A stop that no reading comes near plays no part in what was measured, and is left out.

use super::log::Log;
use super::matching::columns;
use super::names::Quantity;
use super::units;
use pliant::scene::{JointKind, Scene};

/// Part of the range between two stops [-] within which a reading is near one: a joint at rest on a stop reads it with noise.
const NEAR: f64 = 0.02;

/// Joints with stops that are measured in every log and come near a stop in none.
pub fn never_reached<X>(scene: &Scene<X>, logs: &[Log]) -> Vec<String> {
    let joints = scene.body.iter().flat_map(|body| &body.joint);
    let limited = joints.filter_map(|joint| Some((joint, joint.limits?)));
    let clear = limited.filter(|(joint, limits)| {
        let slides = joint.kind == JointKind::Prismatic;
        logs.iter().all(|log| read(log, &joint.name, slides).is_some_and(|range| inside(range, *limits)))
    });
    clear.map(|(joint, _)| joint.name.clone()).collect()
}

/// Whether all readings between these lie between the stops, and near none.
fn inside([least, most]: [f64; 2], [low, high]: [f64; 2]) -> bool {
    let margin = NEAR * (high - low);
    least <= most && least > low + margin && most < high - margin
}

/// Smallest and largest reading of a joint's position in a log [rad] or [m].
fn read(log: &Log, joint: &str, slides: bool) -> Option<[f64; 2]> {
    let header: Vec<&str> = log.header.iter().map(String::as_str).collect();
    let found = columns(&header, log.clock, &[joint], &[]).ok()?.found;
    let position = found.iter().find(|m| m.quantity == Quantity::Position)?;
    let known = units::positions(slides);
    let (_, size) = position.unit.map_or(known.first(), |unit| known.iter().find(|(name, _)| *name == unit))?;
    Some(log.ranges[position.column].map(|x| size * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_at_a_stop_is_near_it() {
        assert!(inside([-1.0, 1.5], [-2.0, 2.0]));
        assert!(!inside([-1.0, 1.97], [-2.0, 2.0]) && !inside([-2.1, 0.0], [-2.0, 2.0]));
        assert!(!inside([f64::INFINITY, f64::NEG_INFINITY], [-2.0, 2.0]), "nothing was read");
    }
}
