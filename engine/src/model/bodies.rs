//! From a scene's bodies, joints and actuators to the tree and its forces.

use super::Model;
use crate::bodies::drag::{BodyDrag, DragArea, mean_area};
use crate::bodies::{self, Tree};
use crate::constraints::{JointFriction, JointRow, JointRowKind};
use crate::memory::SignalPath;
use crate::terms::joint::{
    AutomaticJoint, Cogging, CubicSpring, Damping, GravityCompensation, JointElement, JointLaw, PlasticSpring, PositionDrive,
    Presliding, QuadraticDamping, Spring, TorqueDrive, VelocityDrive,
};
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::inertia::{BodyInertia, to_numbers};
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE, Params};
use pliant_math::rotation::{matrix, normalized};
use pliant_scene::{Actuator, ActuatorKind, Body, Joint, JointKind, Scene};
use std::sync::Arc;

/// Elements of all joint laws, filled joint by joint.
#[derive(Default)]
struct Elements {
    spring: Vec<JointElement>,
    cubic: Vec<JointElement>,
    plastic: Vec<JointElement>,
    /// Gains of gravity compensation: degree of freedom and index in θ.
    compensated: Vec<(usize, usize)>,
    damping: Vec<JointElement>,
    quadratic_damping: Vec<JointElement>,
    cogging: Vec<JointElement>,
    presliding: Vec<JointElement>,
    torque: Vec<JointElement>,
    position: Vec<JointElement>,
    velocity: Vec<JointElement>,
}

impl Model {
    /// Adds everything the scene says of bodies, parents first; coordinates and velocities follow those of the nodes.
    pub(super) fn add_bodies(&mut self, scene: &Scene) {
        let mut elements = Elements::default();
        let (mut q, mut v) = (Vec::new(), Vec::new());
        for body in parents_first(&scene.body) {
            let parent = body.parent.as_deref().and_then(|name| self.tree.body(name));
            let free = body.joint.iter().any(|j| j.kind == JointKind::Free);
            let inertia = push_inertia(body, &mut self.params);
            let drag = inertia.and_then(|inertia| self.drag(body, inertia));
            self.body_drags.extend(drag);
            let first = self.tree.joints().len();
            let mut joints = Vec::new();
            for joint in &body.joint {
                let params = JointParams::push(joint, &mut self.params);
                let parts = elementary(joint, params.armature);
                let places: Vec<usize> = (0..parts.len()).map(|k| first + joints.len() + k).collect();
                if joint.plastic_time.is_some() {
                    self.list_plastic(joint, &params, &places, &mut elements);
                }
                list_elements(&params, &places, joint.plastic_time.is_some(), &mut elements);
                if let Some(gain) = joint.gravity_compensation {
                    let gain = self.params.push(format!("{}.gravity_compensation", joint.name), "-", ANY, gain);
                    elements.compensated.extend((0..joint.kind.n_dofs()).map(|k| (v.len() + k, gain)));
                }
                if let (Some(cogging), &[place]) = (&joint.cogging, &places[..]) {
                    let mut entry = |key, value| self.params.push(format!("{}.cogging_{key}", joint.name), "N·m", ANY, value);
                    let params = vec![entry("sine", cogging.sine), entry("cosine", cogging.cosine)];
                    let constants = vec![f64::from(cogging.cycles)];
                    elements.cogging.push(JointElement { joints: vec![place], params, constants, ..JointElement::default() });
                }
                self.list_presliding(joint, &places, &mut elements);
                self.list_rows(joint, parts.len(), [q.len(), v.len()]);
                q.extend(initial_coordinates(body, joint));
                let rest = vec![0.0; joint.kind.n_dofs()];
                v.extend(if joint.velocity.is_empty() { rest } else { joint.velocity.clone() });
                joints.extend(parts);
            }
            let rotation = if free { Matrix3::identity() } else { matrix(&normalized(&body.quaternion)) };
            let position = if free { Vec3::zeros() } else { Vec3::from(body.position) };
            self.tree.push(
                bodies::Body { name: body.name.clone(), parent, position, rotation, aligned: false, joints: 0..0, inertia },
                joints,
            );
        }
        self.q0.extend(q);
        self.v0.extend(v);
        for actuator in &scene.actuator {
            self.add_actuator(actuator, &mut elements);
        }
        self.add_joint_terms(elements);
    }

    /// What the air does to the body that comes next.
    fn drag(&mut self, body: &Body, inertia: BodyInertia) -> Option<BodyDrag> {
        let air = self.params.find("air.wind[0]")?;
        let area = match body.drag_area {
            Some(area) => DragArea::Theta(self.params.push(format!("{}.drag_area", body.name), "m²", POSITIVE, area)),
            None => DragArea::Constant(mean_area(body.mass, &pliant_scene::inertia_matrix(&body.inertia?))),
        };
        Some(BodyDrag { body: self.tree.bodies().len(), inertia, area, air })
    }

