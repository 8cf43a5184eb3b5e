//! Refusing forces of one's own that cannot be evaluated, or that act on nothing.

use crate::body::JointKind;
use crate::cloth_error::ClothMistake;
use crate::error::{Mistake, SceneError};
use crate::file::Scene;
use crate::force::{Force, Formulas};
use crate::force_error::ForceMistake;
use crate::words::{list, nearest};
use pliant_math::formula::is_known;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    scene.force.iter().enumerate().try_for_each(|(k, force)| one(scene, force, &format!("force[{k}]")))
}

fn refused<T>(field: String, error: ForceMistake) -> Result<T, SceneError> {
    Err(SceneError::at(field, Mistake::Force { error }))
}

fn one(scene: &Scene, force: &Force, field: &str) -> Result<(), SceneError> {
    let given = [&force.joint, &force.rope, &force.cloth].into_iter().flatten().count();
    if given != 1 {
        return Err(SceneError::at(field, Mistake::OneOf { keys: list(["joint", "rope", "cloth"]), given }));
    }
    let joint = match &force.joint {
        Some(name) => Some(kind(scene, name, &format!("{field}.joint"))?),
        None => None,
    };
    let Some(variables) = force.variables(joint) else {
        let (joint, free) = (force.joint.clone().unwrap_or_default(), joint == Some(JointKind::Free));
        return refused(format!("{field}.joint"), ForceMistake::Kind { joint, kind: if free { "free" } else { "universal" } });
    };
    nodes(scene, force, field)?;
    let (expected, axes) = match joint {
        Some(JointKind::Ball) => (3, "a ball joint"),
        Some(_) => (1, "a joint of one axis"),
        None => (3, "nodes"),
    };
    let found = force.formula.texts().len();
    if found != expected {
        return refused(format!("{field}.formula"), ForceMistake::Count { found, expected, axes });
    }
    parameters(force, variables, field)
}

/// The kind of the joint of that name.
fn kind(scene: &Scene, name: &str, field: &str) -> Result<JointKind, SceneError> {
    let joints = || scene.body.iter().flat_map(|body| &body.joint);
    let names = || joints().map(|joint| joint.name.as_str());
    joints().find(|joint| joint.name == name).map(|joint| joint.kind).ok_or_else(|| {
        let (nearest, known) = (nearest(name, names()).map(str::to_owned), names().collect::<Vec<_>>().join(", "));
        SceneError::at(field, Mistake::NoSuch { what: "joint", name: name.to_owned(), nearest, known })
    })
}

/// The rope or sheet is there, and has the nodes, each once.
fn nodes(scene: &Scene, force: &Force, field: &str) -> Result<(), SceneError> {
    let rope = force.rope.as_ref().map(|name| {
        let names = || scene.rope.iter().map(|rope| rope.name.as_str());
        scene.rope.iter().find(|rope| rope.name == *name).ok_or_else(|| {
            let (nearest, known) = (nearest(name, names()).map(str::to_owned), list(names()));
            SceneError::at(format!("{field}.rope"), Mistake::NoSuchRope { rope: name.clone(), nearest, known })
        })
    });
    let rope = rope.transpose()?;
    let cloth = force.cloth.as_ref().map(|name| {
        let names = || scene.cloth.iter().map(|cloth| cloth.name.as_str());
        scene.cloth.iter().find(|cloth| cloth.name == *name).ok_or_else(|| {
            let (nearest, known) = (nearest(name, names()).map(str::to_owned), names().collect::<Vec<_>>().join(", "));
            SceneError::at(format!("{field}.cloth"), Mistake::NoSuch { what: "cloth", name: name.clone(), nearest, known })
        })
    });
    let cloth = cloth.transpose()?;
    let Some(numbers) = &force.nodes else { return Ok(()) };
    if force.joint.is_some() {
        return refused(format!("{field}.nodes"), ForceMistake::NodesOfJoint);
    }
    if numbers.is_empty() {
        return refused(format!("{field}.nodes"), ForceMistake::NoNodes);
    }
    let mut seen = Vec::new();
    for (k, &number) in numbers.iter().enumerate() {
        let (node, mistake) = match (rope, cloth) {
            (Some(rope), _) => {
                let (name, nodes) = (rope.name.clone(), rope.n_nodes());
                (rope.node(number), Mistake::NoSuchNode { rope: name, node: number, nodes })
            }
            (_, Some(cloth)) => {
                let error = ClothMistake::NoSuchNode { cloth: cloth.name.clone(), node: number, nodes: cloth.n_nodes() };
                (cloth.node(number), Mistake::Cloth { error })
            }
            _ => return Ok(()),
        };
        let field = format!("{field}.nodes[{k}]");
        let Some(node) = node else { return Err(SceneError::at(field, mistake)) };
        if seen.contains(&node) {
            return refused(field, ForceMistake::NodeTwice { node: number });
        }
        seen.push(node);
    }
    Ok(())
}

/// Names of parameters are names, and the formulas can be read and use them.
fn parameters(force: &Force, variables: &[&str], field: &str) -> Result<(), SceneError> {
    for name in force.parameters.keys() {
        let mut letters = name.chars();
        let usable =
            letters.next().is_some_and(|c| c.is_ascii_alphabetic()) && letters.all(|c| c.is_ascii_alphanumeric() || c == '_');
        let why = match name.as_str() {
            _ if variables.contains(&name.as_str()) => "it is a variable",
            _ if is_known(name) => "it is a function or a number of all formulas",
            _ if !usable => "it is no name of letters, digits and `_`",
            _ => continue,
        };
        return refused(format!("{field}.parameters.{name}"), ForceMistake::Parameter { name: name.clone(), why });
    }
    let (found, most) = (force.parameters.len(), force.most_parameters());
    if found > most {
        let place = if force.joint.is_some() { "at a joint" } else { "on nodes" };
        return refused(format!("{field}.parameters"), ForceMistake::Many { found, most, place });
    }
    let formulas = force.read(variables).or_else(|(k, error)| {
        let at = match &force.formula {
            Formulas::One(_) => format!("{field}.formula"),
            Formulas::Three(_) => format!("{field}.formula[{k}]"),
        };
        refused(at, ForceMistake::Formula { text: force.formula.texts()[k].clone(), error: Box::new(error) })
    })?;
    let unused = |k: &usize| formulas.iter().all(|formula| !formula.uses(variables.len() + k));
    match (0..found).find(unused).and_then(|k| force.parameters.keys().nth(k)) {
        Some(name) => refused(format!("{field}.parameters.{name}"), ForceMistake::Unused { name: name.clone() }),
        None => Ok(()),
    }
}
