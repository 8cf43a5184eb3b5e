//! A scene of bodies as a TOML file: values that differ from the defaults, numbers in full.

use super::{
    Actuator, ActuatorKind, Air, Body, BodyShape, Closure, ClosureKind, Cloth, Command, Contact, ContactRule, Coupling, Diagonal,
    Integrator, Joint, JointKind, Law, Scene, ShapeKind, Start, Touching,
};
use std::fmt::Write;

/// The file of a scene that was made, by an importer or a builder, with `comment` as its first line. What only people write (ropes,
/// grippers, forces of their own, solver settings, `experiment`) is left out.
pub fn to_toml(scene: &Scene, comment: &str) -> String {
    let mut out = format!("# {}\nschema_version = {}\n\n[time]\n", comment.replace(char::is_control, " "), scene.schema_version);
    line(&mut out, "step", &number(scene.time.step));
    line(&mut out, "duration", &number(scene.time.duration));
    let integrator = match scene.time.integrator {
        Integrator::Euler => "euler",
        Integrator::Midpoint => "midpoint",
        Integrator::Sdirk2 => "sdirk2",
        Integrator::QuasiStatic => "quasi_static",
    };
    line(&mut out, "integrator", &quoted(integrator));
    out += "\n[gravity]\n";
    line(&mut out, "magnitude", &number(scene.gravity.magnitude));
    list(&mut out, "tilt", &scene.gravity.tilt, &[0.0; 2]);
    air(&mut out, &scene.air);
    contact(&mut out, &scene.contact);
    scene.cloth.iter().for_each(|c| cloth(&mut out, c));
    scene.body.iter().for_each(|b| body(&mut out, b));
    scene.closure.iter().for_each(|c| closure(&mut out, c));
    scene.coupling.iter().for_each(|c| coupling(&mut out, c));
    fixed(&mut out, scene);
    scene.actuator.iter().for_each(|a| actuator(&mut out, a));
    scene.contact.pair.iter().for_each(|r| rule(&mut out, r));
    out
}

fn air(out: &mut String, air: &Air) {
    if *air == Air::default() {
        return;
    }
    *out += "\n[air]\n";
    list(out, "wind", &air.wind, &[0.0; 3]);
    differing(out, "density", air.density, 0.0);
    differing(out, "viscosity", air.viscosity, 0.0);
}

/// The law; its rules follow as tables of their own.
fn contact(out: &mut String, contact: &Contact) {
    let default = Contact::default();
    if contact.law == default.law && contact.rest_gap == default.rest_gap {
        return;
    }
    *out += "\n[contact]\n";
    if contact.law == Law::Anitescu {
        line(out, "law", &quoted("anitescu"));
    }
    differing(out, "rest_gap", contact.rest_gap, default.rest_gap);
}

fn cloth(out: &mut String, cloth: &Cloth) {
    *out += "\n[[cloth]]\n";
    line(out, "name", &quoted(&cloth.name));
    if let Some(grid) = &cloth.grid {
        let ([nu, nv], [u, v]) = (grid.nodes, grid.size.map(number));
        let diagonal = match grid.diagonal {
            Diagonal::Up => "up",
            Diagonal::Down => "down",
            Diagonal::Alternating => "alternating",
        };
        line(out, "grid", &format!("{{ nodes = [{nu}, {nv}], size = [{u}, {v}], diagonal = {} }}", quoted(diagonal)));
    }
    if let Some(mesh) = &cloth.mesh {
        line(out, "mesh", &format!("'{mesh}'"));
    }
    list(out, "origin", &cloth.origin, &[0.0; 3]);
    list(out, "u_axis", cloth.u_axis.as_ref().map_or(&[], |x| x), &[]);
    list(out, "v_axis", cloth.v_axis.as_ref().map_or(&[], |x| x), &[]);
    points(out, cloth.points.as_deref());
    if cloth.start == Start::Equilibrium {
        line(out, "start", &quoted("equilibrium"));
    }
    list(out, "velocity", &cloth.velocity, &[0.0; 3]);
    line(out, "thickness", &number(cloth.thickness));
    given(out, "density", cloth.density);
    given(out, "area_density", cloth.area_density);
    line(out, "youngs_modulus", &number(cloth.youngs_modulus));
    line(out, "poisson_ratio", &number(cloth.poisson_ratio));
    given(out, "bend_stiffness", cloth.bend_stiffness);
    differing(out, "membrane_damping", cloth.membrane_damping, 0.0);
    differing(out, "bend_damping", cloth.bend_damping, 0.0);
    differing(out, "drag_normal", cloth.drag_normal, 0.0);
    differing(out, "drag_quadratic", cloth.drag_quadratic, 0.0);
    given(out, "radius", cloth.radius);
    if cloth.contact == Touching::Edges {
        line(out, "contact", &quoted("edges"));
    }
}

