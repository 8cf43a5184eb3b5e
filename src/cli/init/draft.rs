//! The scene of a model and its logs, as text, and what was assumed.

use super::super::failure::Failure;
use super::clock;
use super::log::Log;
use super::matching::{Match, Matches, Mistake, columns};
use super::names::Quantity;
use super::stops;
use pliant::identify::log::{Experiment, Setup};
use pliant::identify::report::relative;
use pliant::import::{Options, import_model};
use pliant::scene::{Actuator, ActuatorKind, Integrator, JointKind, Scene, Source, parse_source, to_toml};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

/// A scene with its experiment, and what was assumed on the way.
pub struct Draft {
    /// The scene file.
    pub text: String,
    /// A line for each assumption.
    pub assumed: Vec<String>,
}

/// A model: its text and the names in it.
struct Model {
    text: String,
    /// Joints of one axis: name, whether it slides.
    joints: Vec<(String, bool)>,
    /// Actuators: name, joint.
    actuators: Vec<(String, String)>,
    /// Names of those that command a position or a velocity.
    servos: Vec<String>,
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
        let actuators: Vec<&str> = model.actuators.iter().map(|(name, _)| name.as_str()).collect();
        let found = columns(&header, first.clock, &joints, &actuators).map_err(|mistake| unmatched(first, &model, &mistake))?;
        let mut experiment = String::from("\n[experiment]\n");
        clock_of(first, &mut experiment, &mut assumed)?;
        sensors(first, &mut model, &found, &mut experiment, &mut assumed)?;
        let ignored: Vec<&str> = found.ignored.iter().map(|&k| header[k]).collect();
        if !ignored.is_empty() {
            assumed.push(format!("left out, as they name nothing in the model: {}", ignored.join(", ")));
        }
        for log in logs {
            let (file, role) = (relative(folder, &log.path), if log.held_out { "held_out" } else { "fit" });
            let _ = write!(experiment, "[[experiment.record]]\nfile = {}\nrole = \"{role}\"\n", quoted(&file));
            let what = if log.held_out { "held out, to judge by" } else { "fitted" };
            assumed.push(format!("{file}: {what}, {} s at {} Hz", rounded(log.duration), rounded(1.0 / log.period)));
        }
        if logs.len() == 1 {
            assumed.push("a single log: nothing is held out, so no gain can be measured".to_owned());
        }
        Ok(Self { text: format!("{}\n{experiment}", model.text.trim_end()), assumed })
    }

    /// Refuses a scene that its logs cannot be read with, before it is written.
    pub fn check(&self, path: &Path) -> Result<(), Failure> {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let setup = Setup::from_source(Source::new(path.display().to_string(), &self.text), folder)?;
        setup.read_logs(&[])?;
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
        let names: Vec<&str> = scene.actuator.iter().map(|a| a.name.as_str()).collect();
        let known = columns(&header, log.clock, &[], &names).unwrap_or_default();
        let torques = |joint: &str| {
            let all = columns(&header, log.clock, &[joint], &[]).unwrap_or_default();
            all.found.iter().any(|m| m.quantity == Quantity::Torque)
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
fn clock_of(log: &Log, experiment: &mut String, assumed: &mut Vec<String>) -> Result<(), Failure> {
    let name = &log.header[log.clock];
    let known = clock::UNITS.iter().find(|(unit, seconds)| *seconds == log.seconds && *unit != "ns");
    let Some((unit, _)) = known else {
        return Err(Failure::Init {
            place: format!("{}: column `{name}`", log.path.display()),
            what: "counts nanoseconds".to_owned(),
            cause: "stamps as ROS writes them",
            fix: "divide them by 1000 and name the column `time_us`".to_owned(),
        });
    };
    let _ = writeln!(experiment, "time = {{ column = {}, unit = \"{unit}\" }}", quoted(name));
    let why = if log.said { "by its name" } else { "by the size of its differences" };
    assumed.push(format!("{name} -> time [{unit}], {why}"));
    Ok(())
}

/// The entries of sensors and inputs.
fn sensors(
    log: &Log,
    model: &mut Model,
    found: &Matches,
    experiment: &mut String,
    assumed: &mut Vec<String>,
) -> Result<(), Failure> {
    let mut inputs: Vec<(String, String)> = Vec::new();
    let mut seen = false;
    for m in &found.found {
        let column = &log.header[m.column];
        let slides = model.joints.iter().any(|(name, slides)| *name == m.object && *slides);
        match m.quantity {
            Quantity::Command => inputs.push((m.object.clone(), column.clone())),
            Quantity::Torque => inputs.extend(driven(model, found, m, column, assumed)),
            Quantity::Position | Quantity::Velocity => {
                seen = true;
                let unit = unit_of(log, m, slides)?;
                let measures = if m.quantity == Quantity::Position { "position" } else { "velocity" };
                let key = if slides { "unit" } else { "angle_unit" };
                let _ = write!(
                    experiment,
                    "[[experiment.joint]]\njoint = {}\nmeasures = \"{measures}\"\ncolumn = {}\n{key} = \"{unit}\"\n",
                    quoted(&m.object),
                    quoted(column)
                );
                let per = if measures == "velocity" { "/s" } else { "" };
                assumed.push(format!("{column} -> {measures} of {} [{unit}{per}]", m.object));
            }
        }
    }
    if !seen {
        return Err(unmatched(log, model, &Mistake::Nothing));
    }
    let missing = |(name, _): &&(String, String)| !inputs.iter().any(|(actuator, _)| actuator == name);
    if let Some((name, joint)) = model.actuators.iter().find(missing) {
        return Err(Failure::Init {
            place: log.path.display().to_string(),
            what: format!("no column has the command of actuator `{name}` at joint `{joint}`"),
            cause: "the log has none, or its column has another name",
            fix: format!("name a column `{name}` or `{joint}_torque`, or take the actuator out of the model"),
        });
    }
    for (actuator, column) in inputs {
        let _ = write!(experiment, "[[experiment.input]]\nactuator = {}\ncolumns = [{}]\n", quoted(&actuator), quoted(&column));
        assumed.push(format!("{column} -> command of {actuator}"));
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

/// The actuator that a column with the torque of a joint commands: that of the joint, or a new one where it has none. None where the
/// joint's actuator has a command of its own.
fn driven(model: &mut Model, found: &Matches, m: &Match, column: &str, assumed: &mut Vec<String>) -> Option<(String, String)> {
    if let Some((name, _)) = model.actuators.iter().find(|(_, joint)| *joint == m.object) {
        let commanded = found.found.iter().any(|other| other.quantity == Quantity::Command && other.object == *name);
        if commanded || model.servos.contains(name) {
            assumed.push(format!("{column}: left out, since {name} has a command of its own"));
            return None;
        }
        return Some((name.clone(), column.to_owned()));
    }
    let name = format!("motor_{}", m.object);
    let _ = write!(model.text, "\n[[actuator]]\nname = {}\njoint = {}\nkind = \"torque\"\n", quoted(&name), quoted(&m.object));
    model.actuators.push((name.clone(), m.object.clone()));
    assumed.push(format!("{column}: drives {} by a torque motor `{name}`, which the model lacks", m.object));
    Some((name, column.to_owned()))
}

/// Units of the position of a joint that turns or slides, as a scene names them, and their sizes [rad] or [m]; the usual one first.
pub const fn units(slides: bool) -> &'static [(&'static str, f64)] {
    if slides { &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)] } else { &[("rad", 1.0), ("deg", PI / 180.0)] }
}

