//! Logs: measurements, read from CSV and npz files by the mapping in the scene's `[experiment]`, checked, in SI units.
//!
//! ```text
//! scene.toml ── Setup::read ── Setup { scene, experiment } ── Setup::read_logs ── Logs { records, split }
//! ```
//! Inputs stay at the log's own times; [`Record::step_inputs`] reads them at the steps of a simulation, along straight
//! lines or a smooth curve.
//! The sample [`period`] must be a whole number of steps (within 2 %); samples may fall a
//! little beside the steps: [`Record::samples_in_steps`] says where.

#![allow(rustdoc::broken_intra_doc_links)] // `[m]` is a unit here, and its escape would be read in the schema's descriptions

mod advice;
mod check;
mod constants;
mod csv_file;
mod curve;
mod error;
mod experiment;
mod free;
mod joint_sensor;
mod lone;
mod npz_file;
mod record;
mod setup;
mod units;

pub use csv_file::{CsvTable, Gaps};
pub use error::{LogError, LogMistake, Need, Refused};
pub use experiment::{
    Beginning, Clock, Experiment, Fit, Free, GripperSensor, Input, Interpolation, JointQuantity, JointSensor, LEAD_IN, Marker,
    Orientation, Prior, RecordFile, Role, SensorStart,
};
pub use lone::{Lone, LoneSensor};
pub use record::{Logs, Record, Split, StepTime, period};
pub use setup::Setup;
pub(crate) use setup::offset_path;
pub use units::{AngleUnit, LengthUnit, TimeUnit, TorqueUnit};
