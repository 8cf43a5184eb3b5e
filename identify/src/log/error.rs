//! Mistakes in an experiment or its logs: place, mistake, likely cause and fix.

use super::advice::advice;
use crate::number::{fixed, four_digits};
use pliant_scene::words::Num;
use pliant_scene::{Place, SceneError};
use std::fmt;

/// An experiment or log that is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LogError {
    /// The scene itself is wrong.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its experiment, or a log.
    #[error(transparent)]
    Log(#[from] Refused),
}

/// A mistake and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Where: file, line (of a text file), field, column or array entry.
    pub place: Place,
    /// What.
    pub mistake: Box<LogMistake>,
}

impl std::error::Error for Refused {}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (cause, fix) = advice(&self.mistake);
        write!(f, "{}: {}\n  likely cause: {cause}\n  fix: {fix}", self.place, self.mistake)
    }
}

impl LogError {
    pub(super) fn new(place: Place, mistake: LogMistake) -> Self {
        Self::Log(Refused { place, mistake: Box::new(mistake) })
    }
}

/// A mistake in an experiment or a log.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum LogMistake {
    /// No `[experiment]`.
    #[error("the scene has no [experiment]")]
    NoExperiment,
    /// A node that a rope or sheet does not have.
    #[error("{kind} \"{name}\" has no node {node}: it has {count}")]
    NoNode { kind: &'static str, name: String, node: i64, count: usize },
    /// A start taken from readings that are not there.
    #[error("records begin where the data are, and node {node} of cloth \"{cloth}\" has no marker")]
    Unmarked { cloth: String, node: usize },
    /// No file to read.
    #[error("there is no log to read")]
    NoRecord,
    /// No marker, sensor or orientation.
    #[error("the experiment observes nothing: it has no [[experiment.{}]]", if *.bodies { "joint]], [[experiment.marker]] or [[experiment.orientation" } else { "marker" })]
    NoMarker { bodies: bool },
    /// A key that belongs to another kind of object.
    #[error("`{key}` is given, but only {owner} have one")]
    Misplaced { key: &'static str, owner: &'static str },
    /// Two sensors of one quantity at one joint.
    #[error("joint \"{joint}\" has two sensors of its {quantity}")]
    TwoSensors { joint: String, quantity: &'static str },
    /// A torque sensor where nothing drives.
    #[error("no actuator drives joint \"{joint}\", so there is no torque to measure")]
    NoTorque { joint: String },
    /// The torque of a motor whose command is delayed, lagging, summed up or limited.
    #[error(
        "the torque of motor \"{actuator}\" cannot be read: its delay, lag, saturation or delta_scale stands between command and torque"
    )]
    ShapedTorque { actuator: String },
    /// As many columns as an orientation needs.
    #[error("gives {found} columns; an orientation has four (a quaternion w, x, y, z) or three (a rotation vector)")]
    OrientationColumns { found: usize },
    /// A quaternion that is none.
    #[error("the quaternion's length is {}, not 1", four_digits(*.length))]
    Quaternion { length: f64 },
    /// Readings that only CSV files can hold.
    #[error("sensors at joints and orientations are read from CSV files, and this record is an npz file")]
    OnlyCsv,
    /// Angles that betray another unit.
    #[error("joint \"{joint}\" moves over {} {unit}", four_digits(*.spread))]
    Angles { joint: String, spread: f64, unit: &'static str, limits: Option<f64> },
    /// None of several keys, or more than one.
    #[error("{} of the keys {keys} is given", if *.given == 0 { "none" } else { "more than one" })]
    OneOf { keys: &'static str, given: usize },
    /// A word that names nothing.
    #[error("there is no {kind} \"{name}\"")]
    Unknown { kind: &'static str, name: String, nearest: Option<String>, known: String },
    /// A gripper or actuator without logged inputs.
    #[error("{kind} \"{name}\" has no [[experiment.input]]")]
    NoInput { kind: &'static str, name: String },
    /// A gripper or actuator with two of them.
    #[error("{kind} \"{name}\" has more than one [[experiment.input]]")]
    TwoInputs { kind: &'static str, name: String },
    /// As many columns or points as inputs are needed.
    #[error("gives {found} {what}, but {kind} \"{name}\" has {needed} inputs: {names}")]
    InputCount { kind: &'static str, name: String, found: usize, what: &'static str, needed: usize, names: String },
    /// A number outside its interval.
    #[error("is {}, but must lie between {} and {} {unit}", Num(*.value), Num(*.low), Num(*.high))]
    Range { value: f64, low: f64, high: f64, unit: &'static str },
    /// Bounds in the wrong order.
    #[error("the lower bound {} is not below the upper bound {}", Num(*.lower), Num(*.upper))]
    Bounds { lower: f64, upper: f64 },
    /// A pattern that would tie parameters of the sensor.
    #[error("`{path}` would tie parameters of the sensor to one value, which says nothing of a sensor")]
    TiedSensor { path: String, each: String },
    /// A parameter that is freed twice.
    #[error("`{path}` is free already, by {other}")]
    FreeTwice { path: String, other: String },
    /// A bound outside the physical range.
    #[error("the bound of `{path}` is {} {unit}, but it can only be from {} to {}", Num(*.value), Num(*.low), Num(*.high))]
    Unphysical { path: String, value: f64, low: f64, high: f64, unit: &'static str },
    /// A starting value outside the bounds.
    #[error("the scene's `{path}` is {} {unit}, outside its bounds {} to {}", Num(*.value), Num(*.lower), Num(*.upper))]
    Outside { path: String, value: f64, lower: f64, upper: f64, unit: &'static str },
    /// Nothing to fit.
    #[error("lists no free parameter, so there is nothing to fit")]
    NothingFree,
    /// Nothing to fit to.
    #[error("every record is held out, so there is nothing to fit to")]
    AllHeldOut,
    /// The file cannot be read.
    #[error("cannot be read: {error}")]
    Read { error: String },
    /// Not a known kind of file.
    #[error("is not a log that pliant reads")]
    Kind,
    /// A file of no content.
    #[error("is empty: it has no header and no rows")]
    Empty,
    /// The mapping is for the other kind of file.
    #[error("has no `{key}`, which {kind} files need")]
    Mapping { key: &'static str, kind: &'static str },
    /// A column that is not there.
    #[error("there is no column \"{name}\"")]
    NoColumn { name: String, nearest: Option<String>, known: String },
    /// A column that is there twice.
    #[error("there are two columns \"{name}\"")]
    TwoColumns { name: String },
    /// A row of another length.
    #[error("the row has {found} cells instead of {expected}")]
    Ragged { found: usize, expected: usize },
    /// Text where a number belongs.
    #[error("\"{found}\" is not a number")]
    NotANumber { found: String },
    /// A missing sample.
    #[error("is {found}")]
    Missing { found: &'static str, of: Need },
    /// A clock that runs backwards or stands still.
    #[error("the clock {} from {} s to {} s", if after < before { "runs backwards" } else { "stands still" }, fixed(*.before, 6), fixed(*.after, 6))]
    Clock { before: f64, after: f64, reversed: bool },
    /// A measurement that is there twice.
    #[error("record {name} has the same times and readings as record {other}")]
    SameRecord { name: String, other: String },
    /// Too few samples.
    #[error("the record has {found} samples; at least {needed} are needed")]
    TooFew { found: usize, needed: usize },
    /// A record shorter than its segments.
    #[error("the record lasts {} s, shorter than {key} = {} s", fixed(*.duration, 4), Num(*.needed))]
    TooShort { duration: f64, key: &'static str, needed: f64 },
    /// A sample period that the step does not divide.
    #[error("the samples are {} s apart, which is {} steps of {} s, not a whole number of them", fixed(*.period, 6), fixed(*.ratio, 4), Num(*.step))]
    Period { period: f64, step: f64, ratio: f64 },
    /// A sample period that betrays another unit.
    #[error("the samples are {} s apart, which is {} steps of {} s", fixed(*.period, 6), fixed(*.ratio, if *.ratio < 1.0 { 4 } else { 0 }), Num(*.step))]
    ClockUnit { period: f64, step: f64, ratio: f64 },
    /// Positions that betray another unit.
    #[error("markers and grippers spread over {} m, but ropes and cloth are {} m long", fixed(*.extent, 4), fixed(*.length, 4))]
    Extent { extent: f64, length: f64 },
    /// An npz file without that array.
    #[error("there is no array \"{name}\"")]
    NoArray { name: String, nearest: Option<String>, known: String },
    /// No array named, and several to choose from.
    #[error("which array is meant? The file has {known}")]
    WhichArray { known: String },
    /// An array of numbers that are not floating point.
    #[error("the array does not hold float32 or float64 numbers: {error}")]
    Type { error: String },
    /// An array of the wrong shape.
    #[error("the array has shape {found:?}; expected {expected}")]
    Shape { found: Vec<usize>, expected: &'static str },
    /// A point or record that the array does not have.
    #[error("there is no {what} {index}: the array has {count}")]
    NoPoint { what: &'static str, index: i64, count: usize },
    /// Arrays of one record that do not belong together.
    #[error("array \"{name}\" has {found} {what}, but array \"{other}\" has {expected}")]
    Disagree { name: String, found: usize, other: String, expected: usize, what: &'static str },
}

/// Quantity that a sample is needed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The clock.
    Clock,
    /// An input.
    Input,
    /// A marker.
    Marker,
    /// A marker that may be missing.
    HiddenMarker,
    /// A sensor at a joint, or an orientation.
    Reading,
    /// One that may be missing.
    HiddenReading,
}
