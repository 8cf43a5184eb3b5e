//! Numbers to be found: entries of θ and of the sensor, as coordinates in which a fit is well scaled.

use crate::sensor::{SENSOR_PATHS, SENSOR_UNITS, Sensor};
use crate::stats::score::Sign;
use pliant_engine::model::Model;

/// What an unknown sets.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// These entries of θ, all to the same value.
    Theta(Vec<usize>),
    /// This entry of the markers' sensor.
    Sensor(usize),
    /// This sensor at a joint, and which of its values ([`crate::sensor::JOINT_ENTRIES`]).
    Joint(usize, usize),
}

/// A number to be found. Its coordinate is `ln(value)` where `log`, else `value/scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Path, for messages.
    pub path: String,
    /// SI unit.
    pub unit: String,
    /// What it sets.
    pub target: Target,
    /// Bounds of the value.
    pub bounds: (f64, f64),
    /// Typical size of a change of the value.
    pub scale: f64,
    /// Logarithmic coordinate.
    pub log: bool,
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
    pub joints: Vec<[f64; 3]>,
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
            log: false,
            prior: None,
            probe: None,
        })
    }

    /// A value of a sensor at a joint, of this path.
    pub fn of_joint(path: String, unit: &str, (sensor, entry): (usize, usize), scale: f64, bounds: (f64, f64)) -> Self {
        let (unit, target) = (unit.to_owned(), Target::Joint(sensor, entry));
        Self { path, unit, target, bounds, scale, log: false, prior: None, probe: None }
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

    /// An entry of the sensor's parameters.
    pub fn of_sensor(entry: usize, scale: f64, bounds: (f64, f64)) -> Self {
        Self {
            path: SENSOR_PATHS[entry].to_owned(),
            unit: SENSOR_UNITS[entry].to_owned(),
            target: Target::Sensor(entry),
            bounds,
            scale,
            log: false,
            prior: None,
            probe: None,
        }
    }

    /// Switches to the logarithmic coordinate; for positive values that may change by orders of magnitude.
    pub fn logarithmic(mut self) -> Self {
        self.log = self.bounds.0 >= 0.0;
        self
    }

    /// Current value.
    pub fn value(&self, values: &Values) -> f64 {
        match &self.target {
            Target::Theta(entries) => values.theta[entries[0]],
            Target::Sensor(entry) => values.sensor.0[*entry],
            Target::Joint(sensor, entry) => values.joints[*sensor][*entry],
        }
    }

    /// Sets the value, kept within its bounds.
    pub fn set(&self, values: &mut Values, value: f64) {
        let value = value.clamp(self.bounds.0, self.bounds.1);
        match &self.target {
            Target::Theta(entries) => entries.iter().for_each(|&k| values.theta[k] = value),
            Target::Sensor(entry) => values.sensor.0[*entry] = value,
            Target::Joint(sensor, entry) => values.joints[*sensor][*entry] = value,
        }
    }

    /// d value/d coordinate at a value.
    pub fn slope(&self, value: f64) -> f64 {
        if self.log { value.max(f64::MIN_POSITIVE) } else { self.scale }
    }

    /// The value after the coordinate has changed by `delta`; logarithmic steps are at most a factor of e².
    pub fn moved(&self, value: f64, delta: f64) -> f64 {
        let moved = if self.log { value * delta.clamp(-2.0, 2.0).exp() } else { value + self.scale * delta };
        moved.clamp(self.bounds.0, self.bounds.1)
    }

    /// As [`Unknown::moved`], but as far as `delta` says: the end of an interval, not a step of a fit.
    pub fn far(&self, value: f64, delta: f64) -> f64 {
        let moved = if self.log { value * delta.exp() } else { value + self.scale * delta };
        moved.clamp(self.bounds.0, self.bounds.1)
    }

    /// Which directions from a value are physical.
    pub fn sign(&self, value: f64) -> Sign {
        if value <= self.bounds.0 {
            Sign::NonNegative
        } else if value >= self.bounds.1 {
            Sign::NonPositive
        } else {
            Sign::Any
        }
    }
}

/// `*` matches any run of characters.
pub(crate) fn matches(pattern: &str, path: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == path,
        Some((head, tail)) => path
            .strip_prefix(head)
            .is_some_and(|rest| (0..=rest.len()).any(|k| rest.is_char_boundary(k) && matches(tail, &rest[k..]))),
    }
}
