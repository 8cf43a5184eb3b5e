//! Numbers to be found: entries of θ and of the sensor, as coordinates in which a fit is well scaled.

use crate::form::Form;
use crate::sensor::{JointNumbers, SENSOR_PATHS, SENSOR_UNITS, Sensor};
use crate::stats::score::Sign;
use pliant_engine::model::Model;
use pliant_math::params::ANY;

/// Entries that an unknown sets.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// These entries of θ, all to the same value.
    Theta(Vec<usize>),
    /// The second of these entries of θ to the value, the first to its negative: limits that are the same both ways.
    Mirrored(usize, usize),
    /// This entry of the markers' sensor.
    Sensor(usize),
    /// This sensor at a joint, and which of its values ([`crate::sensor::JOINT_ENTRIES`]).
    Joint(usize, usize),
    /// Offset of these markers from the centreline along this material axis of the rod, 0 or 1.
    Beside(Vec<usize>, usize),
    /// Input delay of this control's motor, where the scene has no delay of it.
    Late(usize),
    /// A force, or an error of a reading, that no law describes; its size is 0.
    Form(Form),
}

impl Target {
    /// Whether both set the same number, followers aside.
    pub fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Theta(a), Self::Theta(b)) => a.first() == b.first(),
            (Self::Beside(a, i), Self::Beside(b, j)) => a.first() == b.first() && i == j,
            _ => self == other,
        }
    }

    /// Entries of θ that it sets, each with its factor.
    pub fn entries(&self) -> Vec<(usize, f64)> {
        match self {
            Self::Theta(entries) => entries.iter().map(|&k| (k, 1.0)).collect(),
            Self::Mirrored(low, high) => vec![(*low, -1.0), (*high, 1.0)],
            Self::Sensor(_) | Self::Joint(..) | Self::Beside(..) | Self::Late(_) | Self::Form(_) => Vec::new(),
        }
    }
}

/// Relation of the coordinate in which a fit moves to the value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// value/scale.
    Linear,
    /// ln(value).
    Log,
    /// 1/(value · scale): of a time constant at infinity, or of a limit that is never reached.
    Inverse,
}

/// A number to be found.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Path, for messages.
    pub path: String,
    /// SI unit.
    pub unit: String,
    /// Entries that it sets.
    pub target: Target,
    /// Bounds of the value.
    pub bounds: (f64, f64),
    /// Typical size of a change of the value; of the value's inverse where that is the coordinate.
    pub scale: f64,
    /// Its coordinate in a fit.
    pub coordinate: Coordinate,
    /// Normal prior of the value (mean, standard deviation).
    pub prior: Option<(f64, f64)>,
    /// Where its effect is looked at if its value is zero, because its law is silent there (dry friction of size zero), and where a
    /// fit of it begins.
    pub probe: Option<Probe>,
}

/// Small sizes of a quantity whose law is silent at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Small enough to change nothing else.
    pub small: f64,
    /// Where a fit begins.
    pub start: f64,
}

/// All values a simulation of an experiment depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// Parameters of the model.
    pub theta: Vec<f64>,
    /// Parameters of the markers' sensor.
    pub sensor: Sensor,
    /// Bias, scale and delay of each sensor at a joint.
    pub joints: Vec<JointNumbers>,
    /// Offset of each marker on a rod from the centreline along the two material axes there \[m\].
    pub offsets: Vec<[f64; 2]>,
    /// Input delay of each control beyond the delay of the scene's motor \[s\].
    pub late: Vec<f64>,
}

impl Unknown {
    /// An entry of θ (or all entries a `*` in the path matches, tied to one value); `None` if there is no such path.
    pub fn of_theta(model: &Model, pattern: &str, scale: f64) -> Option<Self> {
        let infos = model.params().infos();
        let entries: Vec<usize> = (0..infos.len()).filter(|&k| matches(pattern, &infos[k].path)).collect();
        let info = &infos[*entries.first()?];
        let value = model.params().values()[entries[0]];
        let positive = info.lower >= 0.0 && value > 0.0;
        Some(Self {
            path: if entries.len() == 1 { info.path.clone() } else { pattern.to_owned() },
            unit: info.unit.to_owned(),
            target: Target::Theta(entries),
            bounds: (info.lower, info.upper),
            scale: if positive { value } else { scale },
            coordinate: Coordinate::Linear,
            prior: None,
            probe: None,
        })
    }

