//! Which column of a log belongs to which joint or actuator of a model.

use super::names::{self, Quantity};

/// A column that belongs to an object of the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Match {
    /// Number of the column in the header.
    pub column: usize,
    /// Name of the joint, or of the actuator for a command.
    pub object: String,
    /// Its quantity; a target is the command of the servo that it is told to.
    pub quantity: Quantity,
    /// Unit that the column's name ends in.
    pub unit: Option<&'static str>,
}

/// An actuator that a column may command.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    /// Its name.
    pub name: &'a str,
    /// The joint that it drives.
    pub joint: &'a str,
    /// Whether it is told a position or a velocity, and no torque.
    pub servo: bool,
}

/// The columns of a log, sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matches {
    /// Those that belong to an object.
    pub found: Vec<Match>,
    /// Numbers of the others but the clock.
    pub ignored: Vec<usize>,
}

/// Columns that cannot be told apart, or none at all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// No column is a clock.
    NoClock,
    /// Several are.
    TwoClocks(usize, usize),
    /// No column names a joint or an actuator.
    Nothing,
    /// Two columns name one quantity of an object.
    Twice(usize, usize, String),
}

/// The one column that is a clock.
pub fn clock(header: &[&str]) -> Result<usize, Mistake> {
    let mut clocks = (0..header.len()).filter(|&k| names::is_clock(header[k]));
    match (clocks.next(), clocks.next()) {
        (Some(first), None) => Ok(first),
        (Some(first), Some(second)) => Err(Mistake::TwoClocks(first, second)),
        (None, _) => Err(Mistake::NoClock),
    }
}

/// Matches the columns beside the clock with joints and actuators. A name without a quantity is a joint's position, and an
/// actuator's command where no joint has that name. A command may also name the joint of an actuator that is the only one there.
pub fn columns(header: &[&str], clock: usize, joints: &[&str], actuators: &[Driven]) -> Result<Matches, Mistake> {
    let mut out = Matches::default();
    for (column, name) in header.iter().enumerate().filter(|(column, _)| *column != clock) {
        match one(column, name, joints, actuators) {
            Some(new) => {
                if let Some(old) = out.found.iter().find(|old| old.object == new.object && old.quantity == new.quantity) {
                    return Err(Mistake::Twice(old.column, column, new.object));
                }
                out.found.push(new);
            }
            None => out.ignored.push(column),
        }
    }
    if out.found.is_empty() { Err(Mistake::Nothing) } else { Ok(out) }
}

fn one(column: usize, name: &str, joints: &[&str], actuators: &[Driven]) -> Option<Match> {
    let reading = names::read(name);
    let named = |known: &[&str], wanted: &str| known.iter().find(|k| names::plain(k) == wanted).map(|k| (*k).to_owned());
    let called = |wanted: &str| actuators.iter().find(|a| names::plain(a.name) == wanted);
    let alone_at = |joint: &str| {
        let mut there = actuators.iter().filter(|a| names::plain(a.joint) == joint);
        there.next().filter(|_| there.next().is_none())
    };
    let driven = |a: &Driven| a.name.to_owned();
    let make = |object, quantity| Match { column, object, quantity, unit: reading.unit };
    // the whole name first: an object may be called `force_sensor` or `arm_q`
    let whole = names::plain(name);
    if let Some(joint) = named(joints, &whole) {
        return Some(Match { unit: None, ..make(joint, Quantity::Position) });
    }
    if let Some(actuator) = called(&whole) {
        return Some(Match { unit: None, ..make(driven(actuator), Quantity::Command) });
    }
    match reading.quantity {
        Some(kind @ (Quantity::Command | Quantity::Target)) => called(&reading.object)
            .or_else(|| alone_at(&reading.object))
            .filter(|a| kind == Quantity::Command || a.servo)
            .map(|a| make(driven(a), Quantity::Command)),
        Some(quantity) => named(joints, &reading.object).map(|object| make(object, quantity)),
        None => named(joints, &reading.object)
            .map(|object| make(object, Quantity::Position))
            .or_else(|| called(&reading.object).map(|a| make(driven(a), Quantity::Command))),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn columns_find_their_joints() {
        let header = ["time_ms", "Shoulder_pos_deg", "elbow.vel", "tau_elbow", "cmd_motor", "temperature"];
        assert_eq!(clock(&header), Ok(0));
        let matches = columns(&header, 0, &["shoulder", "elbow"], &[driven("motor", "elbow", false)]).unwrap();
        let said: Vec<_> = matches.found.iter().map(|m| (m.column, m.object.as_str(), m.quantity, m.unit)).collect();
        let expected = [
            (1, "shoulder", Quantity::Position, Some("deg")),
            (2, "elbow", Quantity::Velocity, None),
            (3, "elbow", Quantity::Torque, None),
            (4, "motor", Quantity::Command, None),
        ];
        assert_eq!(said, expected);
        assert_eq!(matches.ignored, [5]);
    }

    fn driven<'a>(name: &'a str, joint: &'a str, servo: bool) -> Driven<'a> {
        Driven { name, joint, servo }
    }

    /// A command may have the name of its joint, if one actuator is there; a target position is told to a servo only.
    #[test]
    fn commands_find_the_actuator_of_their_joint() {
        let all = [
            driven("m_1", "shoulder", true),
            driven("m_2", "elbow", false),
            driven("m_3", "wrist", true),
            driven("m_4", "wrist", true),
        ];
        let header = ["t", "shoulder_target_rad", "elbow_cmd_Nm", "elbow_setpoint", "wrist_cmd", "m_4_cmd"];
        let matches = columns(&header, 0, &["shoulder", "elbow", "wrist"], &all).unwrap();
        let said: Vec<_> = matches.found.iter().map(|m| (m.column, m.object.as_str(), m.quantity, m.unit)).collect();
        let command = Quantity::Command;
        assert_eq!(said, [(1, "m_1", command, Some("rad")), (2, "m_2", command, Some("Nm")), (5, "m_4", command, None)]);
        assert_eq!(matches.ignored, [3, 4]);
    }

    #[test]
    fn mistakes_are_named() {
        assert_eq!(clock(&["elbow"]), Err(Mistake::NoClock));
        assert_eq!(clock(&["t", "elbow", "stamp"]), Err(Mistake::TwoClocks(0, 2)));
        assert_eq!(columns(&["t", "wrist"], 0, &["elbow"], &[]), Err(Mistake::Nothing));
        let twice = columns(&["t", "elbow_q", "elbow_pos"], 0, &["elbow"], &[]);
        assert_eq!(twice, Err(Mistake::Twice(1, 2, "elbow".to_owned())));
    }

    #[test]
    fn whole_names_come_first() {
        let matches = columns(&["t", "arm_q", "arm"], 0, &["arm", "arm_q"], &[]).unwrap();
        let said: Vec<_> = matches.found.iter().map(|m| m.object.as_str()).collect();
        assert_eq!(said, ["arm_q", "arm"]);
    }
}
