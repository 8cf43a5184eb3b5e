//! Motions of the grippers of a scene: the rows of the input u.

use super::actuator::{Actuator, ActuatorKind};
use super::body::JointKind;
use super::error::SceneError;
use super::file::Scene;
use super::gripper::{Clamp, End, Gripper, Mode, Motion};
use super::held::Held;
use super::initial::{end_axis, rope_points, with_ghosts};
use super::rod::RodStart;
use super::vector::{V3, add, scale, sub, unit};

/// One entry of u.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Control {
    /// Name, e.g. `left.node[0].x`, `left.position.x`, `left.axis.x`, `left.velocity.x`, `left.angular_velocity.x`, `left.closing`.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
}

/// The entries of u, gripper after gripper, then actuator after actuator.
pub fn control_list(scene: &Scene) -> Vec<Control> {
    let grippers = scene.gripper.iter().flat_map(|gripper| controls_of(scene, gripper));
    grippers.chain(scene.actuator.iter().map(|a| Control { name: a.name.clone(), unit: control_unit(scene, a) })).collect()
}

fn control_unit(scene: &Scene, actuator: &Actuator) -> &'static str {
    let joint = scene.body.iter().flat_map(|b| &b.joint).find(|j| j.name == actuator.joint);
    let sliding = joint.is_some_and(|j| j.kind == JointKind::Prismatic);
    match (actuator.kind, sliding) {
        (ActuatorKind::Torque, _) => "-",
        (ActuatorKind::Position, false) => "rad",
        (ActuatorKind::Position, true) => "m",
        (ActuatorKind::Velocity, false) => "rad/s",
        (ActuatorKind::Velocity, true) => "m/s",
    }
}

fn controls_of(scene: &Scene, gripper: &Gripper) -> Vec<Control> {
    let held = scene.held(gripper);
    let node = |number: &i64| match held.and_then(|held| held.node(*number)) {
        Some(node) => (format!("node[{node}]"), "m"),
        None => (format!("node[{number}]"), "m"),
    };
    let groups = match (&gripper.clamp, gripper.mode) {
        (Clamp::Nodes(nodes), Mode::Prescribed) => nodes.iter().map(node).collect(),
        (Clamp::Nodes(_), Mode::Velocity) => vec![("velocity".to_owned(), "m/s")],
        (Clamp::End(_), Mode::Prescribed) => {
            let director = twists(scene, gripper).then(|| ("director".to_owned(), "-"));
            [("position".to_owned(), "m"), ("axis".to_owned(), "-")].into_iter().chain(director).collect()
        }
        (Clamp::End(_), Mode::Velocity) => vec![("velocity".to_owned(), "m/s"), ("angular_velocity".to_owned(), "rad/s")],
        (Clamp::Grasp(_), Mode::Prescribed) => vec![("position".to_owned(), "m")],
        (Clamp::Grasp(_), Mode::Velocity) => vec![("velocity".to_owned(), "m/s")],
    };
    let entry = |(group, unit): (String, &'static str)| {
        ["x", "y", "z"].map(|axis| Control { name: format!("{}.{group}.{axis}", gripper.name), unit })
    };
    let closing =
        matches!(gripper.clamp, Clamp::Grasp(_)).then(|| Control { name: format!("{}.closing", gripper.name), unit: "-" });
    groups.into_iter().flat_map(entry).chain(closing).collect()
}

/// Row k is the input of step k: positions at its *end*, (k + 1) h, for prescribed grippers; for velocity-controlled ones the
/// mean velocity of the motion over the step, so that both modes pass through the same positions.
pub fn control_rows(scene: &Scene, n_steps: usize) -> Result<Vec<Vec<f64>>, SceneError> {
    let rest = resting_inputs(scene)?;
    let h = scene.time.step;
    Ok((0..n_steps).map(|k| row(scene, &rest, k as f64 * h, (k + 1) as f64 * h)).collect())
}