    /// A value of a sensor at a joint, of this path.
    pub fn of_joint(path: String, unit: &str, (sensor, entry): (usize, usize), scale: f64, bounds: (f64, f64)) -> Self {
        let (unit, target) = (unit.to_owned(), Target::Joint(sensor, entry));
        Self { path, unit, target, bounds, scale, coordinate: Coordinate::Linear, prior: None, probe: None }
    }

    /// Offset common to these markers of a rod from its centreline along a material axis \[m\].
    pub fn beside(path: String, markers: Vec<usize>, axis: usize, scale: f64) -> Self {
        let (unit, target, bounds) = ("m".to_owned(), Target::Beside(markers, axis), ANY);
        Self { path, unit, target, bounds, scale, coordinate: Coordinate::Linear, prior: None, probe: None }
    }

    /// The delay of a control's motor that has none in the scene, of this path \[s\].
    pub fn of_late(path: String, control: usize, scale: f64, bounds: (f64, f64)) -> Self {
        let (unit, target) = ("s".to_owned(), Target::Late(control));
        Self { path, unit, target, bounds, scale, coordinate: Coordinate::Linear, prior: None, probe: None }
    }

    /// With a [`Probe`].
    pub fn probed(mut self, probe: Probe) -> Self {
        self.probe = Some(probe);
        self
    }

    /// The probe, where it is needed: at zero.
    pub fn silent(&self, values: &Values) -> Option<Probe> {
        self.probe.filter(|_| self.value(values) == 0.0)
    }

    /// A [`Form`], of this path.
    pub fn of_form(path: String, form: Form) -> Self {
        let (unit, target) = (String::new(), Target::Form(form));
        Self { path, unit, target, bounds: ANY, scale: 1.0, coordinate: Coordinate::Linear, prior: None, probe: None }
    }

    /// An entry of the sensor's parameters.
    pub fn of_sensor(entry: usize, scale: f64, bounds: (f64, f64)) -> Self {
        Self {
            path: SENSOR_PATHS[entry].to_owned(),
            unit: SENSOR_UNITS[entry].to_owned(),
            target: Target::Sensor(entry),
            bounds,
            scale,
            coordinate: Coordinate::Linear,
            prior: None,
            probe: None,
        }
    }

    /// Switches to the logarithmic coordinate; for positive values that may change by orders of magnitude.
    pub fn logarithmic(mut self) -> Self {
        if self.bounds.0 >= 0.0 {
            self.coordinate = Coordinate::Log;
        }
        self
    }

    /// Switches to the inverse as coordinate, with a typical size of it; for values between positive bounds of which the upper one
    /// stands for infinity.
    pub fn inverse(mut self, scale: f64, bounds: (f64, f64)) -> Self {
        (self.coordinate, self.scale, self.bounds) = (Coordinate::Inverse, scale, bounds);
        self
    }

    /// Current value.
    pub fn value(&self, values: &Values) -> f64 {
        match &self.target {
            Target::Theta(entries) => values.theta[entries[0]],
            Target::Mirrored(_, high) => values.theta[*high],
            Target::Sensor(entry) => values.sensor.0[*entry],
            Target::Joint(sensor, entry) => values.joints[*sensor][*entry],
            Target::Beside(markers, axis) => values.offsets[markers[0]][*axis],
            Target::Late(control) => values.late[*control],
            Target::Form(_) => 0.0,
        }
    }

    /// Sets the value, kept within its bounds.
    pub fn set(&self, values: &mut Values, value: f64) {
        let value = value.clamp(self.bounds.0, self.bounds.1);
        match &self.target {
            Target::Theta(entries) => entries.iter().for_each(|&k| values.theta[k] = value),
            Target::Mirrored(low, high) => (values.theta[*low], values.theta[*high]) = (-value, value),
            Target::Sensor(entry) => values.sensor.0[*entry] = value,
            Target::Joint(sensor, entry) => values.joints[*sensor][*entry] = value,
            Target::Beside(markers, axis) => markers.iter().for_each(|&k| values.offsets[k][*axis] = value),
            Target::Late(control) => values.late[*control] = value,
            Target::Form(_) => {}
        }
    }

