//! Sensors at joints and observed orientations: their units, paths and checks.

use super::check::Check;
use super::constants::LOG;
use super::error::{LogError, LogMistake};
use super::experiment::{Experiment, JointQuantity, JointSensor, Orientation};
use super::record::Record;
use super::setup::Setup;
use crate::sensor::JOINT_ENTRIES;
use pliant_math::rotation::{Map, normalized};
use pliant_scene::Place;
use std::f64::consts::TAU;

impl JointQuantity {
    /// In paths and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Torque => "torque",
        }
    }

    /// SI unit at a joint that turns or slides.
    pub fn unit(self, slides: bool) -> &'static str {
        match (self, slides) {
            (Self::Position, false) => "rad",
            (Self::Position, true) => "m",
            (Self::Velocity, false) => "rad/s",
            (Self::Velocity, true) => "m/s",
            (Self::Torque, false) => "N·m",
            (Self::Torque, true) => "N",
        }
    }

    /// SI unit of its rate of change.
    pub fn rate_unit(self, slides: bool) -> &'static str {
        match (self, slides) {
            (Self::Position, false) => "rad/s",
            (Self::Position, true) => "m/s",
            (Self::Velocity, false) => "rad/s²",
            (Self::Velocity, true) => "m/s²",
            (Self::Torque, false) => "N·m/s",
            (Self::Torque, true) => "N/s",
        }
    }

    fn floor(self) -> f64 {
        if self == Self::Position { 1e-4 } else { 1e-3 }
    }
}

impl JointSensor {
    /// Factor from the unit of the log to the SI unit.
    pub(super) fn factor(&self, slides: bool) -> f64 {
        match (self.measures, slides) {
            (JointQuantity::Torque, _) => 1.0,
            (_, true) => self.unit.metres(),
            (_, false) => self.angle_unit.radians(),
        }
    }

    /// Smallest standard deviation of a reading that is believed, in the reading's SI unit.
    pub fn floor(&self) -> f64 {
        self.noise_floor.unwrap_or(self.measures.floor())
    }

    /// Paths of its bias, scale, delay and drift.
    pub fn paths(&self) -> [String; JOINT_ENTRIES.len()] {
        JOINT_ENTRIES.map(|entry| format!("{}.{}_{entry}", self.joint, self.measures.name()))
    }
}

impl Orientation {
    /// Factor from the unit of the log to radians; 1 for quaternions.
    pub(super) fn factor(&self) -> f64 {
        if self.columns.len() == 3 { self.angle_unit.radians() } else { 1.0 }
    }

    /// Numbers of the log as a unit quaternion; NaN if one is missing.
    pub(super) fn quaternion(&self, numbers: &[f64]) -> Result<[f64; 4], LogMistake> {
        if numbers.iter().any(|x| !x.is_finite()) {
            return Ok([f64::NAN; 4]);
        }
        match numbers {
            [x, y, z] => Ok(Map::Exponential.turn(&nalgebra::Vector3::new(*x, *y, *z))),
            [w, x, y, z] => {
                let length = (w * w + x * x + y * y + z * z).sqrt();
                let unit = (length - 1.0).abs() <= LOG.unit_quaternion;
                if unit { Ok(normalized(&[*w, *x, *y, *z])) } else { Err(LogMistake::Quaternion { length }) }
            }
            _ => Err(LogMistake::OrientationColumns { found: numbers.len() }),
        }
    }
}

