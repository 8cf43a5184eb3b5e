//! The `[experiment]` of a scene: the measurements, their files, and the free parameters.

use super::units::{AngleUnit, LengthUnit, TimeUnit, TorqueUnit};
use crate::sensor::{SCALE, Sensor, TIME_OFFSET};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The measurements, their places in the logs, and the free parameters.
///
/// A marker at p is read as y(t) = scale · R(rotation) p(t − time_offset) + bias: see `sensor` for the values, and free them as
/// `sensor.scale` and so on in `fit`. A joint's sensor reads y(t) = scale · x(t − time_offset − delay) + bias + drift · t, with values of its own
/// for each but the time offset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Knowledge of the state at the beginning of each record.
    #[serde(default)]
    pub initial: Beginning,
    /// Course of the inputs between the samples of a log.
    #[serde(default)]
    pub interpolation: Interpolation,
    /// "markers" if the grippers' inputs come from the sensor that sees the markers: its scale, rotation and bias act on both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gripper_sensor: Option<GripperSensor>,
    /// Known errors of the sensor that sees the markers; none if left out.
    #[serde(default, skip_serializing_if = "SensorStart::is_perfect")]
    pub sensor: SensorStart,
    /// Clock of the logs.
    pub time: Clock,
    /// Smallest standard deviation of a measured position that is believed [m].
    #[serde(default = "noise_floor")]
    pub noise_floor: f64,
    /// Time from a record's start from which alone the initial state of a held-out record is estimated [s], for a forecast from there; if left
    /// out, from as much of it as is judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lead_in: Option<f64>,
    /// Observed points.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub marker: Vec<Marker>,
    /// Sensors at joints: encoders, tachometers, torque sensors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<JointSensor>,
    /// Observed orientations of bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub orientation: Vec<Orientation>,
    /// Logged inputs, one entry per gripper and per actuator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub input: Vec<Input>,
    /// Log files; the command's `--log FILE` adds more.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub record: Vec<RecordFile>,
    /// The baseline fit.
    #[serde(default)]
    pub fit: Fit,
}

fn noise_floor() -> f64 {
    1e-4
}

/// Time from which the initial state of a record is estimated at first, where no `lead_in` is given \[s\]: two samples of the slowest logs, a
/// part of a swing of arms and ropes. A record that is shorter is refused; its clock is likely to have another unit.
pub const LEAD_IN: f64 = 0.1;

/// Knowledge of the state at the beginning of a record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Beginning {
    /// Position and velocity of every free node and joint are unknowns with a prior from the data.
    #[default]
    Measured,
    /// Position and velocity from the data, taken as they are (of a cloth every free node needs a marker): where the model's error within a few samples exceeds theirs, an
    /// unknown initial state would only hide it.
    Given,
    /// Static equilibrium with the record's first inputs.
    Rest,
}

/// Course of the inputs between the samples of a log; before the first and after the last they are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// They go straight from sample to sample.
    #[default]
    Linear,
    /// They follow a cubic spline through all samples, for commands and motions that were smooth: of these it leaves an error that falls
    /// with the fourth power of the time between samples, and a straight line one that falls with the second. Where an input jumps, a
    /// spline swings past it on both sides.
    Smooth,
    /// Commands and speeds stay as they are until the next sample, as those of a controller at the rate of the log; prescribed positions, which cannot
    /// jump, go straight.
    Held,
}

impl Interpolation {
    /// The ways that are not this one.
    pub fn others(self) -> [Self; 2] {
        match self {
            Self::Linear => [Self::Smooth, Self::Held],
            Self::Smooth => [Self::Linear, Self::Held],
            Self::Held => [Self::Linear, Self::Smooth],
        }
    }

    /// Its word in a scene file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Smooth => "smooth",
            Self::Held => "held",
        }
    }
}

/// The sensor that measured the grippers' inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GripperSensor {
    /// The one that sees the markers.
    Markers,
}

