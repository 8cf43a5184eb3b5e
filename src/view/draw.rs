//! From a run to its picture.

use super::numbers::{Numbers, Slice};
use super::picture::{Bone, Drawn, Mesh, Picture, Polyhedron, Rope, Scale, left_out};
use super::{Caption, Run};
use crate::{Model, State};
use pliant_engine::geometry::collider::{Attachment, Collider, ColliderShape, Pose};
use pliant_engine::model::RopeSpan;
use pliant_math::Vec3;
use pliant_math::inertia::from_numbers;
use pliant_math::rotation::{from_matrix, matrix};
use std::ops::Range;

/// Name, nodes and triangles of a surface.
type Surface = (String, Range<usize>, Vec<[usize; 3]>);

/// The surfaces of a model, triangles counted from the surface's first node.
fn surfaces(model: &Model) -> Vec<Surface> {
    model.cloths().iter().map(|cloth| (cloth.name.clone(), cloth.nodes.clone(), cloth.triangles.clone())).collect()
}

/// Unit vectors across the edges of a rope at a state, one after the other, that turn with its material; none of ropes without twist.
fn directors(run: &Run, rope: &RopeSpan, state: &State) -> Option<Vec<f64>> {
    let edges: Vec<usize> = twisting(run.model, rope);
    let axes = (!edges.is_empty()).then(|| run.model.material_axes(&state.q, &state.z))?;
    Some(edges.into_iter().flat_map(|k| [axes[k].x, axes[k].y, axes[k].z]).collect())
}

/// Numbers of a rope's edges among those that twist.
fn twisting(model: &Model, rope: &RopeSpan) -> Vec<usize> {
    let edges = model.rods().edges.iter().enumerate();
    edges.filter(|(_, edge)| edge.nodes.iter().all(|node| rope.nodes.contains(node))).map(|(k, _)| k).collect()
}

/// Numbers that a frame takes.
pub(super) fn numbers_per_frame(model: &Model) -> usize {
    let ropes: usize = model.ropes().iter().map(|rope| 4 * (rope.fractions.len() + 1)).sum();
    let surfaces: usize = surfaces(model).iter().map(|(_, nodes, _)| 3 * nodes.len()).sum();
    2 + ropes + 3 * model.rods().n_twists() + surfaces + 3 * model.grasps().len() + 7 * model.tree().bodies().len()
}

/// Everything that is drawn of the states `frames`.
pub(super) fn picture<'a>(run: &Run<'a>, frames: &[usize], caption: &'a Caption, numbers: &mut Numbers) -> Picture<'a> {
    let model = run.model;
    let states: Vec<&State> = frames.iter().map(|k| &run.states[*k]).collect();
    let center = center(model, states[0]);
    let time = numbers.push(frames.iter().map(|k| *k as f64 * model.step_length()));
    let energy = numbers.push(states.iter().map(|x| energy(run, x)));
    let poses = push_poses(model, &states, &center, numbers);
    let mut out = Picture::new(caption, center, time, energy, poses);
    out.note = (states.len() < run.states.len()).then(|| left_out(states.len(), run.states.len()));
    out.ropes = model.ropes().iter().map(|span| rope(run, span, &states, &center, numbers)).collect();
    out.meshes = surfaces(model).into_iter().map(|surface| mesh(model, surface, &states, &center, numbers)).collect();
    out.parents = model.tree().bodies().iter().map(|body| body.parent).collect();
    out.solids = model.colliders().iter().filter_map(|solid| drawn(solid, run.theta, &center)).collect();
    out.bones = bones(run);
    let point = |node: usize| push_positions(&[node], &states, &center, numbers);
    out.points = model.grasps().iter().map(|grasp| grasp.node).map(point).collect();
    out.scale = scale(run, &states);
    out
}

fn energy(run: &Run, x: &State) -> f64 {
    run.model.kinetic_energy(&x.q, &x.v, run.theta) + run.model.potential_energy(&x.q, &x.z, run.theta)
}

