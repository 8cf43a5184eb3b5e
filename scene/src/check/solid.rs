//! Shapes of bodies, fixed boxes and cylinders, and rules for pairs.

use super::{not_negative, positive};
use crate::error::{Mistake, SceneError};
use crate::file::{Law, Scene};
use crate::shape::{BodyShape, ContactRule, ShapeKind};
use crate::words::nearest;

/// Largest size of a body's shape [m] that is not taken for millimetres.
const LARGE: f64 = 100.0;
/// Fewest and most points of a hull: its edges are tried against those of others one by one.
const HULL_POINTS: [usize; 2] = [4, 256];

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    for (b, body) in scene.body.iter().enumerate() {
        for (k, shape) in body.shape.iter().enumerate() {
            body_shape(shape, &format!("body[{b}].shape[{k}]"))?;
        }
    }
    for (i, block) in scene.block.iter().enumerate() {
        let field = format!("box[{i}]");
        sizes(&format!("{field}.half_extents"), &block.half_extents)?;
        common(&field, block.quaternion, Some(block.friction))?;
    }
    for (i, cylinder) in scene.cylinder.iter().enumerate() {
        let field = format!("cylinder[{i}]");
        positive(&format!("{field}.radius"), cylinder.radius, "m")?;
        positive(&format!("{field}.half_length"), cylinder.half_length, "m")?;
        common(&field, cylinder.quaternion, Some(cylinder.friction))?;
    }
    let rules = &scene.contact.pair;
    rules.iter().enumerate().try_for_each(|(k, pair)| rule(scene, pair, &rules[..k], &format!("contact.pair[{k}]")))
}

fn sizes(field: &str, sizes: &[f64]) -> Result<(), SceneError> {
    sizes.iter().enumerate().try_for_each(|(a, size)| positive(&format!("{field}[{a}]"), *size, "m"))
}

fn common(field: &str, quaternion: [f64; 4], friction: Option<f64>) -> Result<(), SceneError> {
    let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > 1e-6 {
        return Err(SceneError::at(format!("{field}.quaternion"), Mistake::Quaternion { norm }));
    }
    friction.map_or(Ok(()), |mu| not_negative(&format!("{field}.friction"), mu, "-"))
}

fn body_shape(shape: &BodyShape, field: &str) -> Result<(), SceneError> {
    use ShapeKind::{Box, Capsule, Cylinder, Hull, Sphere};
    common(field, shape.quaternion, shape.friction)?;
    points(shape, field)?;
    let (kind, needs) = match shape.kind {
        Sphere => ("sphere", [true, false, false]),
        Capsule => ("capsule", [true, true, false]),
        Cylinder => ("cylinder", [true, true, false]),
        Box => ("box", [false, false, true]),
        Hull => ("hull", [false; 3]),
    };
    let extents: Option<&[f64]> = shape.half_extents.as_ref().map(|x| x.as_slice());
    let given: [(&str, Option<&[f64]>); 3] = [
        ("radius", shape.radius.as_ref().map(std::slice::from_ref)),
        ("half_length", shape.half_length.as_ref().map(std::slice::from_ref)),
        ("half_extents", extents),
    ];
    for ((key, values), needed) in given.into_iter().zip(needs) {
        let at = format!("{field}.{key}");
        match (values, needed) {
            (None, true) => return Err(SceneError::at(field, Mistake::NoSize { kind, key: name_of(key) })),
            (Some(_), false) => return Err(SceneError::at(at, Mistake::OtherSize { kind, key: name_of(key) })),
            (Some([value]), true) => positive(&at, *value, "m")?,
            (Some(values), true) => sizes(&at, values)?,
            (None, false) => {}
        }
        if let Some(value) = values.and_then(|v| v.iter().copied().find(|x| *x > LARGE)) {
            let reason = ", larger than any body of a robot".to_owned();
            return Err(SceneError::at(at, Mistake::Unit { value, unit: "m", reason, likely: "mm", instead: 1e-3 * value }));
        }
    }
    Ok(())
}