/// Known errors of the markers' sensor: y(t) = scale · R(rotation) p(t − time_offset) + bias. A fit starts from these values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorStart {
    /// Offset added to every position [m].
    pub bias: [f64; 3],
    /// Factor on every length [-].
    pub scale: f64,
    /// Vector about which, and by whose length, positions are turned about the world's origin [rad].
    pub rotation: [f64; 3],
    /// Delay of the markers' clock against the grippers' [s].
    pub time_offset: f64,
}

impl Default for SensorStart {
    fn default() -> Self {
        Self { bias: [0.0; 3], scale: 1.0, rotation: [0.0; 3], time_offset: 0.0 }
    }
}

impl SensorStart {
    /// Whether it has no errors.
    pub fn is_perfect(&self) -> bool {
        *self == Self::default()
    }

    /// The same as a sensor.
    pub fn values(&self) -> Sensor {
        let mut out = Sensor::default();
        out.0[..SCALE].copy_from_slice(&self.bias);
        out.0[SCALE] = self.scale;
        out.0[SCALE + 1..TIME_OFFSET].copy_from_slice(&self.rotation);
        out.0[TIME_OFFSET] = self.time_offset;
        out
    }
}

/// Clock of the logs: one of `column` (CSV), `array` (npz), `rate`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    /// Column of a CSV file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Array of an npz file, of shape (time) or (records, time).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Samples per second [Hz], where the log has no clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Unit of the column or array.
    #[serde(default)]
    pub unit: TimeUnit,
}

/// An observed point of a rope, at a `node` or at an `arc` length, of a cloth, at a `node`, or of a `body`; in CSV `columns` or at an
/// `index` of an npz array.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Marker {
    /// Name of the rope.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rope: Option<String>,
    /// Name of the sheet of cloth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
    /// Name of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Place in the body's frame [m]; its origin if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// Node number: along the rope, or of the cloth's vertex in its grid (i · nodes\[1\] + j) or file; negative numbers count from the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<i64>,
    /// Arc length from the first node at rest [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arc: Option<f64>,
    /// Its distance from the centreline along the two material axes of a rope that twists [m]; 0 if left out.
    ///
    /// `fit` frees it by the paths `marker[k].offset[0]` and `marker[k].offset[1]`, k the marker's number in the experiment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<[f64; 2]>,
    /// Columns of x, y, z in a CSV file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<[String; 3]>,
    /// Array of an npz file; by default the record's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Point in the array; negative numbers count from the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<i64>,
    /// Unit of the log.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Whether samples may be missing (NaN or an empty cell), as when the marker was hidden.
    #[serde(default)]
    pub may_be_missing: bool,
}

/// A sensor at a joint of one axis: y(t) = scale · x(t − time_offset − delay) + bias + drift · t, with the time offset of `sensor` and t = 0 at
/// the first sample of each record.
///
/// `fit` frees its values by the paths `joint.position_bias`, `joint.position_scale`, `joint.position_delay`, `joint.position_drift`, and
/// likewise for `velocity` and `torque`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSensor {
    /// Name of the joint, `name[0]` or `name[1]` for the two axes of a universal one.
    pub joint: String,
    /// The quantity x.
    #[serde(default)]
    pub measures: JointQuantity,
    /// Column of a CSV file.
    pub column: String,
    /// Unit in the log of a sliding joint's coordinate; of its velocity, the same per second. Forces are in N.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Unit in the log of a turning joint's coordinate; of its velocity, the same per second. Torques are in N·m.
    #[serde(default)]
    pub angle_unit: AngleUnit,
    /// Offset added to every reading [rad, rad/s, N·m; m, m/s, N].
    #[serde(default)]
    pub bias: f64,
    /// Factor on every reading [-].
    #[serde(default = "one")]
    pub scale: f64,
    /// Delay of the reading beyond `sensor.time_offset` [s].
    #[serde(default)]
    pub delay: f64,
    /// Rate at which the offset grows over each record [rad/s, rad/s², N·m/s; m/s, m/s², N/s].
    #[serde(default)]
    pub drift: f64,
    /// Smallest standard deviation of a reading that is believed [rad, rad/s, N·m; m, m/s, N]; 10⁻⁴, 10⁻³ and 10⁻³ if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_floor: Option<f64>,
    /// Whether samples may be missing (NaN or an empty cell).
    #[serde(default)]
    pub may_be_missing: bool,
}