fn closure(out: &mut String, closure: &Closure) {
    *out += "\n[[closure]]\n";
    line(out, "name", &quoted(&closure.name));
    line(out, "kind", &quoted(if closure.kind == ClosureKind::Weld { "weld" } else { "connect" }));
    line(out, "body", &quoted(&closure.body));
    if let Some(to) = &closure.to {
        line(out, "to", &quoted(to));
    }
    list(out, "point", &closure.point, &[0.0; 3]);
    list(out, "to_point", closure.to_point.as_ref().map_or(&[], |x| x), &[]);
    given(out, "compliance", closure.compliance);
}

fn coupling(out: &mut String, coupling: &Coupling) {
    *out += "\n[[coupling]]\n";
    line(out, "name", &quoted(&coupling.name));
    line(out, "joint", &quoted(&coupling.joint));
    if let Some(to) = &coupling.to {
        line(out, "to", &quoted(to));
    }
    list(out, "coefficients", &coupling.coefficients, &[]);
    differing(out, "reference", coupling.reference, 0.0);
    given(out, "compliance", coupling.compliance);
}

fn body(out: &mut String, body: &Body) {
    let default = Body::default();
    *out += "\n[[body]]\n";
    line(out, "name", &quoted(&body.name));
    if let Some(parent) = &body.parent {
        line(out, "parent", &quoted(parent));
    }
    list(out, "position", &body.position, &default.position);
    list(out, "quaternion", &body.quaternion, &default.quaternion);
    differing(out, "mass", body.mass, default.mass);
    list(out, "center_of_mass", &body.center_of_mass, &default.center_of_mass);
    if let Some(inertia) = &body.inertia {
        list(out, "inertia", inertia, &[]);
    }
    given(out, "drag_area", body.drag_area);
    body.joint.iter().for_each(|j| joint(out, j));
    body.shape.iter().for_each(|s| shape(out, s));
}

fn shape(out: &mut String, shape: &BodyShape) {
    *out += "\n[[body.shape]]\n";
    let kind = match shape.kind {
        ShapeKind::Sphere => "sphere",
        ShapeKind::Capsule => "capsule",
        ShapeKind::Cylinder => "cylinder",
        ShapeKind::Box => "box",
        ShapeKind::Hull => "hull",
    };
    line(out, "kind", &quoted(kind));
    list(out, "position", &shape.position, &[0.0; 3]);
    list(out, "quaternion", &shape.quaternion, &[1.0, 0.0, 0.0, 0.0]);
    given(out, "radius", shape.radius);
    given(out, "half_length", shape.half_length);
    list(out, "half_extents", shape.half_extents.as_ref().map_or(&[], |x| x), &[]);
    points(out, shape.points.as_deref());
    given(out, "friction", shape.friction);
}

/// Fixed shapes.
fn fixed(out: &mut String, scene: &Scene) {
    let open = |out: &mut String, kind: &str, name: &str| {
        let _ = write!(out, "\n[[{kind}]]\n");
        line(out, "name", &quoted(name));
    };
    for s in &scene.plane {
        open(out, "plane", &s.name);
        list(out, "point", &s.point, &[0.0; 3]);
        list(out, "normal", &s.normal, &[0.0, 0.0, 1.0]);
        differing(out, "height", s.height, 0.0);
        line(out, "friction", &number(s.friction));
    }
    for s in &scene.sphere {
        open(out, "sphere", &s.name);
        list(out, "center", &s.center, &[]);
        line(out, "radius", &number(s.radius));
        line(out, "friction", &number(s.friction));
    }
    for s in &scene.capsule {
        open(out, "capsule", &s.name);
        list(out, "a", &s.a, &[]);
        list(out, "b", &s.b, &[]);
        line(out, "radius", &number(s.radius));
        line(out, "friction", &number(s.friction));
    }
    for s in &scene.block {
        open(out, "box", &s.name);
        list(out, "position", &s.position, &[0.0; 3]);
        list(out, "quaternion", &s.quaternion, &[1.0, 0.0, 0.0, 0.0]);
        list(out, "half_extents", &s.half_extents, &[]);
        line(out, "friction", &number(s.friction));
    }
    for s in &scene.cylinder {
        open(out, "cylinder", &s.name);
        list(out, "position", &s.position, &[0.0; 3]);
        list(out, "quaternion", &s.quaternion, &[1.0, 0.0, 0.0, 0.0]);
        line(out, "radius", &number(s.radius));
        line(out, "half_length", &number(s.half_length));
        line(out, "friction", &number(s.friction));
    }
}

fn rule(out: &mut String, rule: &ContactRule) {
    *out += "\n[[contact.pair]]\n";
    line(out, "between", &format!("[{}, {}]", quoted(&rule.between[0]), quoted(&rule.between[1])));
    if rule.ignore {
        line(out, "ignore", "true");
    }
    given(out, "friction", rule.friction);
    given(out, "compliance", rule.compliance);
}