/// The middle of the moving objects at the start \[m\].
fn center(model: &Model, state: &State) -> [f64; 3] {
    let nodes = model.ropes().iter().map(|rope| rope.nodes.clone()).chain(surfaces(model).into_iter().map(|s| s.1)).flatten();
    let nodes = nodes.map(|i| [state.q[3 * i], state.q[3 * i + 1], state.q[3 * i + 2]]);
    let bodies = model.body_poses(&state.q).into_iter().map(|(p, _)| [p.x, p.y, p.z]);
    let points: Vec<[f64; 3]> = nodes.chain(bodies).collect();
    std::array::from_fn(|a| {
        let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[a]), h.max(p[a])));
        if low <= high { 0.5 * (low + high) } else { 0.0 }
    })
}

fn push_poses(model: &Model, states: &[&State], center: &[f64; 3], numbers: &mut Numbers) -> Slice {
    let poses = states.iter().flat_map(|x| model.body_poses(&x.q));
    numbers.push(poses.flat_map(|(p, r)| [p.x - center[0], p.y - center[1], p.z - center[2], r[0], r[1], r[2], r[3]]))
}

fn push_positions(nodes: &[usize], states: &[&State], center: &[f64; 3], numbers: &mut Numbers) -> Slice {
    let of_nodes = |x: &&State| nodes.iter().flat_map(|i| [x.q[3 * i], x.q[3 * i + 1], x.q[3 * i + 2]]).collect::<Vec<_>>();
    numbers.push(states.iter().flat_map(of_nodes).enumerate().map(|(k, x)| x - center[k % 3]))
}

/// Nodes that a gripper moves, counted from the first of the range.
fn held(model: &Model, nodes: &Range<usize>) -> Vec<usize> {
    nodes.clone().filter(|i| model.prescribed()[*i]).map(|i| i - nodes.start).collect()
}

fn rope<'a>(run: &Run<'a>, span: &'a RopeSpan, states: &[&State], center: &[f64; 3], numbers: &mut Numbers) -> Rope<'a> {
    let radius = run.model.params().find(&format!("{}.radius", span.name));
    let directors: Option<Vec<f64>> =
        states.iter().map(|x| directors(run, span, x)).collect::<Option<Vec<_>>>().map(|d| d.concat());
    Rope {
        name: &span.name,
        nodes: span.fractions.len() + 1,
        radius: radius.map_or(0.0, |k| run.theta[k]),
        positions: push_positions(&along(span), states, center, numbers),
        held: held(run.model, &span.nodes),
        colour: Some(numbers.push(states.iter().flat_map(|x| strains(run, span, x)))),
        director: directors.map(|d| numbers.push(d)),
    }
}

fn mesh(model: &Model, (name, nodes, triangles): Surface, states: &[&State], center: &[f64; 3], numbers: &mut Numbers) -> Mesh {
    let positions = push_positions(&nodes.clone().collect::<Vec<_>>(), states, center, numbers);
    Mesh { name, nodes: nodes.len(), positions, triangles, held: held(model, &nodes), colour: None }
}

/// Strain of each edge of a rope [-]: its length over its rest length, less one.
fn strains(run: &Run, span: &RopeSpan, x: &State) -> Vec<f64> {
    let point = |i: usize| Vec3::new(x.q[3 * i], x.q[3 * i + 1], x.q[3 * i + 2]);
    let rest = |e: usize| run.theta[span.length] * span.fractions[e];
    let stretched = |e: usize| {
        let [a, b] = span.edge(e);
        (point(b) - point(a)).norm() / rest(e) - 1.0
    };
    (0..span.fractions.len()).map(stretched).collect()
}

/// The nodes of a rope from end to end; a closed one's first node is its last too.
fn along(span: &RopeSpan) -> Vec<usize> {
    let first = span.nodes.start;
    std::iter::once(first).chain((0..span.fractions.len()).map(|e| span.edge(e)[1])).collect()
}

/// The range of all strains; none without ropes.
fn scale(run: &Run, states: &[&State]) -> Option<Scale> {
    let ropes = run.model.ropes();
    let strains = states.iter().flat_map(|x| ropes.iter().flat_map(|span| strains(run, span, x)));
    let most = strains.fold(0.0, |most: f64, strain| most.max(strain.abs()));
    (!ropes.is_empty()).then_some(Scale { name: "strain", unit: "-", most })
}

