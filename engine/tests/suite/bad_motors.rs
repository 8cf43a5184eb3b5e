//! Motors and joint laws that make no sense are refused with line, field, cause and fix.

use pliant_scene::{Nothing, parse_scene};

const GOOD: &str = r#"schema_version = 1
[time]
step = 0.01
integrator = "euler"
[[body]]
name = "arm"
mass = 1.0
inertia = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
[[body.joint]]
name = "shoulder"
kind = "revolute"
stiffness = 2.0
plastic_time = 0.5
yield = 0.1
plastic_start = [0.2]
friction_backward = 0.1
load_friction = 0.2
gravity_compensation = 1.0
cogging = { cycles = 6, sine = 0.1 }
[[actuator]]
name = "servo"
joint = "shoulder"
kind = "position"
stiffness = 20.0
delta_scale = 0.1
delay = 0.02
max_delay = 0.05
lag = 0.01
saturation = [-2.0, 2.0]
"#;

/// Refuses the good scene with one text replaced, at this place, with each of these parts in the message.
#[track_caller]
fn refused(old: &str, new: &str, place: &str, parts: &[&str]) {
    crate::common::refused(GOOD, (old, new), place, parts);
}

#[test]
fn the_good_scene_is_accepted() {
    let scene = parse_scene::<Nothing>(GOOD, "scene.toml").unwrap();
    assert_eq!(scene.body[0].joint[0].yield_at, Some(0.1));
}

#[test]
fn motors() {
    refused("delay = 0.02", "delay = -0.02", "26: actuator[0].delay", &["-0.02 s", "must not be negative"]);
    refused("lag = 0.01", "lag = -0.01", "28: actuator[0].lag", &["-0.01 s", "must not be negative"]);
    refused("delay = 0.02", "delay = 20.0", "26: actuator[0].delay", &["20 s", "ms", "0.02"]);
    refused(
        "delay = 0.02",
        "delay = 0.2",
        "26: actuator[0].delay",
        &["0.2 s is longer than `max_delay`, 0.05 s", "max_delay = 0.2"],
    );
    refused("max_delay = 0.05", "max_delay = 0", "27: actuator[0].max_delay", &["must be positive"]);
    refused("\ndelay = 0.02", "", "20: actuator[0]", &["key `delay` is missing"]);
    refused("[-2.0, 2.0]", "[2.0, -2.0]", "29: actuator[0].saturation", &["2 is not below", "-2", "exchanged"]);
    refused("[-2.0, 2.0]", "[-2.0]", "29: actuator[0].saturation", &["1 entries instead of 2"]);
    refused("\"position\"", "\"torque\"", "25: actuator[0].delta_scale", &["only a position drive has a target"]);
    refused("joint = \"shoulder\"", "joint = \"sholder\"", "22: actuator[0].joint", &["no joint \"sholder\"", "\"shoulder\""]);
    refused("lag = 0.01", "lag = \"10 ms\"", "28: actuator[0].lag", &["write 0.01 (in s, without quotes)"]);
}

#[test]
fn joints() {
    refused("plastic_time = 0.5", "plastic_time = -0.5", "13: body[0].joint[0].plastic_time", &["-0.5 s", "must be positive"]);
    refused("\nplastic_time = 0.5", "", "9: body[0].joint[0]", &["key `plastic_time` is missing"]);
    refused("stiffness = 2.0\n", "\n", "13: body[0].joint[0].plastic_time", &["no spring"]);
    refused("yield = 0.1", "yield = 0.0", "14: body[0].joint[0].yield", &["must be positive"]);
    refused("[0.2]", "[0.2, 0.1]", "15: body[0].joint[0].plastic_start", &["2 entries instead of 1"]);
    refused("friction_backward = 0.1", "friction_backward = -1", "16: body[0].joint[0].friction_backward", &["-1 N·m"]);
    refused("load_friction = 0.2", "load_friction = -1", "17: body[0].joint[0].load_friction", &["-1 -", "negative"]);
    refused("plastic_time = 0.5", "plastic_tim = 0.5", "13: body[0].joint[0].plastic_tim", &["did you mean `plastic_time`?"]);
    let more = |line: &str| format!("{line}\ncogging = {{");
    let builds_up =
        |friction: &str, distance: &str| more(&format!("presliding = {{ friction = {friction}, distance = {distance} }}"));
    refused("cogging = {", &builds_up("-0.1", "0.01"), "19: body[0].joint[0].presliding.friction", &["-0.1 N·m", "negative"]);
    refused("cogging = {", &builds_up("0.1", "0.0"), "19: body[0].joint[0].presliding.distance", &["must be positive"]);
    refused("cogging = {", &more("presliding = { friction = 0.1 }"), "19: body[0].joint[0].presliding", &["distance"]);
    let at = "19: body[0].joint[0].quadratic_damping";
    refused("cogging = {", &more("quadratic_damping = -0.1"), at, &["-0.1 N·m·s²/rad²", "must not be negative"]);
    refused("cogging = {", &more("quadratic_damping = \"0.1\""), at, &["write 0.1 (in N·m·s²/rad², without quotes)"]);
    let at = "19: body[0].joint[0].quadratic_dampin";
    refused("cogging = {", &more("quadratic_dampin = 0.1"), at, &["did you mean `quadratic_damping`?"]);
    let at = "19: body[0].joint[0].cogging";
    refused(
        "cycles = 6",
        "cycles = 1",
        &format!("{at}.cycles"),
        &["repeats 1 time(s) per turn", "poles and slots", "center_of_mass"],
    );
    refused("cycles = 6", "cycles = -6", &format!("{at}.cycles"), &["-6"]);
    refused("cycles = 6", "cycles = 6.5", &format!("{at}.cycles"), &["6.5"]);
    refused("cycles = 6, ", "", at, &["key `cycles` is missing"]);
    refused("sine = 0.1", "sin = 0.1", &format!("{at}.sin"), &["did you mean `sine`?"]);
    let slide = "\"prismatic\"";
    refused("\"revolute\"", slide, at, &["revolute joint only"]);
    let ball = "\"ball\"\ndamping = 0.1\n#";
    refused(
        "\"revolute\"\nstiffness = 2.0",
        &format!("{ball}\nstiffness = 2.0"),
        "17: body[0].joint[0].plastic_start",
        &["instead of 3"],
    );
}
