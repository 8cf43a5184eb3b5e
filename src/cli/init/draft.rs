//! The scene of a model and its logs, as text, and what was assumed.

use super::super::failure::Failure;
use super::clock;
use super::log::Log;
use super::matching::{Driven, Matches, Mistake, columns};
use super::names::{self, Quantity};
use super::{advice, drives, stops, units};
use pliant::identify::log::{Experiment, Gaps, Setup};
use pliant::identify::report::relative;
use pliant::import::{Options, import_model};
use pliant::scene::{Actuator, ActuatorKind, Integrator, JointKind, Scene, Source, parse_source, to_toml};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A scene with its experiment, and what was assumed on the way.
pub struct Draft {
    /// The scene file.
    pub text: String,
    /// A line for each assumption.
    pub assumed: Vec<String>,
}

/// A model: its text and the names in it.
pub struct Model {
    /// The scene file.
    pub text: String,
    /// Joints of one axis: name, whether it slides.
    pub joints: Vec<(String, bool)>,
    /// Actuators: name, joint.
    pub actuators: Vec<(String, String)>,
    /// Names of those that command a position or a velocity.
    pub servos: Vec<String>,
}

impl Draft {
    /// The scene in `folder` for a model and logs.
    pub fn new(model: &Path, logs: &[Log], folder: &Path) -> Result<Self, Failure> {
        let first = &logs[0];
        same_columns(logs)?;
        let mut assumed = Vec::new();
        let longest = logs.iter().map(|log| log.duration).fold(0.0, f64::max);
        let mut model = Model::read(model, logs, longest, &mut assumed)?;
        let header: Vec<&str> = first.header.iter().map(String::as_str).collect();
        let joints: Vec<&str> = model.joints.iter().map(|(name, _)| name.as_str()).collect();
        let actuators: Vec<Driven> =
            model.actuators.iter().map(|(name, joint)| Driven { name, joint, servo: model.servos.contains(name) }).collect();
        let found = columns(&header, first.clock, &joints, &actuators).map_err(|mistake| unmatched(first, &model, &mistake))?;
        let mut experiment = String::from("\n[experiment]\n");
        clock_of(first, &mut experiment, &mut assumed);
        sensors(logs, &model, &found, &mut experiment, &mut assumed)?;
        drives::inputs(first, &mut model, &found, &mut experiment, &mut assumed)?;
        drives::without(first, &model, &found, &mut assumed)?;
        if !first.without.is_empty() {
            assumed.push(format!("left out, as you said: {}", first.without.join(", ")));
        }
        for log in logs {
            let (file, path) = (relative(folder, &log.path), log.path.display());
            let role = if log.held_out { "held_out" } else { "fit" };
            let _ = write!(experiment, "[[experiment.record]]\nfile = {}\nrole = \"{role}\"\n", quoted(&file));
            let what = if log.held_out { "held out, to judge by" } else { "fitted" };
            assumed.push(format!("{path}: {what}, {} s at {} Hz", rounded(log.duration), rounded(1.0 / log.period)));
        }
        if logs.len() == 1 {
            assumed.push("a single log: nothing is held out, so no gain can be measured".to_owned());
        }
        Ok(Self { text: format!("{}\n{experiment}", model.text.trim_end()), assumed })
    }

    /// Refuses a scene that its logs cannot be read with, before it is written.
    pub fn check(&self, path: &Path, logs: &[Log]) -> Result<(), Failure> {
        let mut setup = Setup::from_source(Source::new(path.display().to_string(), &self.text), PathBuf::new())?;
        // by their paths as they were given: those in the scene lead through its folder, which is not there yet
        setup.experiment.record.clear();
        let paths: Vec<PathBuf> = logs.iter().map(|log| log.path.clone()).collect();
        setup.read_logs(&paths).map_err(|error| advice::before_the_scene(error, logs))?;
        Ok(())
    }
}

