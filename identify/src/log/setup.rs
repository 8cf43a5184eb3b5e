//! A scene with its experiment, and the way from it to the records.

use super::check::{check_experiment, check_record, check_twice};
use super::error::{LogError, LogMistake};
use super::experiment::{Experiment, Input, RecordFile, Role};
use super::record::{Logs, Record};
use super::{csv_file, lone, npz_file};
use crate::sensor::{JOINT_ENTRIES, JointNumbers};
use pliant_scene::{Control, Joint, JointKind, Place, Scene, Source, control_list, parse_source, words};
use std::path::{Path, PathBuf};

/// A scene file with an experiment that fits it.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scene; its `experiment` is empty, see the field of that name.
    pub scene: Scene,
    /// The measurements and the free parameters.
    pub experiment: Experiment,
    /// The scene's text, to locate errors in.
    pub source: Source,
    /// Folder that the paths of records are relative to.
    pub folder: PathBuf,
}

impl Setup {
    /// Reads a scene file with an experiment.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, LogError> {
        let path = path.as_ref();
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Self::from_source(Source::read(path)?, folder)
    }

    /// The same for a text; paths of records are relative to `folder`.
    pub fn from_source(source: Source, folder: PathBuf) -> Result<Self, LogError> {
        let full: Scene<Experiment> = parse_source(&source)?;
        let scene = full.with_experiment(None);
        let Some(experiment) = full.experiment else {
            return Err(LogError::new(source.place("experiment"), LogMistake::NoExperiment));
        };
        let setup = Self { scene, experiment, source, folder };
        check_experiment(&setup)?;
        Ok(setup)
    }

    /// The scene with its experiment, as a file holds it; for writing an extended scene.
    pub fn to_scene(&self) -> Scene<Experiment> {
        self.scene.with_experiment(Some(self.experiment.clone()))
    }

    /// Reads the scene's records, and those of `more` files (`--log FILE`), by the same mapping.
    pub fn read_logs(&self, more: &[PathBuf]) -> Result<Logs, LogError> {
        let listed = |k: usize| self.source.place(&format!("experiment.record[{k}].file"));
        let named = self.experiment.record.iter().enumerate();
        let named = named.map(|(k, record)| (self.folder.join(&record.file), record.clone(), listed(k)));
        let added =
            more.iter().map(|path| (path.clone(), self.added(path), Place { file: Some(name_of(path)), ..Place::default() }));
        let (mut records, mut roles, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for (path, file, place) in named.chain(added) {
            let read = self.read_file(&path, &file)?;
            roles.extend(std::iter::repeat_n(file.role, read.len()));
            places.extend(std::iter::repeat_n(place, read.len()));
            records.extend(read);
        }
        if records.is_empty() {
            return Err(LogError::new(self.source.place("experiment"), LogMistake::NoRecord));
        }
        check_twice(&records, &places)?;
        Ok(Logs::split(records, &roles))
    }

    /// A file of the command line: without role, with the array of the scene's first record.
    fn added(&self, path: &Path) -> RecordFile {
        let array = self.experiment.record.first().and_then(|record| record.array.clone());
        RecordFile { file: name_of(path), array, role: None::<Role>, skip: Vec::new() }
    }

    fn read_file(&self, path: &Path, file: &RecordFile) -> Result<Vec<Record>, LogError> {
        match path.extension() {
            _ if csv_file::is_csv(path) => csv_file::read(self, path, file),
            Some(extension) if extension.eq_ignore_ascii_case("npz") => npz_file::read(self, path, file),
            _ => Err(LogError::new(Place { file: Some(path.display().to_string()), ..Place::default() }, LogMistake::Kind)),
        }
    }

    /// Finishes a record: time from 0 on, phases, checks. `place` locates a sample's clock.
    pub(super) fn finish(&self, mut record: Record, place: &dyn Fn(usize) -> Place) -> Result<Record, LogError> {
        let actuators = self.scene.actuator.len();
        let controls = self.controls();
        let of_grippers = controls.len() - actuators;
        // an actuator acts throughout a step, a gripper's position is where the step ends
        let phase = |(k, control): (usize, &Control)| if k >= of_grippers || control.unit.ends_with("/s") { 0.5 } else { 1.0 };
        record.phase = controls.iter().enumerate().map(phase).collect();
        check_record(self, &record, place)?;
        let start = record.time[0];
        record.time.iter_mut().for_each(|t| *t -= start);
        lone::leave_out(&mut record);
        Ok(record)
    }

    /// An error at a field of the scene.
    pub(crate) fn refuse(&self, field: &str, mistake: LogMistake) -> LogError {
        LogError::new(self.source.place(field), mistake)
    }

    /// The inputs of the model.
    pub fn controls(&self) -> Vec<Control> {
        control_list(&self.scene)
    }

    /// (number in the experiment, input, factors to SI units of its controls), gripper after gripper, then the actuators.
    pub(super) fn ordered_inputs(&self) -> Vec<(usize, &Input, Vec<f64>)> {
        let of = |name: &String| {
            let (k, input) = self.experiment.input.iter().enumerate().find(|(_, input)| input.target() == *name)?;
            let factors = self.controls_of(name).iter().map(|control| factor(input, control.unit)).collect();
            Some((k, input, factors))
        };
        let grippers = self.scene.gripper.iter().map(|gripper| &gripper.name);
        grippers.chain(self.scene.actuator.iter().map(|actuator| &actuator.name)).filter_map(of).collect()
    }

    /// The inputs of one gripper or actuator.
    pub(super) fn controls_of(&self, name: &str) -> Vec<Control> {
        let mine =
            |control: &Control| control.name.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        self.controls().into_iter().filter(mine).collect()
    }

    /// Bias, scale, delay and drift of each sensor at a joint, as the experiment has them.
    pub fn joint_values(&self) -> Vec<JointNumbers> {
        self.experiment.joint.iter().map(|sensor| [sensor.bias, sensor.scale, sensor.delay, sensor.drift]).collect()
    }

    /// Offset of each marker from the centreline of its rod, as given in the experiment \[m\].
    pub fn marker_offsets(&self) -> Vec<[f64; 2]> {
        self.experiment.marker.iter().map(|marker| marker.offset.unwrap_or_default()).collect()
    }

    /// Paths of the offsets of markers on ropes that twist, with the marker's number and the axis.
    pub(crate) fn offset_paths(&self) -> Vec<(String, usize, usize)> {
        let twists = |name: &String| self.scene.rope.iter().any(|rope| rope.name == *name && rope.twist.is_some());
        let on_rods = self.experiment.marker.iter().enumerate().filter(|(_, marker)| marker.rope.as_ref().is_some_and(twists));
        on_rods.flat_map(|(k, _)| [0, 1].map(|a| (offset_path(k, a), k, a))).collect()
    }

    /// The marker and the axis of a path of [`Setup::offset_paths`].
    pub(crate) fn offset_path(&self, path: &str) -> Option<(usize, usize)> {
        self.offset_paths().into_iter().find(|(other, ..)| other == path).map(|(_, marker, axis)| (marker, axis))
    }

    /// Units of bias, scale and delay of a sensor at a joint.
    pub(crate) fn joint_units(&self, sensor: usize) -> [&'static str; JOINT_ENTRIES.len()] {
        let sensor = &self.experiment.joint[sensor];
        let slides = self.axes().iter().any(|(name, slides)| *name == sensor.joint && *slides);
        [sensor.measures.unit(slides), "-", "s", sensor.measures.rate_unit(slides)]
    }

    /// Names of the joints of one axis, and whether they slide.
    pub(crate) fn axes(&self) -> Vec<(String, bool)> {
        let of = |joint: &Joint| match joint.kind {
            JointKind::Revolute | JointKind::Prismatic => vec![(joint.name.clone(), joint.kind == JointKind::Prismatic)],
            JointKind::Universal => [0, 1].map(|k| (format!("{}[{k}]", joint.name), false)).to_vec(),
            JointKind::Ball | JointKind::Free => Vec::new(),
        };
        self.scene.body.iter().flat_map(|body| &body.joint).flat_map(of).collect()
    }
}

