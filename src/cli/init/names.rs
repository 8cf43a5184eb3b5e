//! What the name of a column says: an object, a quantity, a unit.

/// Quantity that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Coordinate of a joint.
    Position,
    /// Its velocity.
    Velocity,
    /// Torque or force at it, as measured or unsaid.
    Torque,
    /// Torque or force that it was told to have.
    CommandedTorque,
    /// Command of an actuator.
    Command,
    /// Position or velocity that a joint was told to have.
    Target,
}

/// A reading of a column's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The words that are neither quantity nor unit, joined, in lower case.
    pub object: String,
    /// Its quantity, if a word names one.
    pub quantity: Option<Quantity>,
    /// Its unit, if the name ends in one, as scenes write it.
    pub unit: Option<&'static str>,
}

const POSITION: [&str; 5] = ["q", "pos", "position", "angle", "theta"];
const VELOCITY: [&str; 5] = ["qd", "dq", "qdot", "vel", "velocity"];
const TORQUE: [&str; 4] = ["effort", "tau", "torque", "force"];
const COMMAND: [&str; 4] = ["u", "cmd", "command", "ctrl"];
const TARGET: [&str; 6] = ["desired", "des", "target", "setpoint", "ref", "reference"];
/// Words of what drives a joint without being its torque or the command of an actuator.
const DRIVE: [&str; 6] = ["current", "amps", "voltage", "volts", "pwm", "duty"];
/// Words that names of columns may end in, and the unit as scenes write it. "Per second" of a velocity is left out.
const UNITS: [(&[&str], &str); 43] = [
    (&["rad"], "rad"),
    (&["rads"], "rad"),
    (&["radian"], "rad"),
    (&["radians"], "rad"),
    (&["rad", "s"], "rad"),
    (&["deg"], "deg"),
    (&["degs"], "deg"),
    (&["degree"], "deg"),
    (&["degrees"], "deg"),
    (&["deg", "s"], "deg"),
    (&["mm"], "mm"),
    (&["mm", "s"], "mm"),
    (&["cm"], "cm"),
    (&["cm", "s"], "cm"),
    (&["m"], "m"),
    (&["m", "s"], "m"),
    (&["s"], "s"),
    (&["sec"], "s"),
    (&["secs"], "s"),
    (&["second"], "s"),
    (&["seconds"], "s"),
    (&["ms"], "ms"),
    (&["msec"], "ms"),
    (&["millis"], "ms"),
    (&["milliseconds"], "ms"),
    (&["us"], "us"),
    (&["usec"], "us"),
    (&["micros"], "us"),
    (&["microseconds"], "us"),
    (&["ns"], "ns"),
    (&["nsec"], "ns"),
    (&["nanos"], "ns"),
    (&["nanoseconds"], "ns"),
    (&["n"], "N"),
    (&["nm"], "Nm"),
    (&["n", "m"], "Nm"),
    (&["ncm"], "Ncm"),
    (&["n", "cm"], "Ncm"),
    (&["nmm"], "Nmm"),
    (&["n", "mm"], "Nmm"),
    (&["mnm"], "mNm"),
    (&["m", "nm"], "mNm"),
    (&["mn", "m"], "mNm"),
];
/// Words that name a clock.
const CLOCK: [&str; 4] = ["t", "time", "timestamp", "stamp"];

/// The words of a name, in lower case: parts between separators, and between a small letter or a digit and a capital with a small
/// letter behind it (`joint1Torque`, and also `mNm`).
fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut spaced = String::new();
    for (k, &letter) in letters.iter().enumerate() {
        let begins = letter.is_uppercase() && letters.get(k + 1).is_some_and(|next| next.is_lowercase());
        if begins && k > 0 && (letters[k - 1].is_lowercase() || letters[k - 1].is_numeric()) {
            spaced.push(' ');
        }
        spaced.push(letter);
    }
    let parts = spaced.split(|c: char| !c.is_alphanumeric());
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
        (&TARGET[..], Quantity::Target),
    ];
    kinds.into_iter().find(|(known, _)| known.contains(&word)).map(|(_, kind)| kind)
}

/// What one or two words say together.
fn quantities(words: &[String]) -> Option<Quantity> {
    use Quantity::{Command, CommandedTorque, Position, Target, Torque, Velocity};
    let kinds: Vec<Quantity> = words.iter().map(|word| quantity(word)).collect::<Option<_>>()?;
    match kinds[..] {
        [kind] => Some(kind),
        [Torque, Command | Target] | [Command | Target, Torque] => Some(CommandedTorque),
        [Position | Velocity, Command | Target] | [Command | Target, Position | Velocity] => Some(Target),
        _ => None,
    }
}