impl Check<'_> {
    pub(super) fn joint_sensors(&self, experiment: &Experiment) -> Result<(), LogError> {
        let axes = self.setup.axes();
        for (k, sensor) in experiment.joint.iter().enumerate() {
            let at = |key: &str| format!("experiment.joint[{k}].{key}");
            if !axes.iter().any(|(name, _)| *name == sensor.joint) {
                let names: Vec<&str> = axes.iter().map(|(name, _)| name.as_str()).collect();
                return self.unknown(&at("joint"), "joint", &sensor.joint, &names);
            }
            let same = |other: &JointSensor| other.joint == sensor.joint && other.measures == sensor.measures;
            if experiment.joint[..k].iter().any(same) {
                let mistake = LogMistake::TwoSensors { joint: sensor.joint.clone(), quantity: sensor.measures.name() };
                return self.refuse(&format!("experiment.joint[{k}]"), mistake);
            }
            let prescribed = self.setup.scene.actuator.iter().any(|a| a.joint == sensor.joint);
            if sensor.measures == JointQuantity::Torque && !prescribed {
                return self.refuse(&at("measures"), LogMistake::NoTorque { joint: sensor.joint.clone() });
            }
            let remembers = |a: &&pliant_scene::Actuator| {
                let signal = a.delay.is_some() || a.lag.is_some() || a.delta_scale.is_some();
                a.joint == sensor.joint && (signal || a.saturation.is_some())
            };
            if let Some(motor) =
                self.setup.scene.actuator.iter().find(remembers).filter(|_| sensor.measures == JointQuantity::Torque)
            {
                return self.refuse(&at("measures"), LogMistake::ShapedTorque { actuator: motor.name.clone() });
            }
            self.range(&at("scale"), sensor.scale, -1e6, 1e6, "")?;
            self.range(&at("delay"), sensor.delay, -10.0, 10.0, "s")?;
            self.range(&at("bias"), sensor.bias, -1e6, 1e6, "")?;
            self.range(&at("drift"), sensor.drift, -1e6, 1e6, "")?;
            self.range(&at("noise_floor"), sensor.floor(), 1e-12, 1e6, "")?;
        }
        Ok(())
    }

    pub(super) fn orientations(&self, experiment: &Experiment) -> Result<(), LogError> {
        let names: Vec<&str> = self.setup.scene.body.iter().map(|body| body.name.as_str()).collect();
        for (k, observed) in experiment.orientation.iter().enumerate() {
            let at = |key: &str| format!("experiment.orientation[{k}].{key}");
            if !names.contains(&observed.body.as_str()) {
                return self.unknown(&at("body"), "body", &observed.body, &names);
            }
            if !matches!(observed.columns.len(), 3 | 4) {
                return self.refuse(&at("columns"), LogMistake::OrientationColumns { found: observed.columns.len() });
            }
            self.range(&at("noise_floor"), observed.noise_floor, 1e-12, 3.0, "rad")?;
        }
        Ok(())
    }
}

/// Coordinates that no joint of this scene can have, unless they are in another unit.
pub(super) fn check_angles(setup: &Setup, record: &Record, place: &dyn Fn(usize) -> Place) -> Result<(), LogError> {
    let axes = setup.axes();
    for (k, sensor) in setup.experiment.joint.iter().enumerate() {
        let slides = axes.iter().any(|(name, slides)| *name == sensor.joint && *slides);
        if sensor.measures != JointQuantity::Position {
            continue;
        }
        let values = record.joints.iter().map(|row| row[k]).filter(|x| x.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let joint = setup.scene.body.iter().flat_map(|body| &body.joint).find(|j| j.name == sensor.joint);
        let limits = joint.and_then(|j| j.limits).map(|[low, high]| high - low);
        let most = match limits {
            Some(limits) => LOG.beyond_limits * limits,
            None if slides => f64::INFINITY,
            None => LOG.revolutions * TAU,
        };
        // a wheel may well turn round and round: only a range in degrees that an arm would have in radians is doubted
        let as_degrees = !slides && (high - low).to_radians() <= TAU;
        if high - low > most && (slides || as_degrees || limits.is_some()) {
            let place = Place { line: None, column: None, field: format!("column {}", sensor.column), ..place(0) };
            let unit = JointQuantity::Position.unit(slides);
            let mistake = LogMistake::Angles { joint: sensor.joint.clone(), spread: high - low, unit, limits };
            return Err(LogError::new(place, mistake));
        }
    }
    Ok(())
}
