//! Ropes: counts, signs, sizes, start.

use super::super::error::{Mistake, SceneError};
use super::super::file::Scene;
use super::super::gripper::End;
use super::super::initial::rope_points;
use super::super::rod::RodStart;
use super::super::rope::{Initial, Rope, Touching, Twist};
use super::super::words::list;
use super::{not_negative, positive};
use pliant_math::params::REST_STRAIN;
use std::f64::consts::PI;

/// The longest rope [m] that is not taken for one in millimetres.
const LONGEST: f64 = 1000.0;
/// The densest material [kg/m³]; osmium has 22 600.
const DENSEST: f64 = 1e5;
/// A thick rope lighter than air [kg/m³] has a radius in another unit.
const LIGHTEST: f64 = 1.0;

pub(super) fn check(scene: &Scene, r: usize) -> Result<(), SceneError> {
    let rope = &scene.rope[r];
    let at = |key: &str| format!("rope[{r}].{key}");
    if let Some(key) = rope.material_key() {
        return Err(SceneError::at(at(key), Mistake::Unresolved { key }));
    }
    numbers(rope, &at)?;
    units(rope, &at)?;
    nodes(scene, rope, &at)?;
    thickness(rope, &at)?;
    closed(rope, &at)?;
    for (k, added) in rope.node_mass.iter().enumerate() {
        not_negative(&at(&format!("node_mass[{k}].mass")), added.mass, "kg")?;
        if rope.node(added.node).is_none() {
            let mistake = Mistake::NoSuchNode { rope: rope.name.clone(), node: added.node, nodes: rope.n_nodes() };
            return Err(SceneError::at(at(&format!("node_mass[{k}].node")), mistake));
        }
    }
    twist(scene, r)?;
    section(rope, &at)?;
    if rope.contact == Touching::Edges && rope.radius == 0.0 {
        return Err(SceneError::at(at("radius"), Mistake::ThinEdges));
    }
    if let Initial::Between { sag: Some(sag), .. } = rope.initial {
        not_negative(&at("initial.sag"), sag, "m")?;
    }
    rope_points(scene, r).map(|_| ())
}

fn numbers(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    positive(&at("length"), rope.length, "m")?;
    positive(&at("linear_density"), rope.linear_density, "kg/m")?;
    let quantities = [
        ("stretch_stiffness", rope.stretch_stiffness, "N"),
        ("stretch_damping", rope.stretch_damping, "N·s"),
        ("bend_stiffness", rope.bend_stiffness, "N·m²"),
        ("bend_damping", rope.bend_damping, "N·m²·s"),
        ("drag_linear", rope.drag_linear, "kg/(m·s)"),
        ("drag_quadratic", rope.drag_quadratic, "kg/m²"),
        ("tip_mass", rope.tip_mass, "kg"),
        ("radius", rope.radius, "m"),
    ];
    quantities.iter().try_for_each(|(key, value, unit)| not_negative(&at(key), *value, unit))
}

/// Refusals of rings.
fn closed(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let refuse = |key: &str, kind, shape| Err(SceneError::at(at(key), Mistake::Shape { kind, shape }));
    match (&rope.initial, rope.closed) {
        (Initial::Straight { .. }, true) => refuse("initial", "closed", "straight"),
        (Initial::Between { .. }, true) => refuse("initial", "closed", "between two points"),
        (Initial::Circle { .. }, false) => refuse("initial", "open", "as a circle"),
        (_, true) if rope.tip_mass != 0.0 => {
            Err(SceneError::at(at("tip_mass"), Mistake::NoEnds { rope: rope.name.clone(), what: "tip" }))
        }
        _ => Ok(()),
    }
}

/// Requirements of a rod beside those of a rope.
fn twist(scene: &Scene, r: usize) -> Result<(), SceneError> {
    let rope = &scene.rope[r];
    let Some(twist) = &rope.twist else { return Ok(()) };
    let at = |key: &str| format!("rope[{r}].twist.{key}");
    let quantities = [("stiffness", twist.stiffness, "N·m²"), ("damping", twist.damping, "N·m²·s")];
    quantities.iter().try_for_each(|(key, value, unit)| not_negative(&at(key), *value, unit))?;
    if let Some(second) = twist.bend_stiffness_2 {
        not_negative(&at("bend_stiffness_2"), second, "N·m²")?;
    }
    match twist.inertia {
        Some(inertia) => positive(&at("inertia"), inertia, "kg·m")?,
        None if rope.radius == 0.0 => {
            let mistake = Mistake::MissingKey { key: "inertia".to_owned(), unit: Some("kg·m".to_owned()) };
            return Err(SceneError::at(format!("rope[{r}].twist"), mistake));
        }
        None => {}
    }
    joints(scene, rope, twist, &at)?;
    RodStart::new(scene, r).map(drop)
}

/// Every section of its own is at a node where two edges meet, and at another than the one before.
fn joints(scene: &Scene, rope: &Rope, twist: &Twist, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let n = rope.n_nodes();
    let first = usize::from(!(rope.closed || scene.clamps_end(rope, End::First)));
    let last = n - usize::from(!(rope.closed || scene.clamps_end(rope, End::Last)));
    let mut seen = Vec::new();
    for (k, joint) in twist.joint.iter().enumerate() {
        let at = |key: &str| at(&format!("joint[{k}].{key}"));
        let mistake = match rope.node(joint.node) {
            None => Mistake::NoSuchNode { rope: rope.name.clone(), node: joint.node, nodes: n },
            Some(node) if !(first..last).contains(&node) => Mistake::NoJoint { rope: rope.name.clone(), node: joint.node },
            Some(node) if seen.contains(&node) => Mistake::JointTwice { rope: rope.name.clone(), node: joint.node },
            Some(node) => {
                seen.push(node);
                not_negative(&at("bend_factor"), joint.bend_factor, "-")?;
                continue;
            }
        };
        return Err(SceneError::at(at("node"), mistake));
    }
    Ok(())
}