    /// Friction and stops of a joint of `parts` axes with this first coordinate and degree of freedom.
    fn list_rows(&mut self, joint: &Joint, parts: usize, [q, first]: [usize; 2]) {
        if joint.kind.n_dofs() > 2 {
            return;
        }
        let name = &joint.name;
        let linear = joint.kind == JointKind::Prismatic;
        let (torque, speed, place) = if linear { ("N", "m/s", "m") } else { ("N·m", "rad/s", "rad") };
        let coulomb = self.params.push(format!("{name}.friction"), torque, NON_NEGATIVE, joint.friction);
        let stiction = self.params.push(format!("{name}.stiction"), torque, NON_NEGATIVE, joint.stiction);
        let stribeck = self.params.push(format!("{name}.stribeck_velocity"), speed, POSITIVE, joint.stribeck_velocity);
        let mut own = |key: &str, unit, value: Option<f64>| {
            value.map(|value| self.params.push(format!("{name}.{key}"), unit, NON_NEGATIVE, value))
        };
        let backward = own("friction_backward", torque, joint.friction_backward).unwrap_or(coulomb);
        let part = own("load_friction", "-", joint.load_friction);
        let limits =
            joint.limits.map(|limits| [0, 1].map(|k| self.params.push(format!("{name}.limit[{k}]"), place, ANY, limits[k])));
        for k in 0..parts {
            let row = |kind| JointRow { dof: first + k, q: q + k, kind };
            let load = part.map(|part| {
                let suffix = if parts > 1 { format!("[{k}]") } else { String::new() };
                let place = self.memory.push(format!("{name}{suffix}.load"), 0.0);
                self.memory.loads.push((first + k, place));
                (part, place)
            });
            let friction = JointFriction { coulomb, backward, stiction, stribeck, load };
            self.joint_rows.push(row(JointRowKind::Friction(friction)));
            if let Some([low, high]) = limits {
                self.joint_rows.push(row(JointRowKind::Stop(low, 1.0)));
                self.joint_rows.push(row(JointRowKind::Stop(high, -1.0)));
            }
        }
    }

    /// The spring of a joint that creeps, and its place in z.
    fn list_plastic(&mut self, joint: &Joint, params: &JointParams, places: &[usize], out: &mut Elements) {
        let (Some(time), Some(p)) = (joint.plastic_time, &params.forces) else { return };
        let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
        let time = self.params.push(format!("{}.plastic_time", joint.name), "s", POSITIVE, time);
        let limit = joint.yield_at.map(|limit| self.params.push(format!("{}.yield", joint.name), unit, POSITIVE, limit));
        let numbers = joint.kind.n_dofs();
        let mut places_in_z = (0..numbers).map(|k| {
            let suffix = if numbers > 1 { format!("[{k}]") } else { String::new() };
            self.memory.push(format!("{}.plastic{suffix}", joint.name), joint.plastic_start.get(k).copied().unwrap_or(0.0))
        });
        for &place in places {
            out.plastic.push(JointElement {
                joints: vec![place],
                controls: Vec::new(),
                params: [p.stiffness, p.cubic, time].into_iter().chain(limit).chain(p.rest).collect(),
                constants: vec![if limit.is_some() { 1.0 } else { 0.0 }],
                memory: places_in_z.by_ref().take(numbers / places.len()).collect(),
            });
        }
    }

    /// Friction that builds up along the way of each of a joint's axes, and its places in z.
    fn list_presliding(&mut self, joint: &Joint, places: &[usize], out: &mut Elements) {
        let Some(presliding) = joint.presliding else { return };
        let (force, way) = if joint.kind == JointKind::Prismatic { ("N", "m") } else { ("N·m", "rad") };
        let friction = self.params.push(format!("{}.presliding_friction", joint.name), force, NON_NEGATIVE, presliding.friction);
        let distance = self.params.push(format!("{}.presliding_distance", joint.name), way, POSITIVE, presliding.distance);
        for (k, &place) in places.iter().enumerate() {
            let suffix = if places.len() > 1 { format!("[{k}]") } else { String::new() };
            let memory = vec![self.memory.push(format!("{}.presliding{suffix}", joint.name), 0.0)];
            out.presliding.push(JointElement {
                joints: vec![place],
                params: vec![friction, distance],
                memory,
                ..JointElement::default()
            });
        }
    }