/// A shape as it is drawn; nodes are drawn as ropes.
fn drawn<'a>(solid: &'a Collider, theta: &[f64], center: &[f64; 3]) -> Option<Drawn<'a>> {
    let (body, origin) = match solid.attachment {
        Attachment::World => (None, -Vec3::from(*center)),
        Attachment::Body(body) => (Some(body), Vec3::zeros()),
        Attachment::Node(_) => return None,
    };
    let pose = Pose { rotation: matrix(&[1.0, 0.0, 0.0, 0.0]), position: origin };
    let mut posed = solid.placed(&pose, |k| theta[k]);
    if posed.rotation.column(0).norm() == 0.0 {
        // a capsule between two points has an axis only
        let z: Vec3<f64> = posed.rotation.column(2).into_owned();
        let mut e = Vec3::zeros();
        e[z.iamin()] = 1.0;
        let x = e.cross(&z).normalize();
        posed.rotation.set_column(0, &x);
        posed.rotation.set_column(1, &z.cross(&x));
    }
    Some(Drawn {
        name: &solid.name,
        form: form(&posed.form),
        body,
        position: posed.position.into(),
        quaternion: from_matrix(&posed.rotation),
        sizes: posed.sizes[..posed.form.n_sizes()].to_vec(),
        hull: hull(&posed.form),
    })
}

fn form(form: &ColliderShape) -> &'static str {
    match form {
        ColliderShape::HalfSpace => "plane",
        ColliderShape::Ball => "ball",
        ColliderShape::Capsule => "capsule",
        ColliderShape::Cylinder => "cylinder",
        ColliderShape::Block => "block",
        ColliderShape::Hull(_) => "hull",
    }
}

fn hull(form: &ColliderShape) -> Option<Polyhedron> {
    let ColliderShape::Hull(hull) = form else { return None };
    let (corners, triangles) = hull.surface();
    Some(Polyhedron { corners: corners.iter().map(|c| (*c).into()).collect(), triangles: triangles.to_vec() })
}

/// Bodies without shapes, by lines to their centre of mass, to the bodies that hang on them and to where loops close.
fn bones(run: &Run) -> Vec<Bone> {
    let bodies = run.model.tree().bodies();
    let has_shape = |b: usize| run.model.colliders().iter().any(|s| s.attachment == Attachment::Body(b));
    let mut out = Vec::new();
    for (b, body) in bodies.iter().enumerate().filter(|(b, _)| !has_shape(*b)) {
        if let Some(inertia) = body.inertia {
            let i = from_numbers(&std::array::from_fn(|k| run.theta[inertia.first + k]));
            out.push(Bone { body: b, to: (i.h / i.m).into(), mass: true });
        }
        let children = bodies.iter().filter(|child| child.parent == Some(b)).map(|child| child.position.into());
        let ties = run.model.closures().iter().flat_map(|tie| tie.attachments.into_iter().zip(tie.points));
        let ties = ties.filter(|(carrier, _)| *carrier == Attachment::Body(b));
        let ties = ties.map(|(_, k)| [run.theta[k], run.theta[k + 1], run.theta[k + 2]]);
        out.extend(children.chain(ties).map(|to| Bone { body: b, to, mass: false }));
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Case;

    #[test]
    fn a_surface_is_its_nodes_and_triangles() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
        let case = Case::read(folder.join("clamped_ends.toml")).unwrap();
        let mut numbers = Numbers::default();
        numbers.push([0.0]);
        let triangles = vec![[0, 1, 2], [2, 1, 3]];
        let center = [0.1, 0.0, 0.0];
        let surface = ("sheet".to_owned(), 1..5, triangles.clone());
        let mesh = mesh(&case.model, surface, &[&case.x0, &case.x0], &center, &mut numbers);
        assert_eq!((mesh.nodes, &mesh.triangles, &mesh.held), (4, &triangles, &vec![0]));
        let json = serde_json::to_value(&mesh).unwrap();
        assert_eq!(json["positions"], serde_json::json!({ "offset": 1, "length": 2 * 4 * 3 }));
        assert_eq!(json["colour"], serde_json::Value::Null);
    }
}
