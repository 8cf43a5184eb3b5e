//! What the name of a column says: an object, a quantity, a unit.

/// Quantity that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Coordinate of a joint.
    Position,
    /// Its velocity.
    Velocity,
    /// Torque or force at it.
    Torque,
    /// Command of an actuator.
    Command,
}

/// A reading of a column's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The words that are neither quantity nor unit, joined, in lower case.
    pub object: String,
    /// Its quantity, if a word names one.
    pub quantity: Option<Quantity>,
    /// Its unit, if the name ends in one, as the word in lower case.
    pub unit: Option<String>,
}

const POSITION: [&str; 5] = ["q", "pos", "position", "angle", "theta"];
const VELOCITY: [&str; 5] = ["qd", "dq", "qdot", "vel", "velocity"];
const TORQUE: [&str; 4] = ["effort", "tau", "torque", "force"];
const COMMAND: [&str; 4] = ["u", "cmd", "command", "ctrl"];
const UNITS: [&str; 10] = ["rad", "deg", "mm", "cm", "m", "s", "ms", "us", "ns", "nm"];
/// Words that name a clock.
const CLOCK: [&str; 4] = ["t", "time", "timestamp", "stamp"];

/// The words of a name: parts between separators, in lower case.
fn words(name: &str) -> Vec<String> {
    let parts = name.split(|c: char| !c.is_alphanumeric());
    parts.filter(|word| !word.is_empty()).map(str::to_lowercase).collect()
}

/// The letters and digits of a name in lower case.
pub fn plain(name: &str) -> String {
    words(name).concat()
}

fn quantity(word: &str) -> Option<Quantity> {
    let kinds = [
        (&POSITION[..], Quantity::Position),
        (&VELOCITY[..], Quantity::Velocity),
        (&TORQUE[..], Quantity::Torque),
        (&COMMAND[..], Quantity::Command),
    ];
    kinds.into_iter().find(|(known, _)| known.contains(&word)).map(|(_, kind)| kind)
}

/// Reads the name of a column. "per second" at a velocity's unit is left out: `deg/s` and `deg_s` are `deg`.
pub fn read(name: &str) -> Reading {
    let mut words = words(name);
    let mut unit = None;
    if words.len() > 1 && words.last().is_some_and(|word| UNITS.contains(&word.as_str())) {
        unit = words.pop();
        let length_or_angle = |word: &String| ["rad", "deg", "mm", "cm", "m"].contains(&word.as_str());
        if unit.as_deref() == Some("s") && words.len() > 1 && words.last().is_some_and(length_or_angle) {
            unit = words.pop();
        }
    }
    let mut found = None;
    // a quantity stands first or last: a joint may well hold such a word in the middle of its name
    if words.len() > 1 {
        found = words.last().and_then(|word| quantity(word));
        if found.is_some() {
            words.pop();
        } else {
            found = words.first().and_then(|word| quantity(word));
            if found.is_some() {
                words.remove(0);
            }
        }
    }
    Reading { object: words.concat(), quantity: found, unit }
}

/// Whether a column is a clock.
pub fn is_clock(name: &str) -> bool {
    CLOCK.contains(&read(name).object.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is(name: &str, object: &str, quantity: Option<Quantity>, unit: Option<&str>) {
        let expected = Reading { object: object.to_owned(), quantity, unit: unit.map(str::to_owned) };
        assert_eq!(read(name), expected, "{name}");
    }

    #[test]
    fn names_are_read() {
        is("shoulder_pos_deg", "shoulder", Some(Quantity::Position), Some("deg"));
        is("Shoulder.velocity [deg/s]", "shoulder", Some(Quantity::Velocity), Some("deg"));
        is("tau_elbow", "elbow", Some(Quantity::Torque), None);
        is("elbow_torque_Nm", "elbow", Some(Quantity::Torque), Some("nm"));
        is("elbow (rad)", "elbow", None, Some("rad"));
        is("cmd.elbow", "elbow", Some(Quantity::Command), None);
        is("left_force_joint_q", "leftforcejoint", Some(Quantity::Position), None);
        is("q", "q", None, None);
    }

    #[test]
    fn clocks_are_found() {
        assert!(["t", "time_ms", "Timestamp [ns]", "stamp"].into_iter().all(is_clock));
        assert!(!is_clock("time_of_flight") && !is_clock("elbow_s"));
    }
}
