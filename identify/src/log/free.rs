//! Refusing free parameters that the model, its bounds or each other do not allow.

use super::error::{LogError, LogMistake};
use super::experiment::{Free, JointSensor};
use super::setup::Setup;
use crate::sensor::{JOINT_BOUNDS, SENSOR_BOUNDS, SENSOR_PATHS, SENSOR_UNITS};
use crate::unknown::matches;
use pliant_math::params::{ANY, POSITIVE, Params};
use pliant_scene::words;

/// The unknown that a path names.
#[derive(Clone, Debug, PartialEq)]
enum Meaning {
    /// These entries of θ, tied to one value.
    Theta(Vec<usize>),
    /// This entry of the markers' sensor.
    Sensor(usize),
    /// This sensor at a joint, and which of its values.
    Joint(usize, usize),
    /// The offset of this marker along this axis.
    Beside(usize, usize),
}

impl Setup {
    /// Checks the free parameters against those of the model and the sensor: paths, bounds, the scene's values, repetitions.
    pub fn check_free(&self, params: &Params) -> Result<(), LogError> {
        let free = &self.experiment.fit.free;
        if free.is_empty() {
            return Ok(());
        }
        let meanings = free.iter().enumerate().map(|(k, one)| self.meaning(k, one, params)).collect::<Result<Vec<_>, _>>()?;
        for (k, (one, meaning)) in free.iter().zip(&meanings).enumerate() {
            if let Some(first) = meanings[..k].iter().position(|other| overlap(other, meaning)) {
                let other = format!("experiment.fit.free[{first}], `{}`", free[first].path);
                return Err(self.refuse(&at(k, "path"), LogMistake::FreeTwice { path: one.path.clone(), other }));
            }
            let (value, bounds, unit) = self.number(meaning, params);
            self.bounds(k, one, bounds, unit)?;
            if value < one.lower || value > one.upper {
                let key = if value < one.lower { "lower" } else { "upper" };
                let mistake = LogMistake::Outside { path: one.path.clone(), value, lower: one.lower, upper: one.upper, unit };
                return Err(self.refuse(&at(k, key), mistake));
            }
        }
        Ok(())
    }

    /// Bounds that physics allows to what a path names; none if that is nothing, or free already.
    pub(crate) fn may_be_freed(&self, path: &str, params: &Params) -> Option<(f64, f64)> {
        let free = &self.experiment.fit.free;
        let named = |path: &str| self.meaning(0, &Free { path: path.to_owned(), ..Free::default() }, params).ok();
        let meaning = named(path)?;
        let taken = free.iter().filter_map(|one| named(&one.path)).any(|other| overlap(&other, &meaning));
        let (_, (low, high), _) = self.number(&meaning, params);
        (!taken).then_some((if low == POSITIVE.0 { 0.0 } else { low }, high))
    }

    /// Value of what a path names, its physical bounds, and its unit.
    fn number(&self, meaning: &Meaning, params: &Params) -> (f64, (f64, f64), &'static str) {
        match meaning {
            Meaning::Theta(entries) => {
                let info = params.info(entries[0]);
                (params.values()[entries[0]], (info.lower, info.upper), info.unit)
            }
            Meaning::Sensor(entry) => (self.experiment.sensor.values().0[*entry], SENSOR_BOUNDS[*entry], SENSOR_UNITS[*entry]),
            Meaning::Joint(sensor, entry) => {
                (self.joint_values()[*sensor][*entry], JOINT_BOUNDS[*entry], self.joint_units(*sensor)[*entry])
            }
            Meaning::Beside(marker, axis) => (self.marker_offsets()[*marker][*axis], ANY, "m"),
        }
    }

    fn meaning(&self, k: usize, free: &Free, params: &Params) -> Result<Meaning, LogError> {
        if let Some(entry) = SENSOR_PATHS.iter().position(|path| *path == free.path) {
            return Ok(Meaning::Sensor(entry));
        }
        let sensors = self.experiment.joint.iter().map(JointSensor::paths);
        if let Some((sensor, entry)) = sensors.enumerate().find_map(|(k, p)| Some((k, p.iter().position(|x| *x == free.path)?))) {
            return Ok(Meaning::Joint(sensor, entry));
        }
        if let Some((marker, axis)) = self.offset_path(&free.path) {
            return Ok(Meaning::Beside(marker, axis));
        }
        let entries: Vec<usize> = (0..params.len()).filter(|&e| matches(&free.path, &params.info(e).path)).collect();
        if !entries.is_empty() {
            return Ok(Meaning::Theta(entries));
        }
        let tied: Vec<&str> = SENSOR_PATHS.into_iter().filter(|path| matches(&free.path, path)).collect();
        let mistake = if tied.is_empty() {
            let known: Vec<&str> = params.infos().iter().map(|info| info.path.as_str()).chain(SENSOR_PATHS).collect();
            let own: Vec<String> = self.experiment.joint.iter().flat_map(JointSensor::paths).collect();
            let offsets: Vec<String> = self.offset_paths().into_iter().map(|(path, ..)| path).collect();
            let known: Vec<&str> = known.into_iter().chain(own.iter().chain(&offsets).map(String::as_str)).collect();
            let nearest = words::nearest(&free.path, known.iter().copied()).map(str::to_owned);
            LogMistake::Unknown { kind: "parameter", name: free.path.clone(), nearest, known: known_near(&free.path, &known) }
        } else {
            LogMistake::TiedSensor { path: free.path.clone(), each: words::list(tied) }
        };
        Err(self.refuse(&at(k, "path"), mistake))
    }

    /// Bounds that physics allows. Zero passes where a value must be positive: the fit stays above it.
    fn bounds(&self, k: usize, free: &Free, (low, high): (f64, f64), unit: &'static str) -> Result<(), LogError> {
        let low = if low == POSITIVE.0 { 0.0 } else { low };
        for (key, value) in [("lower", free.lower), ("upper", free.upper)] {
            if value < low || value > high {
                let mistake = LogMistake::Unphysical { path: free.path.clone(), value, low, high, unit };
                return Err(self.refuse(&at(k, key), mistake));
            }
        }
        Ok(())
    }
}

fn at(k: usize, key: &str) -> String {
    format!("experiment.fit.free[{k}].{key}")
}

fn overlap(a: &Meaning, b: &Meaning) -> bool {
    match (a, b) {
        (Meaning::Theta(a), Meaning::Theta(b)) => a.iter().any(|entry| b.contains(entry)),
        _ => a == b,
    }
}

/// Known paths of the object that `path` names, nodes as `[*]`; if there is no such object, the names of all objects.
fn known_near(path: &str, known: &[&str]) -> String {
    let object = |path: &str| path.split('.').next().unwrap_or("").to_owned();
    let wanted = object(path);
    let mut out: Vec<String> = known.iter().filter(|k| object(k) == wanted).map(|k| any_node(k)).collect();
    if out.is_empty() {
        out = known.iter().map(|k| object(k) + ".…").collect();
    }
    out.dedup();
    words::list(out.iter().map(String::as_str))
}

/// `cable.node[3].mass` is `cable.node[*].mass`.
fn any_node(path: &str) -> String {
    match path.split_once(".node[").and_then(|(object, rest)| Some((object, rest.split_once(']')?.1))) {
        Some((object, rest)) => format!("{object}.node[*]{rest}"),
        None => path.to_owned(),
    }
}
