//! Refusing scenes that make no sense, before anything is built from them.

mod actuator;
mod body;
mod cloth;
mod contact;
mod coupling;
mod force;
mod gripper;
mod joint_law;
mod memory;
mod rope;
mod solid;
mod statics;

pub use body::matrix as inertia_matrix;
pub use memory::{available_memory, warnings};

use super::Nothing;
use super::error::{Mistake, SceneError};
use super::file::{SCHEMA_VERSION, Scene};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use toml::Value;

/// Names that parameter paths use for something else.
pub const RESERVED: [&str; 3] = ["gravity", "air", "sensor"];

/// The shortest step [s]; shorter ones drown in the rounding of time.
const SHORTEST_STEP: f64 = 1e-9;
/// Most steps of a scene's duration: their inputs and states are all in memory.
pub const MOST_STEPS: usize = 10_000_000;
/// Most nodes of a scene.
pub const MOST_NODES: usize = 1_000_000;

/// Checks a scene. The error names the field; [`super::read_scene`] adds file and line.
pub fn check(scene: &Scene) -> Result<(), SceneError> {
    if scene.schema_version != SCHEMA_VERSION {
        let mistake = Mistake::Version { found: scene.schema_version, known: SCHEMA_VERSION };
        return Err(SceneError::at("schema_version", mistake));
    }
    finite(scene)?;
    time(scene)?;
    surroundings(scene)?;
    solver(scene)?;
    if scene.rope.is_empty() && scene.cloth.is_empty() && !scene.body.iter().any(|b| !b.joint.is_empty()) {
        return Err(SceneError::at("rope", Mistake::Nothing));
    }
    names(scene)?;
    size(scene)?;
    memory::check(scene)?;
    (0..scene.rope.len()).try_for_each(|r| rope::check(scene, r))?;
    scene.cloth.iter().enumerate().try_for_each(|(c, cloth)| cloth::check(cloth, c))?;
    body::check(scene)?;
    coupling::check(scene)?;
    force::check(scene)?;
    actuator::check(scene)?;
    gripper::check(scene)?;
    statics::check(scene)?;
    solid::check(scene)?;
    contact::check(scene)
}

/// A number that must be above zero.
pub(crate) fn positive(field: &str, value: f64, unit: &'static str) -> Result<(), SceneError> {
    if value > 0.0 { Ok(()) } else { Err(SceneError::at(field, Mistake::NotPositive { value, unit })) }
}

/// A number that must not be below zero.
fn not_negative(field: &str, value: f64, unit: &'static str) -> Result<(), SceneError> {
    if value >= 0.0 { Ok(()) } else { Err(SceneError::at(field, Mistake::Negative { value, unit })) }
}

/// No NaN, no infinity, anywhere.
fn finite(scene: &Scene) -> Result<(), SceneError> {
    let plain: Scene = scene.with_experiment::<Nothing>(None);
    match Value::try_from(&plain) {
        Ok(value) => all_finite(&value, ""),
        Err(error) => Err(SceneError::at("", Mistake::Refused { message: error.to_string() })),
    }
}

fn all_finite(value: &Value, field: &str) -> Result<(), SceneError> {
    match value {
        Value::Float(value) if !value.is_finite() => Err(SceneError::at(field, Mistake::NotFinite { value: *value })),
        Value::Array(entries) => {
            entries.iter().enumerate().try_for_each(|(i, entry)| all_finite(entry, &format!("{field}[{i}]")))
        }
        Value::Table(table) => table.iter().try_for_each(|(key, value)| {
            all_finite(value, &if field.is_empty() { key.clone() } else { format!("{field}.{key}") })
        }),
        _ => Ok(()),
    }
}

fn time(scene: &Scene) -> Result<(), SceneError> {
    let (step, duration) = (scene.time.step, scene.time.duration);
    positive("time.step", step, "s")?;
    positive("time.duration", duration, "s")?;
    if step >= 1.0 {
        let reason = ", which no motion of a rope is resolved by".to_owned();
        let mistake = Mistake::Unit { value: step, unit: "s", reason, likely: "ms", instead: 1e-3 * step };
        return Err(SceneError::at("time.step", mistake));
    }
    if step < SHORTEST_STEP {
        return Err(SceneError::at("time.step", Mistake::Range { value: step, low: SHORTEST_STEP, high: 1.0 }));
    }
    match scene.time.n_steps() {
        0 => Err(SceneError::at("time.duration", Mistake::NoStep { duration, step })),
        n if n > MOST_STEPS => Err(SceneError::at("time.duration", Mistake::TooManySteps { duration, step, most: MOST_STEPS })),
        _ => Ok(()),
    }
}

/// Before anything is made of the nodes.
fn size(scene: &Scene) -> Result<(), SceneError> {
    let mut nodes = 0usize;
    for (r, rope) in scene.rope.iter().enumerate() {
        nodes = nodes.saturating_add(rope.n_nodes());
        if nodes > MOST_NODES {
            let key = if rope.nodes.is_some() { "nodes" } else { "edge_fractions" };
            return Err(SceneError::at(format!("rope[{r}].{key}"), Mistake::TooManyNodes { nodes, most: MOST_NODES }));
        }
    }
    for (c, cloth) in scene.cloth.iter().enumerate() {
        nodes = nodes.saturating_add(cloth.n_nodes());
        if nodes > MOST_NODES {
            let key = if cloth.grid.is_some() { "grid.nodes" } else { "mesh" };
            return Err(SceneError::at(format!("cloth[{c}].{key}"), Mistake::TooManyNodes { nodes, most: MOST_NODES }));
        }
    }
    Ok(())
}

