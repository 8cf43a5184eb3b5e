//! Where every node is at the beginning, and how fast.

use super::cloth_initial::cloth_points;
use super::error::{Mistake, SceneError};
use super::file::Scene;
use super::gripper::{Clamp, End};
use super::parabola::nodes_between;
use super::rope::{Initial, Rope};
use super::vector::{V3, add, dot, norm, scale, sub, unit};
use pliant_math::Vec3;
use pliant_math::transport::{any_normal, normal_part};
use std::f64::consts::PI;

/// Edges may start at between these parts of their rest length.
const STRAIN: std::ops::RangeInclusive<f64> = 0.1..=1.5;
/// Cosine of the sharpest bend at which a rope may start.
const SHARPEST: f64 = -0.999;

/// Positions q [m] and velocities v [m/s] of all nodes as the scene gives them: three numbers per node, rope after rope, the
/// ghost of a clamped first edge before, that of a clamped last edge after the rope's nodes; then sheet after sheet; then the point of
/// each gripper that grasps.
pub fn initial_state(scene: &Scene) -> Result<(Vec<f64>, Vec<f64>), SceneError> {
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for r in 0..scene.rope.len() {
        let points = with_ghosts(scene, r)?;
        v.extend(points.iter().flat_map(|_| scene.rope[r].velocity));
        q.extend(points.into_iter().flatten());
    }
    for (c, cloth) in scene.cloth.iter().enumerate() {
        let points = cloth_points(cloth, c)?;
        v.extend(points.iter().flat_map(|_| cloth.velocity));
        q.extend(points.into_iter().flatten());
    }
    for gripper in &scene.gripper {
        if let Clamp::Grasp(grasp) = &gripper.clamp {
            q.extend(grasp.at);
            v.extend([0.0; 3]);
        }
    }
    Ok((q, v))
}

/// Positions of the nodes of rope `r`, ghosts included.
pub(super) fn with_ghosts(scene: &Scene, r: usize) -> Result<Vec<V3>, SceneError> {
    let rope = &scene.rope[r];
    let mut points = rope_points(scene, r)?;
    if scene.clamps_end(rope, End::First) {
        let ghost = sub(points[0], scale(end_axis(&points, End::First), end_length(rope, End::First)));
        points.insert(0, ghost);
    }
    if scene.clamps_end(rope, End::Last) {
        let axis = end_axis(&points, End::Last);
        points.push(sub(points[points.len() - 1], scale(axis, end_length(rope, End::Last))));
    }
    Ok(points)
}

/// Unit tangent pointing into the rope from one of its ends.
pub(super) fn end_axis(points: &[V3], end: End) -> V3 {
    let n = points.len();
    let into = match end {
        End::First => sub(points[1], points[0]),
        End::Last => sub(points[n - 2], points[n - 1]),
    };
    // Neighbouring nodes are apart: rope_points has checked it.
    unit(into).unwrap_or([1.0, 0.0, 0.0])
}

/// Rest length of the edge at an end [m].
fn end_length(rope: &Rope, end: End) -> f64 {
    let fractions = rope.fractions();
    let edge = if end == End::First { 0 } else { fractions.len() - 1 };
    rope.length * fractions[edge]
}

/// Positions of the nodes of rope `r`, without ghosts. A rope needs at least two nodes.
pub(super) fn rope_points(scene: &Scene, r: usize) -> Result<Vec<V3>, SceneError> {
    let rope = &scene.rope[r];
    let n = rope.n_nodes();
    if n < 2 {
        let mistake = Mistake::TooFewNodes { nodes: n, needed: 2, why: "a rope" };
        return Err(SceneError::at(format!("rope[{r}].nodes"), mistake));
    }
    let rest: Vec<f64> = rope.fractions().iter().map(|f| f * rope.length).collect();
    let (points, field) = match &rope.initial {
        Initial::Straight { from, direction } => (straight(*from, *direction, &rest, r)?, "direction"),
        Initial::Between { from, to, sag } => (nodes_between(*from, *to, *sag, &rest, scene.gravity.direction()), "to"),
        Initial::Circle { center, normal, first } => (circle(*center, *normal, *first, &rest, r)?, "center"),
        Initial::Points { points } if points.len() != n => {
            let mistake = Mistake::PointCount { points: points.len(), nodes: n };
            return Err(SceneError::at(format!("rope[{r}].initial.points"), mistake));
        }
        Initial::Points { points } => (points.clone(), "points"),
    };
    possible(&points, &rest, &format!("rope[{r}].initial.{field}"))?;
    Ok(points)
}