fn one() -> f64 {
    1.0
}

/// Quantity that a sensor at a joint measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum JointQuantity {
    /// Its coordinate [rad or m].
    #[default]
    Position,
    /// Its velocity [rad/s or m/s].
    Velocity,
    /// The torque or force of the actuators at the joint [N·m or N].
    Torque,
}

/// The observed orientation of a body in the world, in CSV `columns`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orientation {
    /// Name of the body.
    pub body: String,
    /// Columns of a CSV file: four for a quaternion (w, x, y, z), three for a rotation vector.
    pub columns: Vec<String>,
    /// Unit in the log of a rotation vector.
    #[serde(default)]
    pub angle_unit: AngleUnit,
    /// Smallest standard deviation of a measured angle that is believed [rad].
    #[serde(default = "angle_floor")]
    pub noise_floor: f64,
    /// Whether samples may be missing (NaN or an empty cell).
    #[serde(default)]
    pub may_be_missing: bool,
}

fn angle_floor() -> f64 {
    1e-3
}

/// The logged inputs of one gripper or actuator: in CSV `columns`, or at `indices` of an npz array. Between samples they are read
/// as the experiment's `interpolation` says, linearly if it is left out; a controller that holds its command from one sample to the next
/// then seems half a sample late. Over gaps of more than 0.1 s they are unknown, and the record is cut there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Name of the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gripper: Option<String>,
    /// Name of the actuator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator: Option<String>,
    /// Columns of a CSV file, as many as the gripper has inputs, in their order; one for an actuator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<Vec<String>>,
    /// Array of an npz file; by default the record's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Points in the array, three inputs each; negative numbers count from the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub indices: Option<Vec<i64>>,
    /// Unit of positions; of velocities, the same per second. Axes have none.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Unit of angles; of angular velocities, the same per second.
    #[serde(default)]
    pub angle_unit: AngleUnit,
    /// Unit of the torques that command a torque motor.
    #[serde(default, skip_serializing_if = "TorqueUnit::is_si")]
    pub torque_unit: TorqueUnit,
}

impl Input {
    /// Name of the gripper or actuator.
    pub fn target(&self) -> &str {
        self.gripper.as_deref().or(self.actuator.as_deref()).unwrap_or("")
    }
}

/// A log file: CSV holds one record, an npz array of shape (time, points, 3) one, (records, time, points, 3) several.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordFile {
    /// Path of the file, relative to the scene's folder.
    pub file: String,
    /// Array of an npz file that markers and inputs point into.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Role of its records. Without any role whole records are split, every fourth (at least one) held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
    /// Numbers of records of an npz array to leave out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skip: Vec<usize>,
}

/// Role of a record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Parameters are found from it.
    #[default]
    Fit,
    /// Results are judged by it.
    HeldOut,
}

/// The baseline fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Fit {
    /// Free parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub free: Vec<Free>,
    /// Length of the shooting segments [s]; chosen from the data if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segment: Option<f64>,
}

/// A free parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Free {
    /// Path, e.g. `cable.bend_stiffness`; `cable.node[*].mass` ties all that match into one, `cable.node[2..4].mass`
    /// those of the nodes 2, 3 and 4. Of the markers' sensor:
    /// `sensor.bias[0]` to `[2]` [m], `sensor.scale` [-], `sensor.rotation[0]` to `[2]` [rad], `sensor.time_offset` [s]. Of the
    /// sensors at joints: `shoulder.position_bias`, `shoulder.position_scale`, `shoulder.position_delay`, and so on.
    pub path: String,
    /// Lower bound, in the parameter's unit.
    pub lower: f64,
    /// Upper bound, in the parameter's unit.
    pub upper: f64,
    /// Prior knowledge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Prior>,
}

/// A normal prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// Mean, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation, in the parameter's unit.
    pub std: f64,
}