/// Path of a marker's distance from the centreline along a material axis.
pub(crate) fn offset_path(marker: usize, axis: usize) -> String {
    format!("marker[{marker}].offset[{axis}]")
}

fn name_of(path: &Path) -> String {
    path.display().to_string()
}

/// Factor from the unit of an input to the SI unit.
fn factor(input: &Input, unit: &str) -> f64 {
    match unit {
        "m" | "m/s" => input.unit.metres(),
        "rad" | "rad/s" => input.angle_unit.radians(),
        _ if input.actuator.is_some() => input.torque_unit.newton_metres(),
        _ => 1.0,
    }
}

/// The nearest of the known names, and all of them.
pub(super) fn suggestion<'a>(name: &str, known: &[&'a str]) -> (Option<String>, String) {
    let nearest: Option<&'a str> = words::nearest(name, known.iter().copied());
    (nearest.map(str::to_owned), words::list(known.iter().copied()))
}

#[cfg(test)]
mod tests {
    use super::super::units::TorqueUnit;
    use super::*;

    #[test]
    fn torques_are_commanded_in_their_unit_and_axes_have_none() {
        let motor = Input { actuator: Some("motor".to_owned()), torque_unit: TorqueUnit::Nmm, ..Input::default() };
        assert_eq!((factor(&motor, "-"), factor(&motor, "rad")), (1e-3, 1.0));
        let gripper = Input { gripper: Some("hand".to_owned()), torque_unit: TorqueUnit::Nmm, ..Input::default() };
        assert_eq!(factor(&gripper, "-"), 1.0);
    }

    #[test]
    fn units_of_torque_belong_to_torque_motors() {
        let scene = r#"schema_version = 1
[time]
step = 0.01
[[rope]]
name = "cable"
nodes = 5
length = 1.0
linear_density = 0.05
stretch_stiffness = 1.0e4
initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
[[gripper]]
name = "hand"
rope = "cable"
end = "first"
[experiment]
time = { column = "t" }
marker = [{ rope = "cable", node = 2, columns = ["x", "y", "z"] }]
input = [{ gripper = "hand", columns = ["a", "b", "c", "d", "e", "f"], torque_unit = "mNm" }]
"#;
        let error = Setup::from_source(Source::new("scene.toml", scene), PathBuf::new()).map(|_| ()).map_err(|e| e.to_string());
        let said = "`torque_unit` is given, but only inputs of torque motors have one";
        assert!(error.as_ref().is_err_and(|error| error.contains(said)), "{error:?}");
    }
}