impl Model {
    /// A model for logs of the same columns. One that was imported gets a step that divides their period, and no stops that they do not reach.
    fn read(path: &Path, logs: &[Log], duration: f64, assumed: &mut Vec<String>) -> Result<Self, Failure> {
        let log = &logs[0];
        if path.extension().is_some_and(|kind| kind == "toml") {
            let source = Source::read(path)?;
            let scene: Scene<Experiment> = parse_source(&source)?;
            if scene.experiment.is_some() {
                return Err(Failure::Init {
                    place: path.display().to_string(),
                    what: "has an [experiment] already".to_owned(),
                    cause: "the scene was made for its logs",
                    fix: format!("run `pliant diagnose {}`, or take its [experiment] out", path.display()),
                });
            }
            return Ok(Self::of(&scene, source.text.clone()));
        }
        let mut scene = import_model(path, &Options::default())?.scene;
        let without_stops = stops::never_reached(&scene, logs);
        let far = without_stops.join(", ");
        if !without_stops.is_empty() {
            scene = import_model(path, &Options { without_stops, ..Options::default() })?.scene;
        }
        scene.time.step = clock::step(log.period);
        scene.time.duration = duration;
        assumed.push(format!(
            "{}: {} bodies; a step of {} s, which divides the time between samples",
            path.display(),
            scene.body.len(),
            scene.time.step
        ));
        if !far.is_empty() {
            assumed.push(format!("stops left out, as no reading comes near them: {far}"));
        }
        if scene.time.integrator == Integrator::Euler {
            assumed.push("the integrator is `euler`, of first order, for impacts: of stops, or of shapes that touch".to_owned());
        }
        let header: Vec<&str> = log.header.iter().map(String::as_str).collect();
        let servo = |a: &Actuator| a.kind != ActuatorKind::Torque;
        let actuators: Vec<Driven> =
            scene.actuator.iter().map(|a| Driven { name: &a.name, joint: &a.joint, servo: servo(a) }).collect();
        let known = columns(&header, log.clock, &[], &actuators).unwrap_or_default();
        let torques = |joint: &str| {
            let all = columns(&header, log.clock, &[joint], &[]).unwrap_or_default();
            all.found.iter().any(|m| matches!(m.quantity, Quantity::Torque | Quantity::CommandedTorque))
        };
        // a torque is no command of a servo
        let driven = |a: &Actuator| a.kind == ActuatorKind::Torque && torques(&a.joint);
        let commanded = |a: &&Actuator| known.found.iter().any(|m| m.object == a.name) || driven(a);
        let idle: Vec<String> = scene.actuator.iter().filter(|a| !commanded(a)).map(|a| a.name.clone()).collect();
        if !idle.is_empty() {
            assumed.push(format!("actuators left out, as no column commands them: {}", idle.join(", ")));
            scene.actuator.retain(|a| !idle.contains(&a.name));
        }
        let comment = format!("Made by `pliant init` from {}.", path.display());
        Ok(Self::of(&scene, to_toml(&scene, &comment)))
    }

    fn of<X>(scene: &Scene<X>, text: String) -> Self {
        let joints = scene.body.iter().flat_map(|body| &body.joint);
        let one_axis = |kind| matches!(kind, JointKind::Revolute | JointKind::Prismatic);
        let joints = joints.filter(|j| one_axis(j.kind)).map(|j| (j.name.clone(), j.kind == JointKind::Prismatic)).collect();
        let actuators = scene.actuator.iter().map(|a| (a.name.clone(), a.joint.clone())).collect();
        let servos = scene.actuator.iter().filter(|a| a.kind != ActuatorKind::Torque).map(|a| a.name.clone()).collect();
        Self { text, joints, actuators, servos }
    }
}

/// The entry of the clock.
fn clock_of(log: &Log, experiment: &mut String, assumed: &mut Vec<String>) {
    let name = &log.header[log.clock];
    let unit = clock::UNITS.iter().find(|(_, seconds)| *seconds == log.seconds).map_or("s", |(unit, _)| unit);
    let _ = writeln!(experiment, "time = {{ column = {}, unit = \"{unit}\" }}", quoted(name));
    let why = if log.said { "by its name" } else { "by the size of its differences" };
    assumed.push(format!("{name} -> time [{unit}], {why}"));
}

/// The entries of sensors.
fn sensors(
    logs: &[Log],
    model: &Model,
    found: &Matches,
    experiment: &mut String,
    assumed: &mut Vec<String>,
) -> Result<(), Failure> {
    let first = &logs[0];
    let mut seen = false;
    for m in &found.found {
        let (measures, per) = match m.quantity {
            Quantity::Position => ("position", ""),
            Quantity::Velocity => ("velocity", "/s"),
            Quantity::Torque | Quantity::CommandedTorque | Quantity::Command | Quantity::Target => continue,
        };
        seen = true;
        let column = &first.header[m.column];
        let (key, unit) = units::of(first, model, m)?;
        let _ = write!(
            experiment,
            "[[experiment.joint]]\njoint = {}\nmeasures = \"{measures}\"\ncolumn = {}\n{key} = \"{unit}\"\n",
            quoted(&m.object),
            quoted(column)
        );
        assumed.push(format!("{column} -> {measures} of {} [{unit}{per}]", m.object));
        if let Some(missing) = missing(logs, column)? {
            experiment.push_str("may_be_missing = true\n");
            assumed.push(missing);
        }
    }
    if !seen {
        return Err(unmatched(first, model, &Mistake::Nothing));
    }
    let unseen: Vec<&str> = model
        .joints
        .iter()
        .map(|(name, _)| name.as_str())
        .filter(|name| !found.found.iter().any(|m| m.object == *name))
        .collect();
    if !unseen.is_empty() {
        assumed.push(format!("nobody measured: {}", unseen.join(", ")));
    }
    Ok(())
}

