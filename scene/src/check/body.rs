//! Refusing bodies, joints and actuators that make no sense.

use super::{not_negative, positive};
use crate::body::{Body, Joint, JointKind};
use crate::error::{Mistake, SceneError};
use crate::file::{Integrator, Scene};
use crate::words::nearest;
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::inertia::to_numbers;
use std::f64::consts::PI;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    stops_of_midpoint(scene)?;
    closures(scene)?;
    for (b, body) in scene.body.iter().enumerate() {
        let field = format!("body[{b}]");
        parent(scene, b, &field)?;
        mass(body, &field)?;
        quaternion(body, &field)?;
        for (j, joint) in body.joint.iter().enumerate() {
            self::joint(body, joint, &format!("{field}.joint[{j}]"))?;
        }
    }
    massless_leaves(scene)
}

/// Stops are contact: midpoint chatters there.
fn stops_of_midpoint(scene: &Scene) -> Result<(), SceneError> {
    let limited = scene.body.iter().flat_map(|b| &b.joint).filter(|j| j.limits.is_some()).count();
    if scene.time.integrator == Integrator::Midpoint && limited > 0 {
        return Err(SceneError::at("time.integrator", Mistake::MidpointStops { joints: limited }));
    }
    Ok(())
}

/// The parent is there, and no body hangs on itself.
fn parent(scene: &Scene, b: usize, field: &str) -> Result<(), SceneError> {
    let mut above = b;
    for _ in 0..=scene.body.len() {
        let Some(name) = &scene.body[above].parent else { return Ok(()) };
        let names = || scene.body.iter().map(|body| body.name.as_str());
        let Some(next) = names().position(|other| other == name) else {
            let mistake = Mistake::NoSuch {
                what: "body",
                name: name.clone(),
                nearest: nearest(name, names()).map(str::to_owned),
                known: names().collect::<Vec<_>>().join(", "),
            };
            return Err(SceneError::at(format!("body[{above}].parent"), mistake));
        };
        above = next;
    }
    Err(SceneError::at(format!("{field}.parent"), Mistake::Cycle { body: scene.body[b].name.clone() }))
}

fn mass(body: &Body, field: &str) -> Result<(), SceneError> {
    not_negative(&format!("{field}.mass"), body.mass, "kg")?;
    if let Some(area) = body.drag_area {
        positive(&format!("{field}.drag_area"), area, "m²")?;
        if body.mass == 0.0 {
            let message = "drag acts at the centre of mass, and this body has no mass".to_owned();
            return Err(SceneError::at(format!("{field}.drag_area"), Mistake::Refused { message }));
        }
    }
    match body.inertia {
        None if body.mass > 0.0 => {
            let mistake = Mistake::MissingKey { key: "inertia".to_owned(), unit: Some("kg·m²".to_owned()) };
            Err(SceneError::at(field, mistake))
        }
        Some(_) if body.mass == 0.0 => {
            Err(SceneError::at(format!("{field}.mass"), Mistake::NotPositive { value: 0.0, unit: "kg" }))
        }
        Some(inertia) => {
            let refused = |error: pliant_math::inertia::InertiaError| {
                let mm = "in mm or g: 1 kg·m² is 1e6 kg·mm² and 1e9 g·mm²";
                SceneError::at(format!("{field}.inertia"), Mistake::Inertia { error, hint: mm })
            };
            to_numbers(body.mass, Vec3::from(body.center_of_mass), &matrix(&inertia)).map_err(refused)?;
            large_inertia(body, &inertia, field)
        }
        None => Ok(()),
    }
}

/// A radius of gyration beyond ten metres betrays a unit.
fn large_inertia(body: &Body, inertia: &[f64; 6], field: &str) -> Result<(), SceneError> {
    let radius = (inertia[..3].iter().fold(0.0_f64, |a, x| a.max(*x)) / body.mass).sqrt();
    if radius > 10.0 {
        let (reason, value) = (format!(", a radius of gyration of {radius:.0} m"), inertia[0]);
        let mistake = Mistake::Unit { value, unit: "kg·m²", reason, likely: "kg·mm²", instead: 1e-6 * value };
        return Err(SceneError::at(format!("{field}.inertia"), mistake));
    }
    Ok(())
}

/// The inertia matrix of (xx, yy, zz, xy, xz, yz).
pub fn matrix(i: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2])
}

fn quaternion(body: &Body, field: &str) -> Result<(), SceneError> {
    let norm = body.quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > 1e-3 {
        return Err(SceneError::at(format!("{field}.quaternion"), Mistake::Quaternion { norm }));
    }
    Ok(())
}