    /// The coordinate of a value.
    pub fn coordinate_of(&self, value: f64) -> f64 {
        match self.coordinate {
            Coordinate::Linear => value / self.scale,
            Coordinate::Log => value.ln(),
            Coordinate::Inverse => 1.0 / (value * self.scale),
        }
    }

    /// d value/d coordinate at a value.
    pub fn slope(&self, value: f64) -> f64 {
        match self.coordinate {
            Coordinate::Linear => self.scale,
            Coordinate::Log => value.max(f64::MIN_POSITIVE),
            Coordinate::Inverse => -value * value * self.scale,
        }
    }

    /// The value after the coordinate has changed by `delta`; logarithmic steps are at most a factor of e².
    pub fn moved(&self, value: f64, delta: f64) -> f64 {
        self.far(value, if self.coordinate == Coordinate::Log { delta.clamp(-2.0, 2.0) } else { delta })
    }

    /// As [`Unknown::moved`], but as far as `delta` says: the end of an interval, not a step of a fit.
    pub fn far(&self, value: f64, delta: f64) -> f64 {
        let moved = match self.coordinate {
            Coordinate::Linear => value + self.scale * delta,
            Coordinate::Log => value * delta.exp(),
            // beyond infinity lie negative values; the upper bound stands for both
            Coordinate::Inverse => 1.0 / (1.0 / value + self.scale * delta).max(f64::MIN_POSITIVE),
        };
        moved.clamp(self.bounds.0, self.bounds.1)
    }

    /// Which directions of the coordinate from a value are physical.
    pub fn sign(&self, value: f64) -> Sign {
        let (mut low, mut high) = (value <= self.bounds.0, value >= self.bounds.1);
        if self.coordinate == Coordinate::Inverse {
            (low, high) = (high, low);
        }
        match (low, high) {
            (true, _) => Sign::NonNegative,
            (_, true) => Sign::NonPositive,
            _ => Sign::Any,
        }
    }

    /// Whether a step of the coordinate leads past a bound that the value is at.
    pub fn leaves(&self, value: f64, delta: f64) -> bool {
        match self.sign(value) {
            Sign::NonNegative => delta < 0.0,
            Sign::NonPositive => delta > 0.0,
            Sign::Any => false,
        }
    }
}

/// `*` matches any run of characters, `[2..4]` each of `[2]`, `[3]` and `[4]`.
pub(crate) fn matches(pattern: &str, path: &str) -> bool {
    if let Some((head, numbers, tail)) = range(pattern) {
        return path.match_indices('[').any(|(k, _)| {
            let number = path[k + 1..].split_once(']').and_then(|(digits, rest)| Some((digits.parse::<usize>().ok()?, rest)));
            number.is_some_and(|(n, rest)| numbers.contains(&n) && matches(head, &path[..k]) && matches(tail, rest))
        });
    }
    match pattern.split_once('*') {
        None => pattern == path,
        Some((head, tail)) => path
            .strip_prefix(head)
            .is_some_and(|rest| (0..=rest.len()).any(|k| rest.is_char_boundary(k) && matches(tail, &rest[k..]))),
    }
}

/// The text before the first range of numbers in a pattern, the numbers, and the text behind.
pub(crate) fn range(pattern: &str) -> Option<(&str, std::ops::RangeInclusive<usize>, &str)> {
    let one = |(k, _): (usize, &str)| {
        let (inside, tail) = pattern[k + 1..].split_once(']')?;
        let (first, last) = inside.split_once("..")?;
        Some((&pattern[..k], first.parse().ok()?..=last.parse().ok()?, tail))
    };
    pattern.match_indices('[').find_map(one)
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns_match_runs_of_characters_and_ranges_of_numbers() {
        assert!(matches("cable.node[2..4].mass", "cable.node[3].mass"));
        assert!(matches("*.node[2..4].rest_curvature[0]", "a.node[4].rest_curvature[0]"));
        assert!(matches("cable.node[2..12].rest_curvature[0..1]", "cable.node[10].rest_curvature[1]"));
        for other in ["cable.node[5].mass", "cable.node[1].mass", "cable.node[3].mas", "rope.node[3].mass", "cable.node[x].mass"]
        {
            assert!(!matches("cable.node[2..4].mass", other), "{other}");
        }
        assert!(!matches("cable.node[4..2].mass", "cable.node[3].mass"));
    }
}