fn surroundings(scene: &Scene) -> Result<(), SceneError> {
    let magnitude = scene.gravity.magnitude;
    not_negative("gravity.magnitude", magnitude, "m/s²")?;
    if magnitude > 300.0 {
        let reason = ", more than any planet's".to_owned();
        let mistake = Mistake::Unit { value: magnitude, unit: "m/s²", reason, likely: "mm/s²", instead: 1e-3 * magnitude };
        return Err(SceneError::at("gravity.magnitude", mistake));
    }
    if let Some((a, tilt)) = scene.gravity.tilt.iter().enumerate().find(|(_, tilt)| tilt.abs() > PI) {
        let reason = ", more than half a turn".to_owned();
        let mistake = Mistake::Unit { value: *tilt, unit: "rad", reason, likely: "degrees", instead: tilt.to_radians() };
        return Err(SceneError::at(format!("gravity.tilt[{a}]"), mistake));
    }
    for (field, value, unit) in [("air.density", scene.air.density, "kg/m³"), ("air.viscosity", scene.air.viscosity, "Pa·s")] {
        not_negative(field, value, unit)?;
        if value > 0.0 && !scene.body.iter().any(|body| body.mass > 0.0) {
            let message = "acts on bodies, and there is none with mass: give a rope or cloth drag of its own (`drag_quadratic`)";
            return Err(SceneError::at(field, Mistake::Refused { message: message.to_owned() }));
        }
    }
    positive("contact.rest_gap", scene.contact.rest_gap, "m")
}

fn solver(scene: &Scene) -> Result<(), SceneError> {
    let tolerance = scene.solver.tolerance;
    if !(1e-15..=1e-2).contains(&tolerance) {
        return Err(SceneError::at("solver.tolerance", Mistake::Range { value: tolerance, low: 1e-15, high: 1e-2 }));
    }
    if scene.solver.max_iterations == 0 {
        return Err(SceneError::at("solver.max_iterations", Mistake::NotPositive { value: 0.0, unit: "-" }));
    }
    if scene.solver.max_halvings > 30 {
        let value = scene.solver.max_halvings as f64;
        return Err(SceneError::at("solver.max_halvings", Mistake::Range { value, low: 0.0, high: 30.0 }));
    }
    Ok(())
}

/// Every object has a name of its own that can stand in a path.
fn names(scene: &Scene) -> Result<(), SceneError> {
    let mut taken: BTreeMap<&str, String> = BTreeMap::new();
    for (field, name) in named(scene) {
        let mut letters = name.chars();
        let first = letters.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
        let usable = first && letters.all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !usable || RESERVED.contains(&name) {
            return Err(SceneError::at(format!("{field}.name"), Mistake::Name { name: name.to_owned() }));
        }
        if let Some(other) = taken.insert(name, field.clone()) {
            return Err(SceneError::at(format!("{field}.name"), Mistake::NameTaken { name: name.to_owned(), other }));
        }
    }
    Ok(())
}

/// (field, name) of every object.
fn named(scene: &Scene) -> impl Iterator<Item = (String, &str)> {
    let ropes = scene.rope.iter().enumerate().map(|(i, o)| (format!("rope[{i}]"), o.name.as_str()));
    let grippers = scene.gripper.iter().enumerate().map(|(i, o)| (format!("gripper[{i}]"), o.name.as_str()));
    let planes = scene.plane.iter().enumerate().map(|(i, o)| (format!("plane[{i}]"), o.name.as_str()));
    let spheres = scene.sphere.iter().enumerate().map(|(i, o)| (format!("sphere[{i}]"), o.name.as_str()));
    let capsules = scene.capsule.iter().enumerate().map(|(i, o)| (format!("capsule[{i}]"), o.name.as_str()));
    let bodies = scene.body.iter().enumerate().map(|(i, o)| (format!("body[{i}]"), o.name.as_str()));
    let joints = scene.body.iter().enumerate().flat_map(|(i, body)| {
        body.joint.iter().enumerate().map(move |(j, o)| (format!("body[{i}].joint[{j}]"), o.name.as_str()))
    });
    let actuators = scene.actuator.iter().enumerate().map(|(i, o)| (format!("actuator[{i}]"), o.name.as_str()));
    let closures = scene.closure.iter().enumerate().map(|(i, o)| (format!("closure[{i}]"), o.name.as_str()));
    let couplings = scene.coupling.iter().enumerate().map(|(i, o)| (format!("coupling[{i}]"), o.name.as_str()));
    let forces = scene.force.iter().enumerate().map(|(i, o)| (format!("force[{i}]"), o.name.as_str()));
    let sheets = scene.cloth.iter().enumerate().map(|(i, o)| (format!("cloth[{i}]"), o.name.as_str()));
    let ropes = ropes.chain(sheets).chain(bodies).chain(joints).chain(actuators).chain(closures).chain(couplings).chain(forces);
    let blocks = scene.block.iter().enumerate().map(|(i, o)| (format!("box[{i}]"), o.name.as_str()));
    let cylinders = scene.cylinder.iter().enumerate().map(|(i, o)| (format!("cylinder[{i}]"), o.name.as_str()));
    ropes.chain(grippers).chain(planes).chain(spheres).chain(capsules).chain(blocks).chain(cylinders)
}