fn straight(from: V3, direction: V3, rest: &[f64], r: usize) -> Result<Vec<V3>, SceneError> {
    let refused = || SceneError::at(format!("rope[{r}].initial.direction"), Mistake::NoDirection);
    let axis = unit(direction).ok_or_else(refused)?;
    let mut arc = 0.0;
    let others = rest.iter().map(|l| {
        arc += l;
        add(from, scale(axis, arc))
    });
    Ok(std::iter::once(from).chain(others).collect())
}

/// The polygon with these edges and its corners on a circle about `center`; its centre must lie inside.
fn circle(center: V3, normal: V3, first: Option<V3>, rest: &[f64], r: usize) -> Result<Vec<V3>, SceneError> {
    let refused = |key: &str| SceneError::at(format!("rope[{r}].initial.{key}"), Mistake::NoDirection);
    let axis = Vec3::from(unit(normal).ok_or_else(|| refused("normal"))?);
    let x = match first {
        None => any_normal(&axis),
        Some(first) => normal_part(&Vec3::from(first), &axis).ok_or_else(|| refused("first"))?,
    };
    let y = axis.cross(&x);
    let Some(radius) = circumradius(rest) else {
        let edge = (0..rest.len()).fold(0, |long, e| if rest[e] > rest[long] { e } else { long });
        let mistake = Mistake::NoPolygon { edge, length: rest[edge], others: rest.iter().sum::<f64>() - rest[edge] };
        return Err(SceneError::at(format!("rope[{r}].edge_fractions[{edge}]"), mistake));
    };
    let mut angle = 0.0_f64;
    let corner = |edge: &f64| {
        let at = Vec3::from(center) + (x * angle.cos() + y * angle.sin()) * radius;
        angle += 2.0 * (0.5 * edge / radius).asin();
        at.into()
    };
    Ok(rest.iter().map(corner).collect())
}

/// Radius of the circle on which chords of these lengths go round once; `None` if the longest needs more than half of it.
fn circumradius(chords: &[f64]) -> Option<f64> {
    let longest = chords.iter().fold(0.0_f64, |m, c| m.max(*c));
    let round = |radius: f64| chords.iter().map(|c| (0.5 * c / radius).min(1.0).asin()).sum::<f64>() - PI;
    let (mut low, mut high) = (0.5 * longest, chords.iter().sum::<f64>());
    if round(low) < 0.0 {
        return None;
    }
    // the sum of angles falls with the radius; bisection to the last bit
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if round(middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// Refuses edges without length, far from their rest length, or folded back.
fn possible(points: &[V3], rest: &[f64], field: &str) -> Result<(), SceneError> {
    let at = |node: usize| if field.ends_with("points") { format!("{field}[{node}]") } else { field.to_owned() };
    let n = points.len();
    // as many edges as nodes close the rope
    let edges: Vec<V3> = (0..rest.len()).map(|e| sub(points[(e + 1) % n], points[e])).collect();
    for (e, (edge, rest)) in edges.iter().zip(rest).enumerate() {
        let (length, end) = (norm(*edge), (e + 1) % n);
        if length == 0.0 {
            return Err(SceneError::at(at(end), Mistake::Coincident { first: e, second: end }));
        }
        if !STRAIN.contains(&(length / rest)) {
            return Err(SceneError::at(at(end), Mistake::Stretched { edge: e, end, length, rest: *rest }));
        }
    }
    let closing = (rest.len() == n).then(|| (n - 1, 0));
    for (e, next) in (1..edges.len()).map(|e| (e - 1, e)).chain(closing) {
        if dot(edges[e], edges[next]) < SHARPEST * norm(edges[e]) * norm(edges[next]) {
            return Err(SceneError::at(at(next), Mistake::Fold { node: next }));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{Gripper, Nothing};
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn ghosts_stand_before_and_after_the_rope() {
        let clamp = |name: &str, end| Gripper { name: name.into(), clamp: Clamp::End(end), ..Gripper::default() };
        let mut rope = Rope { nodes: None, edge_fractions: Some(vec![1.0, 3.0]), velocity: [0.1, 0.2, 0.3], ..Rope::default() };
        rope.initial = Initial::Straight { from: [1.0, 0.0, 0.0], direction: [0.0, 2.0, 0.0] };
        let gripper = vec![clamp("left", End::First), clamp("right", End::Last)];
        let scene = Scene::<Nothing> { rope: vec![rope], gripper, ..Scene::default() };
        let (q, v) = initial_state(&scene).unwrap();
        assert_eq!((q.len(), v.len()), (15, 15));
        for (node, y) in [-0.25, 0.0, 0.25, 1.0, 1.75].iter().enumerate() {
            assert_relative_eq!(q[3 * node], 1.0);
            assert_relative_eq!(q[3 * node + 1], y);
        }
        assert_eq!(v[12..], [0.1, 0.2, 0.3]);
    }
}