    fn add_actuator(&mut self, actuator: &Actuator, elements: &mut Elements) {
        let Some(joint) = self.tree.joint(&actuator.joint) else { return };
        let control = self.nu();
        let linear = self.tree.joints()[joint].kind == bodies::JointKind::Prismatic;
        let unit = |turning, sliding| if linear { sliding } else { turning };
        let (force, stiffness, damping) = (unit("N·m", "N"), unit("N·m/rad", "N/m"), unit("N·m·s/rad", "N·s/m"));
        let mut entry =
            |name: &str, unit, bounds, value| self.params.push(format!("{}.{name}", actuator.name), unit, bounds, value);
        let mut params = match actuator.kind {
            ActuatorKind::Torque => vec![entry("gain", force, ANY, actuator.gain)],
            ActuatorKind::Position => vec![
                entry("stiffness", stiffness, NON_NEGATIVE, actuator.stiffness),
                entry("damping", damping, NON_NEGATIVE, actuator.damping),
            ],
            ActuatorKind::Velocity => vec![entry("damping", damping, NON_NEGATIVE, actuator.damping)],
        };
        params.push(entry("offset", force, ANY, actuator.offset));
        params.push(entry("gear", "-", ANY, actuator.gear));
        if let Some(limits) = actuator.saturation {
            params.extend([0, 1].map(|k| entry(&format!("saturation[{k}]"), force, ANY, limits[k])));
        }
        let scale = actuator.delta_scale.map(|scale| entry("delta_scale", unit("rad", "m"), ANY, scale));
        let delay = actuator.delay.zip(actuator.longest_delay());
        let delay = delay.map(|(delay, longest)| (entry("delay", "s", (0.0, longest), delay), longest));
        let lag = actuator.lag.map(|lag| entry("lag", "s", NON_NEGATIVE, lag));
        if scale.is_some() || delay.is_some() || lag.is_some() {
            let at_joint = actuator.gear * self.q0[self.n_node_dofs() + self.tree.joints()[joint].q];
            let start = actuator.start.unwrap_or(if actuator.kind == ActuatorKind::Position { at_joint } else { 0.0 });
            self.memory.paths.push(SignalPath { name: actuator.name.clone(), control, scale, delay, lag, start });
        }
        let list = match actuator.kind {
            ActuatorKind::Torque => &mut elements.torque,
            ActuatorKind::Position => &mut elements.position,
            ActuatorKind::Velocity => &mut elements.velocity,
        };
        list.push(JointElement { joints: vec![joint], controls: vec![control], params, ..JointElement::default() });
        self.n_actuators += 1;
    }

    fn add_joint_terms(&mut self, e: Elements) {
        self.add_joint_law(Spring, e.spring);
        self.add_joint_law(CubicSpring, e.cubic);
        self.add_joint_law(PlasticSpring, e.plastic);
        self.add_joint_law(Damping, e.damping);
        self.add_joint_law(QuadraticDamping, e.quadratic_damping);
        self.add_joint_law(Cogging, e.cogging);
        self.add_joint_law(Presliding, e.presliding);
        self.add_joint_law(TorqueDrive, e.torque);
        self.add_joint_law(PositionDrive, e.position);
        self.add_joint_law(VelocityDrive, e.velocity);
        if !e.compensated.is_empty() {
            let theta = self.params.values();
            let (inertias, gravity) = (self.inertias(theta), self.gravity_vector(theta));
            self.joint_terms.push(Arc::new(GravityCompensation { gains: e.compensated, inertias, gravity }));
        }
    }

    pub(super) fn add_joint_law<L: JointLaw + 'static>(&mut self, law: L, elements: Vec<JointElement>) {
        if !elements.is_empty() {
            self.joint_terms.push(Arc::new(AutomaticJoint::new(law, elements)));
        }
    }
}

/// Bodies in the scene's order, but none before its parent.
fn parents_first(bodies: &[Body]) -> Vec<&Body> {
    let mut out: Vec<&Body> = Vec::new();
    while out.len() < bodies.len() {
        let before = out.len();
        for body in bodies {
            let placed = |name: &str| out.iter().any(|b| b.name == name);
            if !placed(&body.name) && body.parent.as_deref().is_none_or(placed) {
                out.push(body);
            }
        }
        if out.len() == before {
            break; // a circle, which the scene's check refuses
        }
    }
    out
}

fn push_inertia(body: &Body, params: &mut Params) -> Option<BodyInertia> {
    let about_centre = pliant_scene::inertia_matrix(&body.inertia?);
    let x = to_numbers(body.mass, Vec3::from(body.center_of_mass), &about_centre).ok()?;
    let name = &body.name;
    let first = params.push(format!("{name}.mass"), "kg", POSITIVE, x[0]);
    for k in 0..3 {
        params.push(format!("{name}.center_of_mass[{k}]"), "m", ANY, x[1 + k]);
    }
    for k in 0..6 {
        params.push(format!("{name}.spread[{k}]"), "m", if k < 3 { POSITIVE } else { ANY }, x[4 + k]);
    }
    Some(BodyInertia { first })
}

