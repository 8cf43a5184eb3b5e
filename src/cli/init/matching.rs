//! Which column of a log belongs to which joint or actuator of a model.

use super::names::{self, Quantity};

/// A column that belongs to an object of the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Match {
    /// Number of the column in the header.
    pub column: usize,
    /// Name of the joint, or of the actuator for a command.
    pub object: String,
    /// Its quantity.
    pub quantity: Quantity,
    /// Unit that the column's name ends in.
    pub unit: Option<&'static str>,
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
/// actuator's command where no joint has that name.
pub fn columns(header: &[&str], clock: usize, joints: &[&str], actuators: &[&str]) -> Result<Matches, Mistake> {
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

fn one(column: usize, name: &str, joints: &[&str], actuators: &[&str]) -> Option<Match> {
    let reading = names::read(name);
    let named = |known: &[&str], wanted: &str| known.iter().find(|k| names::plain(k) == wanted).map(|k| (*k).to_owned());
    let make = |object, quantity| Match { column, object, quantity, unit: reading.unit };
    // the whole name first: an object may be called `force_sensor` or `arm_q`
    let whole = names::plain(name);
    if let Some(joint) = named(joints, &whole) {
        return Some(Match { unit: None, ..make(joint, Quantity::Position) });
    }
    if let Some(actuator) = named(actuators, &whole) {
        return Some(Match { unit: None, ..make(actuator, Quantity::Command) });
    }
    match reading.quantity {
        Some(Quantity::Command) => named(actuators, &reading.object).map(|object| make(object, Quantity::Command)),
        Some(quantity) => named(joints, &reading.object).map(|object| make(object, quantity)),
        None => named(joints, &reading.object)
            .map(|object| make(object, Quantity::Position))
            .or_else(|| named(actuators, &reading.object).map(|object| make(object, Quantity::Command))),
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
        let matches = columns(&header, 0, &["shoulder", "elbow"], &["motor"]).unwrap();
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