/// Reads the name of a column.
pub fn read(name: &str) -> Reading {
    let mut words = words(name);
    let is_end = |(end, _): &&(&[&str], &str)| words.len() > end.len() && words[words.len() - end.len()..] == **end;
    let unit = UNITS.iter().filter(is_end).max_by_key(|(end, _)| end.len()).copied();
    words.truncate(words.len() - unit.map_or(0, |(end, _)| end.len()));
    // a quantity stands first or last: a joint may well hold such a word in the middle of its name
    let n = words.len();
    let places = [(2, true), (1, true), (2, false), (1, false)].into_iter().filter(|(count, _)| *count < n);
    let ranges = places.map(|(count, last)| if last { n - count..n } else { 0..count });
    let found = ranges.filter_map(|range| Some((quantities(&words[range.clone()])?, range))).next();
    if let Some((_, range)) = &found {
        words.drain(range.clone());
    }
    Reading { object: words.concat(), quantity: found.map(|(kind, _)| kind), unit: unit.map(|(_, unit)| unit) }
}

/// The word by which a column looks like a torque or a command, if one does. Numbers behind it do not count: `tau1`.
pub fn drive(name: &str) -> Option<String> {
    let drives =
        |word: &str| TORQUE.contains(&word) || COMMAND.contains(&word) || TARGET.contains(&word) || DRIVE.contains(&word);
    words(name).into_iter().find(|word| drives(word.trim_end_matches(char::is_numeric)))
}

/// Whether a column's name has the words of a joint's name in it.
pub fn mentions(column: &str, joint: &str) -> bool {
    let (column, joint) = (words(column), words(joint));
    !joint.is_empty() && column.windows(joint.len()).any(|part| part == joint)
}

/// Whether a column is a clock.
pub fn is_clock(name: &str) -> bool {
    let object = read(name).object;
    // `sec` or `ms` alone
    let time = |(word, unit): &(&[&str], &str)| ["s", "ms", "us", "ns"].contains(unit) && **word == [object.as_str()];
    CLOCK.contains(&object.as_str()) || UNITS.iter().any(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is(name: &str, object: &str, quantity: Option<Quantity>, unit: Option<&'static str>) {
        let expected = Reading { object: object.to_owned(), quantity, unit };
        assert_eq!(read(name), expected, "{name}");
    }

    #[test]
    fn names_are_read() {
        is("shoulder_pos_deg", "shoulder", Some(Quantity::Position), Some("deg"));
        is("Shoulder.velocity [deg/s]", "shoulder", Some(Quantity::Velocity), Some("deg"));
        is("tau_elbow", "elbow", Some(Quantity::Torque), None);
        is("elbow_torque_Nm", "elbow", Some(Quantity::Torque), Some("Nm"));
        for (ending, unit) in
            [("[N·m]", "Nm"), ("N_m", "Nm"), ("mNm", "mNm"), ("[mN·m]", "mNm"), ("Nmm", "Nmm"), ("N*cm", "Ncm"), ("N", "N")]
        {
            is(&format!("elbow_torque {ending}"), "elbow", Some(Quantity::Torque), Some(unit));
        }
        for name in ["elbow_cmd_torque", "elbow_torque_cmd", "elbow_effort_cmd", "cmd_effort_elbow"] {
            is(name, "elbow", Some(Quantity::CommandedTorque), None);
        }
        for name in ["elbow_pos_cmd_rad", "elbow_desired [rad]", "target_q_elbow_rad", "elbow_setpoint_rad"] {
            is(name, "elbow", Some(Quantity::Target), Some("rad"));
        }
        is("joint1PosDegrees", "joint1", Some(Quantity::Position), Some("deg"));
        is("elbow (rad)", "elbow", None, Some("rad"));
        is("cmd.elbow", "elbow", Some(Quantity::Command), None);
        is("left_force_joint_q", "leftforcejoint", Some(Quantity::Position), None);
        is("q", "q", None, None);
    }

    #[test]
    fn clocks_are_found() {
        assert!(["t", "time_ms", "Timestamp [ns]", "stamp", "timestamp_sec", "t_seconds", "sec"].into_iter().all(is_clock));
        assert!(!is_clock("time_of_flight") && !is_clock("elbow_s"));
    }

    #[test]
    fn drives_are_seen_in_names_that_cannot_be_read() {
        let seen = ["tau1", "joint1_current_A", "Joint1TargetPos", "u_2"].map(|name| drive(name).is_some());
        assert_eq!(seen, [true; 4]);
        assert_eq!(["temperature", "elbow_q", "autau"].map(drive), [None, None, None]);
        assert!(mentions("left_shoulder_pan_current", "shoulder_pan") && !mentions("tau1", "a"));
    }
}
