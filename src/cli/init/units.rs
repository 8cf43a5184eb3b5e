//! The unit of a column, by the joint and the quantity that it belongs to.

use super::super::failure::Failure;
use super::draft::Model;
use super::log::Log;
use super::matching::Match;
use super::names::Quantity;
use std::f64::consts::PI;

/// Units of the position of a joint that turns or slides, as a scene names them, and their sizes [rad] or [m]; the usual one first.
pub const fn positions(slides: bool) -> &'static [(&'static str, f64)] {
    if slides { &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)] } else { &[("rad", 1.0), ("deg", PI / 180.0)] }
}

/// The key of a scene for the unit of a column, and its word; that of SI where the name says none.
pub fn of(log: &Log, model: &Model, m: &Match) -> Result<(&'static str, &'static str), Failure> {
    let servo = model.servos.contains(&m.object);
    let is_torque = match m.quantity {
        Quantity::Position | Quantity::Velocity | Quantity::Target => false,
        Quantity::Torque | Quantity::CommandedTorque => true,
        Quantity::Command => !servo,
    };
    let joint = model.actuators.iter().find(|(name, _)| m.quantity == Quantity::Command && *name == m.object);
    let joint = joint.map_or(&m.object, |(_, joint)| joint);
    let slides = model.joints.iter().any(|(name, slides)| name == joint && *slides);
    let (key, known) = match (is_torque, slides) {
        (false, _) => (if slides { "unit" } else { "angle_unit" }, positions(slides).iter().map(|(name, _)| *name).collect()),
        (true, false) => ("torque_unit", vec!["Nm", "Ncm", "Nmm", "mNm"]),
        (true, true) => ("torque_unit", vec!["N"]),
    };
    let Some(unit) = m.unit else { return Ok((key, known[0])) };
    known.iter().find(|name| **name == unit).map(|unit| (key, *unit)).ok_or_else(|| Failure::Init {
        place: format!("{}: column `{}`", log.path.display(), log.header[m.column]),
        what: format!("is in {unit}, and joint `{joint}` {}", if slides { "slides" } else { "turns" }),
        cause: "the column belongs to something else, or its name ends in a word that looks like a unit",
        fix: format!(
            "rename the column; units of this joint's {} are {}",
            if is_torque { "torque" } else { "motion" },
            known.join(", ")
        ),
    })
}