/// The input that holds every gripper where the scene begins: positions at t = 0, velocities zero.
pub fn resting_inputs(scene: &Scene) -> Result<Vec<f64>, SceneError> {
    let mut u = Vec::new();
    for gripper in &scene.gripper {
        let Some(object) = scene.held(gripper) else { continue };
        let points = object.points(scene)?;
        let held = gripper.clamp.numbers().into_iter().filter_map(|number| object.node(number));
        let targets: Vec<V3> = held.map(|node| sub(points[node], gripper.offset)).collect();
        match (&gripper.clamp, gripper.mode) {
            (Clamp::Nodes(_), Mode::Prescribed) => u.extend(targets.into_iter().flatten()),
            (Clamp::Nodes(_), Mode::Velocity) => u.extend([0.0; 3]),
            (Clamp::End(end), Mode::Prescribed) => {
                u.extend(targets.into_iter().flatten());
                u.extend(end_axis(&points, *end));
                if let Held::Rope(_, r) = object {
                    u.extend(end_director(scene, r, *end)?.into_iter().flatten());
                }
            }
            (Clamp::End(End::First | End::Last), Mode::Velocity) => u.extend([0.0; 6]),
            (Clamp::Grasp(grasp), Mode::Prescribed) => u.extend(sub(grasp.at, gripper.offset)),
            (Clamp::Grasp(_), Mode::Velocity) => u.extend([0.0; 3]),
        }
        if let Clamp::Grasp(grasp) = &gripper.clamp {
            u.push(grasp.closing_at(0.0));
        }
    }
    u.extend(scene.actuator.iter().map(|a| a.command.at(0.0)));
    Ok(u)
}

/// First material axis of the clamped end edge of rope `r` as the scene begins, if the rope twists.
fn end_director(scene: &Scene, r: usize, end: End) -> Result<Option<V3>, SceneError> {
    let Some(start) = RodStart::new(scene, r)? else { return Ok(None) };
    let points = with_ghosts(scene, r)?;
    let k = if end == End::First { 0 } else { points.len() - 2 };
    let tangent = unit(sub(points[k + 1], points[k])).unwrap_or([1.0, 0.0, 0.0]);
    Ok(Some(start.axis(k, &tangent.into()).into()))
}

/// `x` turned by `angle` about the unit vector `axis`, to which it is normal.
fn turned(x: V3, axis: V3, angle: f64) -> V3 {
    let across = [axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2], axis[0] * x[1] - axis[1] * x[0]];
    add(scale(x, angle.cos()), scale(across, angle.sin()))
}

/// Direction of a clamped end edge along the rope, from its axis, which points into the rope.
fn along(axis: V3, end: End) -> V3 {
    scale(unit(axis).unwrap_or(axis), if end == End::First { 1.0 } else { -1.0 })
}

fn row(scene: &Scene, rest: &[f64], begin: f64, end: f64) -> Vec<f64> {
    let mut u = rest.to_vec();
    let mut first = 0;
    for gripper in &scene.gripper {
        let (groups, moving) = match (&gripper.clamp, gripper.mode) {
            (Clamp::Nodes(nodes), Mode::Prescribed) => (nodes.len(), nodes.len()),
            (Clamp::Nodes(_), Mode::Velocity) => (1, 1),
            // the axis stays as it is
            (Clamp::End(_), Mode::Prescribed) => (2 + usize::from(twists(scene, gripper)), 1),
            (Clamp::End(_), Mode::Velocity) => (2, 1),
            (Clamp::Grasp(_), _) => (1, 1),
        };
        spin(scene, gripper, &mut u[first..first + 3 * groups], end);
        let at_end = displacement(&gripper.motion, end);
        let change = match gripper.mode {
            Mode::Prescribed => at_end,
            Mode::Velocity => scale(sub(at_end, displacement(&gripper.motion, begin)), 1.0 / (end - begin)),
        };
        for group in (first..first + 3 * moving).step_by(3) {
            let moved = add([u[group], u[group + 1], u[group + 2]], change);
            u[group..group + 3].copy_from_slice(&moved);
        }
        first += 3 * groups;
        if let Clamp::Grasp(grasp) = &gripper.clamp {
            u[first] = grasp.closing_at(0.5 * (begin + end)); // held over the step: its value in the middle
            first += 1;
        }
    }
    // a command holds over its step: its value in the middle
    let commands = scene.actuator.iter().map(|a| a.command.at(0.5 * (begin + end)));
    u[first..].iter_mut().zip(commands).for_each(|(u, value)| *u = value);
    u
}

fn twists(scene: &Scene, gripper: &Gripper) -> bool {
    matches!(scene.held(gripper), Some(Held::Rope(rope, _)) if rope.twist.is_some())
}

/// Turns the director of a clamped end edge as far as its spin has come at time t [s], or sets its angular velocity.
fn spin(scene: &Scene, gripper: &Gripper, u: &mut [f64], t: f64) {
    let Clamp::End(end) = gripper.clamp else { return };
    if gripper.spin == 0.0 || !twists(scene, gripper) {
        return;
    }
    if gripper.mode == Mode::Prescribed {
        let axis = along([u[3], u[4], u[5]], end);
        let director = turned([u[6], u[7], u[8]], axis, gripper.spin * t);
        u[6..9].copy_from_slice(&director);
    } else if let Some(axis) = start_axis(scene, gripper, end) {
        u[3..6].copy_from_slice(&scale(axis, gripper.spin));
    }
}