/// Points of a hull: some, and of a size that bodies have. Whether they lie in a plane, the hull itself says.
fn points(shape: &BodyShape, field: &str) -> Result<(), SceneError> {
    let at = format!("{field}.points");
    let points = match (&shape.points, shape.kind) {
        (None, ShapeKind::Hull) => return Err(SceneError::at(field, Mistake::NoSize { kind: "hull", key: "points" })),
        (None, _) => return Ok(()),
        (Some(points), ShapeKind::Hull) => points,
        (Some(_), kind) => {
            let kind = match kind {
                ShapeKind::Sphere => "sphere",
                ShapeKind::Capsule => "capsule",
                ShapeKind::Cylinder => "cylinder",
                _ => "box",
            };
            return Err(SceneError::at(at, Mistake::OtherSize { kind, key: "points" }));
        }
    };
    let ([least, most], found) = (HULL_POINTS, points.len());
    if !(least..=most).contains(&found) {
        return Err(SceneError::at(at, Mistake::HullPoints { found, least, most }));
    }
    let large = points.iter().enumerate().find_map(|(k, p)| p.iter().copied().find(|x| x.abs() > LARGE).map(|x| (k, x)));
    large.map_or(Ok(()), |(k, value)| {
        let reason = ", farther than any body of a robot reaches".to_owned();
        let mistake = Mistake::Unit { value, unit: "m", reason, likely: "mm", instead: 1e-3 * value };
        Err(SceneError::at(format!("{at}[{k}]"), mistake))
    })
}

fn name_of(key: &str) -> &'static str {
    match key {
        "radius" => "radius",
        "half_length" => "half_length",
        _ => "half_extents",
    }
}

/// Both objects exist and may touch, and the rule is supported for them.
fn rule(scene: &Scene, rule: &ContactRule, before: &[ContactRule], field: &str) -> Result<(), SceneError> {
    let fixed: Vec<&str> = fixed(scene).collect();
    let bodies: Vec<&str> = scene.body.iter().map(|b| b.name.as_str()).collect();
    let sheets = scene.cloth.iter().map(|c| c.name.as_str());
    let ropes: Vec<&str> = scene.rope.iter().map(|r| r.name.as_str()).chain(sheets).collect();
    let known: Vec<&str> = bodies.iter().chain(&ropes).chain(&fixed).copied().collect();
    for (k, name) in rule.between.iter().enumerate() {
        if !known.contains(&name.as_str()) {
            let nearest = nearest(name, known.iter().copied()).map(str::to_owned);
            let mistake = Mistake::NoSuch { what: "object", name: name.clone(), nearest, known: known.join(", ") };
            return Err(SceneError::at(format!("{field}.between[{k}]"), mistake));
        }
    }
    let [a, b] = [0, 1].map(|k| rule.between[k].as_str());
    let why = if a == b {
        Some("they are the same")
    } else if [a, b].iter().all(|n| fixed.contains(n)) {
        Some("both are fixed")
    } else if [a, b].iter().all(|n| ropes.contains(n)) {
        Some("ropes and sheets go through each other")
    } else {
        None
    };
    if let Some(why) = why {
        let mistake = Mistake::NeverTouch { first: a.to_owned(), second: b.to_owned(), why };
        return Err(SceneError::at(format!("{field}.between"), mistake));
    }
    if let Some(other) = before.iter().position(|rule| rule.between == [a, b] || rule.between == [b, a]) {
        let mistake = Mistake::RuleTwice { first: a.to_owned(), second: b.to_owned(), other };
        return Err(SceneError::at(format!("{field}.between"), mistake));
    }
    if let Some(mu) = rule.friction {
        not_negative(&format!("{field}.friction"), mu, "-")?;
    }
    if let Some(compliance) = rule.compliance {
        not_negative(&format!("{field}.compliance"), compliance, "m/N")?;
        let plain = [a, b].iter().any(|n| ropes.contains(n)) && ![a, b].iter().any(|n| bodies.contains(n));
        let why = match scene.contact.law {
            Law::Anitescu => Some("the scene's law is Anitescu's"),
            Law::Coulomb => plain.then_some("a rope or sheet against a fixed shape has none"),
        };
        if let Some(why) = why {
            return Err(SceneError::at(format!("{field}.compliance"), Mistake::NoCompliance { why }));
        }
    }
    Ok(())
}

/// Names of fixed shapes.
pub(super) fn fixed(scene: &Scene) -> impl Iterator<Item = &str> {
    let planes = scene.plane.iter().map(|s| s.name.as_str());
    let spheres = scene.sphere.iter().map(|s| s.name.as_str());
    let capsules = scene.capsule.iter().map(|s| s.name.as_str());
    let blocks = scene.block.iter().map(|s| s.name.as_str());
    planes.chain(spheres).chain(capsules).chain(blocks).chain(scene.cylinder.iter().map(|s| s.name.as_str()))
}