fn joint(body: &Body, joint: &Joint, field: &str) -> Result<(), SceneError> {
    let axes = [Some(joint.axis), joint.second_axis];
    for (key, axis) in ["axis", "second_axis"].iter().zip(axes) {
        if axis.is_some_and(|a| a.iter().all(|x| *x == 0.0)) {
            return Err(SceneError::at(format!("{field}.{key}"), Mistake::NoDirection));
        }
    }
    if joint.second_axis.is_some() != (joint.kind == JointKind::Universal) {
        let mistake = match joint.second_axis {
            None => Mistake::MissingKey { key: "second_axis".to_owned(), unit: None },
            Some(_) => Mistake::Refused { message: "only a universal joint has a second axis".to_owned() },
        };
        return Err(SceneError::at(field, mistake));
    }
    if joint.kind == JointKind::Free && (body.parent.is_some() || body.joint.len() > 1) {
        return Err(SceneError::at(field, Mistake::FreeBelow { body: body.name.clone() }));
    }
    for (key, value, unit) in [
        ("armature", joint.armature, "kg·m²"),
        ("damping", joint.damping, "N·m·s/rad"),
        ("quadratic_damping", joint.quadratic_damping, "N·m·s²/rad²"),
        ("stiffness", joint.stiffness, "N·m/rad"),
    ] {
        not_negative(&format!("{field}.{key}"), value, unit)?;
    }
    friction_and_stops(joint, field)?;
    super::joint_law::check(joint, field)?;
    let counts = [("start", &joint.start, joint.kind.n_start()), ("velocity", &joint.velocity, joint.kind.n_dofs())];
    for (key, values, expected) in counts {
        if !values.is_empty() && values.len() != expected {
            return Err(SceneError::at(format!("{field}.{key}"), Mistake::Count { found: values.len(), expected }));
        }
    }
    if joint.kind != JointKind::Prismatic {
        let angles = joint.start.iter().enumerate().map(|(k, x)| (format!("{field}.start[{k}]"), *x));
        for (field, value) in angles.chain([(format!("{field}.rest"), joint.rest)]) {
            angle(field, value)?;
        }
    }
    Ok(())
}

fn friction_and_stops(joint: &Joint, field: &str) -> Result<(), SceneError> {
    not_negative(&format!("{field}.friction"), joint.friction, "N·m")?;
    not_negative(&format!("{field}.stiction"), joint.stiction, "N·m")?;
    positive(&format!("{field}.stribeck_velocity"), joint.stribeck_velocity, "rad/s")?;
    let given = joint.friction > 0.0 || joint.stiction > 0.0 || joint.limits.is_some();
    if given && joint.kind.n_dofs() > 2 {
        let message = "dry friction, stiction and limits are for joints of one or two axes".to_owned();
        return Err(SceneError::at(field, Mistake::Refused { message }));
    }
    let Some([low, high]) = joint.limits else { return Ok(()) };
    if low >= high {
        return Err(SceneError::at(format!("{field}.limits"), Mistake::Limits { low, high }));
    }
    if let Some((k, start)) = joint.start.iter().enumerate().find(|(_, x)| !(low..=high).contains(*x)) {
        return Err(SceneError::at(format!("{field}.start[{k}]"), Mistake::Range { value: *start, low, high }));
    }
    if joint.kind != JointKind::Prismatic {
        angle(format!("{field}.limits[0]"), low)?;
        angle(format!("{field}.limits[1]"), high)?;
    }
    Ok(())
}

/// Angles beyond eight turns are degrees.
fn angle(field: String, value: f64) -> Result<(), SceneError> {
    if value.abs() > 16.0 * PI {
        let reason = ", more than eight turns".to_owned();
        let mistake = Mistake::Unit { value, unit: "rad", reason, likely: "degrees", instead: value.to_radians() };
        return Err(SceneError::at(field, mistake));
    }
    Ok(())
}

/// A joint must move some mass, its own armature or that of a body beyond.
fn massless_leaves(scene: &Scene) -> Result<(), SceneError> {
    for (b, body) in scene.body.iter().enumerate() {
        let Some(j) = body.joint.iter().position(|j| j.armature == 0.0 || j.kind.n_dofs() > 1) else { continue };
        if body.mass == 0.0 && !scene.body.iter().any(|other| other.mass > 0.0 && hangs_on(scene, other, body)) {
            return Err(SceneError::at(format!("body[{b}].joint[{j}]"), Mistake::Massless { body: body.name.clone() }));
        }
    }
    Ok(())
}

fn hangs_on(scene: &Scene, body: &Body, above: &Body) -> bool {
    let mut name = body.parent.as_deref();
    while let Some(parent) = name {
        if parent == above.name {
            return true;
        }
        name = scene.body.iter().find(|b| b.name == parent).and_then(|b| b.parent.as_deref());
    }
    false
}

/// Bodies of closures are there, and no closure holds a body to itself.
fn closures(scene: &Scene) -> Result<(), SceneError> {
    let held = scene.closure.len() + scene.coupling.len();
    if scene.time.integrator == Integrator::Midpoint && held > 0 {
        return Err(SceneError::at("time.integrator", Mistake::MidpointClosure { closures: held }));
    }
    let names = || scene.body.iter().map(|body| body.name.as_str());
    for (k, closure) in scene.closure.iter().enumerate() {
        let sides = [("body", Some(&closure.body)), ("to", closure.to.as_ref())];
        for (key, name) in sides.into_iter().filter_map(|(key, name)| Some((key, name?))) {
            if !names().any(|n| n == name) {
                let nearest = nearest(name, names()).map(str::to_owned);
                let known = names().collect::<Vec<_>>().join(", ");
                let mistake = Mistake::NoSuch { what: "body", name: name.clone(), nearest, known };
                return Err(SceneError::at(format!("closure[{k}].{key}"), mistake));
            }
        }
        if closure.to.as_ref() == Some(&closure.body) {
            let why = "both sides are the same body";
            return Err(SceneError::at(format!("closure[{k}].to"), Mistake::HoldsNoBody { why }));
        }
        if let Some(compliance) = closure.compliance {
            not_negative(&format!("closure[{k}].compliance"), compliance, "m/N")?;
        }
    }
    Ok(())
}