/// Direction along the rope of a clamped end edge as the scene begins.
fn start_axis(scene: &Scene, gripper: &Gripper, end: End) -> Option<V3> {
    let Some(Held::Rope(_, r)) = scene.held(gripper) else { return None };
    Some(along(end_axis(&rope_points(scene, r).ok()?, end), end))
}

/// Distance covered by a motion at time t [m].
fn displacement(motion: &Motion, t: f64) -> V3 {
    match motion {
        Motion::Hold => [0.0; 3],
        Motion::Line { velocity } => scale(*velocity, t),
        Motion::Sine { amplitude, frequency, phase } => {
            scale(*amplitude, (std::f64::consts::TAU * frequency * t + phase).sin() - phase.sin())
        }
        Motion::Path { points } => along_path(points, t),
    }
}

/// Where a path is at time t [s].
fn along_path(points: &[[f64; 4]], t: f64) -> V3 {
    let place = |[_, x, y, z]: &[f64; 4]| [*x, *y, *z];
    match (points.iter().position(|point| point[0] > t), points.last()) {
        (_, None) => [0.0; 3],
        (None, Some(last)) => place(last),
        (Some(0), _) => place(&points[0]),
        (Some(k), _) => {
            let (a, b) = (&points[k - 1], &points[k]);
            let s = (t - a[0]) / (b[0] - a[0]);
            add(place(a), scale(sub(place(b), place(a)), s * s * (3.0 - 2.0 * s)))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{Nothing, Rope, Time};
    use super::*;
    use approx::assert_relative_eq;

    fn scene(gripper: Vec<Gripper>) -> Scene<Nothing> {
        let rope = Rope { nodes: Some(5), ..Rope::default() };
        Scene { rope: vec![rope], gripper, time: Time { step: 0.1, ..Time::default() }, ..Scene::default() }
    }

    fn names(scene: &Scene) -> Vec<String> {
        control_list(scene).into_iter().map(|c| c.name).collect()
    }

    #[test]
    fn prescribed_nodes_are_where_they_shall_be_at_the_end_of_the_step() {
        let motion = Motion::Sine { amplitude: [0.0, 0.0, 0.2], frequency: 0.5, phase: 0.3 };
        let hand = Gripper { clamp: Clamp::Nodes(vec![1, -1]), offset: [0.01, 0.0, 0.0], motion, ..Gripper::default() };
        let scene = scene(vec![hand]);
        assert_eq!(names(&scene)[..4], ["hand.node[1].x", "hand.node[1].y", "hand.node[1].z", "hand.node[4].x"]);
        let rows = control_rows(&scene, 3).unwrap();
        let lift = 0.2 * ((std::f64::consts::TAU * 0.5 * 0.2 + 0.3_f64).sin() - 0.3_f64.sin());
        assert_relative_eq!(rows[1][..], [0.24, 0.0, lift, 0.99, 0.0, lift], epsilon = 1e-14);
        assert_relative_eq!(resting_inputs(&scene).unwrap()[..], [0.24, 0.0, 0.0, 0.99, 0.0, 0.0]);
    }

    #[test]
    fn an_end_edge_has_position_and_axis() {
        let motion = Motion::Line { velocity: [0.0, 1.0, 0.0] };
        let hand = Gripper { clamp: Clamp::End(End::Last), motion, ..Gripper::default() };
        let scene = scene(vec![hand]);
        assert_eq!(names(&scene)[2..4], ["hand.position.z", "hand.axis.x"]);
        assert_relative_eq!(control_rows(&scene, 1).unwrap()[0][..], [1.0, 0.1, 0.0, -1.0, 0.0, 0.0]);
    }

    #[test]
    fn velocities_lead_to_the_same_positions() {
        let motion = Motion::Sine { amplitude: [0.1, 0.0, 0.0], frequency: 0.7, phase: 0.0 };
        let tug = Gripper { mode: Mode::Velocity, clamp: Clamp::End(End::First), motion: motion.clone(), ..Gripper::default() };
        let scene = scene(vec![tug]);
        assert_eq!(names(&scene)[3], "hand.angular_velocity.x");
        let travelled: f64 = control_rows(&scene, 7).unwrap().iter().map(|row| row[0] * 0.1).sum();
        assert_relative_eq!(travelled, displacement(&motion, 0.7)[0], epsilon = 1e-14);
    }
}
