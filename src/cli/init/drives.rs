//! What drives the joints: commands of motors, torques, and columns that look like them and drive nothing.

use super::super::failure::Failure;
use super::draft::{Model, quoted};
use super::log::Log;
use super::matching::{Match, Matches};
use super::names::{self, Quantity};
use super::units;
use std::fmt::Write;

/// The entries of inputs: one for each actuator.
pub fn inputs(
    log: &Log,
    model: &mut Model,
    found: &Matches,
    experiment: &mut String,
    assumed: &mut Vec<String>,
) -> Result<(), Failure> {
    let mut commanded: Vec<String> = Vec::new();
    for m in &found.found {
        let column = &log.header[m.column];
        let actuator = match m.quantity {
            Quantity::Position | Quantity::Velocity | Quantity::Target => continue,
            Quantity::Command => Some(m.object.clone()),
            Quantity::Torque | Quantity::CommandedTorque => motor(model, found, m, column, assumed),
        };
        let Some(actuator) = actuator else { continue };
        let (key, unit) = units::of(log, model, m)?;
        let _ = write!(experiment, "[[experiment.input]]\nactuator = {}\ncolumns = [{}]\n", quoted(&actuator), quoted(column));
        // forces are in N, which is no torque's unit
        if m.unit.is_some() && unit != "N" {
            let _ = writeln!(experiment, "{key} = \"{unit}\"");
        }
        let said = if m.unit.is_some() { format!(" [{unit}]") } else { String::new() };
        assumed.push(format!("{column} -> command of {actuator}{said}"));
        commanded.push(actuator);
    }
    match model.actuators.iter().find(|(name, _)| !commanded.contains(name)) {
        Some((name, joint)) => Err(Failure::Init {
            place: log.path.display().to_string(),
            what: format!("no column has the command of actuator `{name}` at joint `{joint}`"),
            cause: "the log has none, or its column has another name",
            fix: format!(
                "name a column `{name}` or `{joint}_{}`, or take the actuator out of the model",
                if model.servos.contains(name) { "cmd" } else { "torque" }
            ),
        }),
        None => Ok(()),
    }
}

/// The actuator that a column with the torque of a joint commands: that of the joint, or a new one where it has none. None where
/// another column drives the joint: the command of its actuator, or a torque that was measured.
fn motor(model: &mut Model, found: &Matches, m: &Match, column: &str, assumed: &mut Vec<String>) -> Option<String> {
    let is_there = |quantity, object: &str| found.found.iter().any(|other| other.quantity == quantity && other.object == object);
    if m.quantity == Quantity::CommandedTorque && is_there(Quantity::Torque, &m.object) {
        assumed.push(format!("{column}: left out, since {} is driven by the torque that was measured", m.object));
        return None;
    }
    if let Some((name, _)) = model.actuators.iter().find(|(_, joint)| *joint == m.object) {
        if is_there(Quantity::Command, name) || model.servos.contains(name) {
            assumed.push(format!("{column}: left out, since {name} has a command of its own"));
            return None;
        }
        return Some(name.clone());
    }
    let name = format!("motor_{}", m.object);
    let _ = write!(model.text, "\n[[actuator]]\nname = {}\njoint = {}\nkind = \"torque\"\n", quoted(&name), quoted(&m.object));
    model.actuators.push((name.clone(), m.object.clone()));
    assumed.push(format!("{column}: drives {} by a torque motor `{name}`, which the model lacks", m.object));
    Some(name)
}

/// Says what is not driven and which columns are left out.
///
/// # Errors
/// A column that looks like a torque or a command, where a joint that it may belong to is driven by none: without it the diagnosis would
/// explain the motion of a driven arm by the physics of one that is not.
pub fn without(log: &Log, model: &Model, found: &Matches, assumed: &mut Vec<String>) -> Result<(), Failure> {
    let is_driven = |joint: &str| model.actuators.iter().any(|(_, driven)| driven == joint);
    let is_measured = |joint: &&str| found.found.iter().any(|m| m.object == *joint);
    let measured: Vec<&str> = model.joints.iter().map(|(joint, _)| joint.as_str()).filter(is_measured).collect();
    for name in found.ignored.iter().map(|&k| &log.header[k]) {
        let Some(word) = names::drive(name) else { continue };
        let mentioned: Vec<&str> =
            model.joints.iter().map(|(joint, _)| joint.as_str()).filter(|joint| names::mentions(name, joint)).collect();
        let candidates = if mentioned.is_empty() { &measured } else { &mentioned };
        if let Some(joint) = candidates.iter().find(|joint| !is_driven(joint)) {
            let options: Vec<String> =
                candidates.iter().filter(|joint| !is_driven(joint)).map(|joint| format!("`{joint}_torque_Nm`")).collect();
            return Err(Failure::Init {
                place: format!("{}: column `{name}`", log.path.display()),
                what: format!(
                    "is a torque or a command by the word `{word}`, but belongs to no motor, and nothing else drives joint `{joint}`"
                ),
                cause: "the name is not that of a joint with a quantity and a unit, or the column is no torque",
                fix: format!(
                    "name it {} (also `_mNm`, `_Nmm`, `_Ncm`; multiply currents by the motor's constant), or leave it out with \
                     `--leave-out \"{name}\"` if it drove nothing; the target of a position controller needs an actuator of kind \
                     \"position\" at the joint in the model",
                    options.join(" or ")
                ),
            });
        }
    }
    let ignored: Vec<&str> = found.ignored.iter().map(|&k| log.header[k].as_str()).collect();
    if !ignored.is_empty() {
        assumed.push(format!("left out, as they name nothing in the model: {}", ignored.join(", ")));
    }
    let passive: Vec<&str> = measured.into_iter().filter(|joint| !is_driven(joint)).collect();
    if model.actuators.is_empty() {
        let none = "no motor: the logs have no torque and no command, so every joint is taken to move freely";
        assumed.insert(0, none.to_owned());
    } else if !passive.is_empty() {
        assumed.push(format!("taken to be passive, as no column drives them: {}", passive.join(", ")));
    }
    Ok(())
}