fn joint(out: &mut String, joint: &Joint) {
    let default = Joint::default();
    *out += "\n[[body.joint]]\n";
    line(out, "name", &quoted(&joint.name));
    let (kind, has_axis) = match joint.kind {
        JointKind::Revolute => ("revolute", true),
        JointKind::Prismatic => ("prismatic", true),
        JointKind::Universal => ("universal", true),
        JointKind::Ball => ("ball", false),
        JointKind::Free => ("free", false),
    };
    line(out, "kind", &quoted(kind));
    if has_axis {
        list(out, "axis", &joint.axis, &default.axis);
    }
    if let Some(second) = &joint.second_axis {
        list(out, "second_axis", second, &[]);
    }
    list(out, "anchor", &joint.anchor, &default.anchor);
    differing(out, "armature", joint.armature, default.armature);
    differing(out, "damping", joint.damping, default.damping);
    differing(out, "quadratic_damping", joint.quadratic_damping, default.quadratic_damping);
    differing(out, "stiffness", joint.stiffness, default.stiffness);
    differing(out, "cubic_stiffness", joint.cubic_stiffness, default.cubic_stiffness);
    differing(out, "rest", joint.rest, default.rest);
    given(out, "plastic_time", joint.plastic_time);
    given(out, "yield", joint.yield_at);
    list(out, "plastic_start", &joint.plastic_start, &[]);
    given(out, "gravity_compensation", joint.gravity_compensation);
    if let Some(c) = &joint.cogging {
        let (sine, cosine) = (number(c.sine), number(c.cosine));
        line(out, "cogging", &format!("{{ cycles = {}, sine = {sine}, cosine = {cosine} }}", c.cycles));
    }
    differing(out, "friction", joint.friction, default.friction);
    given(out, "friction_backward", joint.friction_backward);
    given(out, "load_friction", joint.load_friction);
    differing(out, "stiction", joint.stiction, default.stiction);
    differing(out, "stribeck_velocity", joint.stribeck_velocity, default.stribeck_velocity);
    if let Some(p) = &joint.presliding {
        line(out, "presliding", &format!("{{ friction = {}, distance = {} }}", number(p.friction), number(p.distance)));
    }
    list(out, "limits", joint.limits.as_ref().map_or(&[], |limits| limits), &[]);
    list(out, "start", &joint.start, &[]);
    list(out, "velocity", &joint.velocity, &[]);
}

fn actuator(out: &mut String, actuator: &Actuator) {
    let default = Actuator::default();
    *out += "\n[[actuator]]\n";
    line(out, "name", &quoted(&actuator.name));
    line(out, "joint", &quoted(&actuator.joint));
    let kind = match actuator.kind {
        ActuatorKind::Torque => "torque",
        ActuatorKind::Position => "position",
        ActuatorKind::Velocity => "velocity",
    };
    line(out, "kind", &quoted(kind));
    differing(out, "gain", actuator.gain, default.gain);
    differing(out, "stiffness", actuator.stiffness, default.stiffness);
    differing(out, "damping", actuator.damping, default.damping);
    differing(out, "offset", actuator.offset, default.offset);
    differing(out, "gear", actuator.gear, default.gear);
    given(out, "delta_scale", actuator.delta_scale);
    given(out, "delay", actuator.delay);
    given(out, "max_delay", actuator.max_delay);
    given(out, "lag", actuator.lag);
    list(out, "saturation", actuator.saturation.as_ref().map_or(&[], |x| x), &[]);
    given(out, "start", actuator.start);
    let command = match &actuator.command {
        Command::Hold { value: 0.0 } => return,
        Command::Hold { value } => format!("{{ kind = \"hold\", value = {} }}", number(*value)),
        Command::Sine { mean, amplitude, frequency, phase } => {
            let [mean, amplitude, frequency, phase] = [mean, amplitude, frequency, phase].map(|x| number(*x));
            format!("{{ kind = \"sine\", mean = {mean}, amplitude = {amplitude}, frequency = {frequency}, phase = {phase} }}")
        }
    };
    line(out, "command", &command);
}

fn line(out: &mut String, key: &str, value: &str) {
    let _ = writeln!(out, "{key} = {value}");
}

fn given(out: &mut String, key: &str, value: Option<f64>) {
    if let Some(value) = value {
        line(out, key, &number(value));
    }
}

fn differing(out: &mut String, key: &str, value: f64, default: f64) {
    if value != default {
        line(out, key, &number(value));
    }
}

fn list(out: &mut String, key: &str, values: &[f64], default: &[f64]) {
    if !values.is_empty() && values != default {
        let numbers: Vec<String> = values.iter().map(|x| number(*x)).collect();
        line(out, key, &format!("[{}]", numbers.join(", ")));
    }
}

fn points(out: &mut String, points: Option<&[[f64; 3]]>) {
    if let Some(points) = points {
        let point = |x: &[f64; 3]| format!("[{}]", x.map(number).join(", "));
        line(out, "points", &format!("[{}]", points.iter().map(point).collect::<Vec<_>>().join(", ")));
    }
}

/// With as few digits as read back as the same number.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// Names have no characters that would have to be escaped.
fn quoted(text: &str) -> String {
    format!("\"{text}\"")
}