/// Indices in θ of a joint's numbers; a free joint has an armature alone.
struct JointParams {
    armature: usize,
    forces: Option<ForceParams>,
}

struct ForceParams {
    damping: usize,
    quadratic_damping: usize,
    stiffness: usize,
    cubic: usize,
    rest: Option<usize>,
}

impl JointParams {
    fn push(joint: &Joint, params: &mut Params) -> Self {
        let linear = joint.kind == JointKind::Prismatic;
        let unit = |turning, sliding| if linear { sliding } else { turning };
        let mut entry = |name: &str, unit, bounds, value| params.push(format!("{}.{name}", joint.name), unit, bounds, value);
        let armature = entry("armature", unit("kg·m²", "kg"), NON_NEGATIVE, joint.armature);
        if joint.kind == JointKind::Free {
            return Self { armature, forces: None };
        }
        let damping = entry("damping", unit("N·m·s/rad", "N·s/m"), NON_NEGATIVE, joint.damping);
        let quadratic_damping = entry("quadratic_damping", unit("N·m·s²/rad²", "N·s²/m²"), NON_NEGATIVE, joint.quadratic_damping);
        let stiffness = entry("stiffness", unit("N·m/rad", "N/m"), NON_NEGATIVE, joint.stiffness);
        let cubic = entry("cubic_stiffness", unit("N·m/rad³", "N/m³"), ANY, joint.cubic_stiffness);
        let rest = (joint.kind.n_dofs() <= 2).then(|| entry("rest", unit("rad", "m"), ANY, joint.rest));
        Self { armature, forces: Some(ForceParams { damping, quadratic_damping, stiffness, cubic, rest }) }
    }
}

/// A joint as joints of one axis or a ball.
fn elementary(joint: &Joint, armature: usize) -> Vec<bodies::Joint> {
    let part = |suffix: &str, kind, axis: [f64; 3]| bodies::Joint {
        name: format!("{}{suffix}", joint.name),
        kind,
        body: 0,
        axis: Vec3::from(axis).normalize(),
        anchor: Vec3::from(joint.anchor),
        q: 0,
        v: 0,
        armature,
    };
    use bodies::JointKind::{Ball, Prismatic, Revolute};
    let unit = |k: usize| std::array::from_fn(|a| if a == k { 1.0 } else { 0.0 });
    match joint.kind {
        JointKind::Revolute => vec![part("", Revolute, joint.axis)],
        JointKind::Prismatic => vec![part("", Prismatic, joint.axis)],
        JointKind::Universal => {
            vec![part("[0]", Revolute, joint.axis), part("[1]", Revolute, joint.second_axis.unwrap_or(joint.axis))]
        }
        JointKind::Ball => vec![part("", Ball, unit(2))],
        JointKind::Free => {
            let mut parts: Vec<_> =
                ["x", "y", "z"].iter().enumerate().map(|(k, n)| part(&format!(".{n}"), Prismatic, unit(k))).collect();
            parts.push(bodies::Joint { anchor: Vec3::zeros(), ..part(".turn", Ball, unit(2)) });
            parts
        }
    }
}

/// Springs and dampers of a joint, dampers alone if it creeps. Those of zero stiffness are listed too: a fit may free them.
fn list_elements(joints: &JointParams, places: &[usize], creeps: bool, out: &mut Elements) {
    let Some(p) = &joints.forces else { return };
    for &place in places {
        let with = |first: usize| {
            let params = std::iter::once(first).chain(p.rest).collect();
            JointElement { joints: vec![place], params, ..JointElement::default() }
        };
        if !creeps {
            out.spring.push(with(p.stiffness));
            out.cubic.push(with(p.cubic));
        }
        for (list, k) in [(&mut out.damping, p.damping), (&mut out.quadratic_damping, p.quadratic_damping)] {
            list.push(JointElement { joints: vec![place], params: vec![k], ..JointElement::default() });
        }
    }
}

fn initial_coordinates(body: &Body, joint: &Joint) -> Vec<f64> {
    match joint.kind {
        JointKind::Ball => vec![1.0, 0.0, 0.0, 0.0],
        JointKind::Free => body.position.into_iter().chain(normalized(&body.quaternion)).collect(),
        _ if joint.start.is_empty() => vec![0.0; joint.kind.n_start()],
        _ => joint.start.clone(),
    }
}

/// The joint of that name in a scene maps to elementary joints of these names.
pub(crate) fn is_part(elementary: &str, joint: &str) -> bool {
    elementary.strip_prefix(joint).is_some_and(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
}

impl Tree {
    /// Elementary joints that make up the joint of that name in the scene.
    pub fn joint_parts<'a>(&'a self, name: &'a str) -> impl Iterator<Item = usize> + 'a {
        self.joints().iter().enumerate().filter(move |(_, j)| is_part(&j.name, name)).map(|(k, _)| k)
    }
}