/// Laws of a rod's section beyond linear elasticity.
fn section(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let tables = [
        ("creep", rope.creep.is_some()),
        ("plasticity", rope.plasticity.is_some()),
        ("stiffening", rope.stiffening.is_some()),
        ("bend_friction", rope.bend_friction.is_some()),
    ];
    if let (None, Some((key, _))) = (&rope.twist, tables.iter().find(|(_, given)| *given)) {
        return Err(SceneError::at(at(key), Mistake::NeedsTwist { key }));
    }
    if let Some(creep) = &rope.creep {
        not_negative(&at("creep.fraction"), creep.fraction, "-")?;
        creep.twist_fraction.map_or(Ok(()), |value| not_negative(&at("creep.twist_fraction"), value, "-"))?;
        positive(&at("creep.time"), creep.time, "s")?;
    }
    if let Some(plasticity) = &rope.plasticity {
        positive(&at("plasticity.yield_curvature"), plasticity.yield_curvature, "1/m")?;
        positive(&at("plasticity.time"), plasticity.time, "s")?;
    }
    if let Some(friction) = &rope.bend_friction {
        not_negative(&at("bend_friction.moment"), friction.moment, "N·m")?;
        positive(&at("bend_friction.curvature"), friction.curvature, "1/m")?;
    }
    Ok(())
}

/// Sizes that betray another unit.
fn units(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    if rope.length > LONGEST {
        let reason = format!(", longer than {LONGEST} m");
        let mistake = Mistake::Unit { value: rope.length, unit: "m", reason, likely: "mm", instead: 1e-3 * rope.length };
        return Err(SceneError::at(at("length"), mistake));
    }
    if 2.0 * rope.radius > rope.length {
        let reason = format!(", so the rope is thicker than its length of {} m", rope.length);
        let mistake = Mistake::Unit { value: rope.radius, unit: "m", reason, likely: "mm", instead: 1e-3 * rope.radius };
        return Err(SceneError::at(at("radius"), mistake));
    }
    let density = rope.linear_density / (PI * rope.radius * rope.radius);
    if rope.radius > 0.0 && density > DENSEST {
        let reason = format!(", which in a radius of {} m is {density:.0} kg/m³, denser than any metal", rope.radius);
        let instead = 1e-3 * rope.linear_density;
        let mistake = Mistake::Unit { value: rope.linear_density, unit: "kg/m", reason, likely: "g/m", instead };
        return Err(SceneError::at(at("linear_density"), mistake));
    }
    Ok(())
}

fn nodes(scene: &Scene, rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let given = usize::from(rope.nodes.is_some()) + usize::from(rope.edge_fractions.is_some());
    if given != 1 {
        let field = if given == 0 { at("") } else { at("nodes") };
        let keys = list(["nodes", "edge_fractions"]);
        return Err(SceneError::at(field.trim_end_matches('.'), Mistake::OneOf { keys, given }));
    }
    for (e, fraction) in rope.edge_fractions.iter().flatten().enumerate() {
        positive(&at(&format!("edge_fractions[{e}]")), *fraction, "-")?;
    }
    if let Some(strains) = &rope.edge_rest_strains {
        let expected = rope.fractions().len();
        if strains.len() != expected {
            return Err(SceneError::at(at("edge_rest_strains"), Mistake::Count { found: strains.len(), expected }));
        }
        let (low, high) = REST_STRAIN;
        if let Some((e, strain)) = strains.iter().enumerate().find(|(_, strain)| !(low..=high).contains(*strain)) {
            return Err(SceneError::at(at(&format!("edge_rest_strains[{e}]")), Mistake::Range { value: *strain, low, high }));
        }
    }
    let nodes = rope.n_nodes();
    let clamped = [End::First, End::Last].iter().any(|end| scene.clamps_end(rope, *end));
    let bends = (rope.bend_stiffness > 0.0 || rope.bend_damping > 0.0) && !clamped;
    let (needed, why) = if rope.closed {
        (4, "a closed rope")
    } else if bends {
        (3, "bending (`bend_stiffness`, `bend_damping`)")
    } else {
        (2, "a rope")
    };
    if nodes < needed {
        let key = if rope.nodes.is_some() { "nodes" } else { "edge_fractions" };
        return Err(SceneError::at(at(key), Mistake::TooFewNodes { nodes, needed, why }));
    }
    Ok(())
}

/// Radii that fit the rope, but not its edges.
fn thickness(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let fractions = rope.fractions();
    let (first, longest) = fractions.iter().enumerate().fold((0, 0.0), |a, (k, f)| if *f > a.1 { (k, *f) } else { a });
    let (edge, radius) = (longest * rope.length, rope.radius);
    if radius > 5.0 * edge {
        let nodes = (5.0 * rope.length / radius).floor() as usize + usize::from(!rope.closed);
        return Err(SceneError::at(at("radius"), Mistake::FinelyDivided { radius, edge, first, nodes }));
    }
    let density = rope.linear_density / (PI * radius * radius);
    if 2.0 * radius > edge && density < LIGHTEST {
        let reason = format!(
            ", thicker than its longest edge is long ({edge} m, from node {first} to node {}), and lighter than air ({density:.2e} kg/m³)",
            first + 1
        );
        let mistake = Mistake::Unit { value: radius, unit: "m", reason, likely: "mm", instead: 1e-3 * radius };
        return Err(SceneError::at(at("radius"), mistake));
    }
    Ok(())
}