/// What is missing of a sensor's column in the logs; `None` if nothing is.
fn missing(logs: &[Log], column: &str) -> Result<Option<String>, Failure> {
    let gaps: Vec<(String, Gaps)> =
        logs.iter().filter_map(|log| Some((log.path.display().to_string(), log.gaps_of(column)?))).collect();
    if let Some((path, _)) = gaps.iter().find(|(_, gaps)| gaps.all) {
        return Err(Failure::Init {
            place: format!("{path}: column `{column}`"),
            what: "has no number in any row".to_owned(),
            cause: "the sensor was off, or its readings were saved elsewhere",
            fix: format!("leave this log out, or the column in all of them with `--leave-out \"{column}\"`"),
        });
    }
    let count: usize = gaps.iter().map(|(_, gaps)| gaps.count).sum();
    let said = |(path, first): &(String, Gaps)| {
        format!("{column}: missing readings: {count}, the first at {path}:{}; they are passed over", first.line)
    };
    Ok(gaps.first().map(said))
}

/// Refuses logs whose columns differ. Their order may.
fn same_columns(logs: &[Log]) -> Result<(), Failure> {
    let first = &logs[0];
    for log in &logs[1..] {
        let beyond = |a: &Log, b: &Log| a.header.iter().filter(|name| !b.header.contains(name)).cloned().collect::<Vec<_>>();
        let (more, less) = (beyond(log, first), beyond(first, log));
        let said = |what: &str, names: &[String]| (!names.is_empty()).then(|| format!("{what} {}", names.join(", ")));
        let columns: Vec<String> = said("has", &more).into_iter().chain(said("lacks", &less)).collect();
        let name = |log: &Log| log.header[log.clock].clone();
        let (what, fix) = if !columns.is_empty() {
            let either = more.first().or(less.first()).map_or("", String::as_str);
            // without its torque an arm would be diagnosed as one that nothing drives
            let or = match names::drive(either) {
                Some(_) => String::new(),
                None => format!(", or read none of them with `--leave-out \"{either}\"`"),
            };
            let fix = format!("leave the log out, or give it the same columns, in any order{or}");
            (format!("has other columns than {}: it {}", first.path.display(), columns.join(" and ")), fix)
        } else if log.seconds != first.seconds {
            let counts = |log: &Log| format!("{} s apart in {}", rounded(log.period), log.path.display());
            let what = format!("its clock `{}` has another unit: samples are {}, {}", name(log), counts(log), counts(first));
            (what, "write the unit into the name of the clock in all logs, such as `time_ms`".to_owned())
        } else {
            continue;
        };
        return Err(Failure::Init {
            place: log.path.display().to_string(),
            what,
            cause: "the logs are of different set-ups",
            fix,
        });
    }
    Ok(())
}

fn unmatched(log: &Log, model: &Model, mistake: &Mistake) -> Failure {
    let place = log.path.display().to_string();
    if let Mistake::Twice(a, b, object) = mistake {
        let (a, b) = (&log.header[*a], &log.header[*b]);
        return Failure::Init {
            place,
            what: format!("columns `{a}` and `{b}` both belong to {object}, with one quantity"),
            cause: "the log has it twice, such as raw and filtered or in two units",
            fix: format!("keep one: leave the other out with `--leave-out \"{b}\"`"),
        };
    }
    let joints: Vec<&str> = model.joints.iter().map(|(name, _)| name.as_str()).collect();
    Failure::Init {
        place,
        what: format!("no column names a joint of the model: columns {}; joints {}", log.header.join(", "), joints.join(", ")),
        cause: "the log names its columns otherwise than the model its joints",
        fix: "rename columns to JOINT, JOINT_velocity or JOINT_torque, with the unit behind (`elbow_pos_deg`)".to_owned(),
    }
}

/// A number for people.
fn rounded(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}

/// A string of TOML.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