/// Unit of a joint's column, as a scene names it.
fn unit_of(log: &Log, m: &Match, slides: bool) -> Result<&'static str, Failure> {
    let known: Vec<&'static str> = units(slides).iter().map(|(name, _)| *name).collect();
    let Some(unit) = m.unit.as_deref() else { return Ok(known[0]) };
    known.iter().find(|name| **name == unit).copied().ok_or_else(|| Failure::Init {
        place: format!("{}: column `{}`", log.path.display(), log.header[m.column]),
        what: format!("is in {unit}, and joint `{}` {}", m.object, if slides { "slides" } else { "turns" }),
        cause: "the column belongs to something else, or its name ends in a word that looks like a unit",
        fix: format!("rename the column; units of this joint are {}", known.join(", ")),
    })
}

/// Refuses logs whose columns differ.
fn same_columns(logs: &[Log]) -> Result<(), Failure> {
    let first = &logs[0];
    match logs.iter().find(|log| log.header != first.header || log.seconds != first.seconds) {
        Some(other) => Err(Failure::Init {
            place: other.path.display().to_string(),
            what: format!("has other columns, or another clock, than {}: {}", first.path.display(), other.header.join(", ")),
            cause: "the logs are of different set-ups",
            fix: "give logs of one set-up with the same columns in the same order".to_owned(),
        }),
        None => Ok(()),
    }
}

fn unmatched(log: &Log, model: &Model, mistake: &Mistake) -> Failure {
    let name = |k: usize| &log.header[k];
    let joints: Vec<&str> = model.joints.iter().map(|(name, _)| name.as_str()).collect();
    let what = match mistake {
        Mistake::Twice(a, b, object) => format!("columns `{}` and `{}` both belong to {object}", name(*a), name(*b)),
        _ => format!("no column names a joint of the model: columns {}; joints {}", log.header.join(", "), joints.join(", ")),
    };
    Failure::Init {
        place: log.path.display().to_string(),
        what,
        cause: "the log names its columns otherwise than the model its joints",
        fix: "rename columns to JOINT, JOINT_velocity or JOINT_torque, with the unit behind (`elbow_pos_deg`)".to_owned(),
    }
}

/// A number for people.
fn rounded(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}

/// A string of TOML.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
