//! Things that stand and lie on the rims of cylinders, between the points of any polygon.

use crate::common::Case;
use pliant_engine::step::StepOptions;

/// A free body of 1 kg with one shape of uniform density.
fn body(name: &str, shape: &str, inertia: [f64; 3], position: [f64; 3], quaternion: [f64; 4]) -> String {
    format!(
        "[[body]]\nname = \"{name}\"\nposition = {position:?}\nquaternion = {quaternion:?}\nmass = 1.0\n\
         inertia = [{}, {}, {}, 0, 0, 0]\n[[body.joint]]\nname = \"{name}_free\"\nkind = \"free\"\n[[body.shape]]\n{shape}\n",
        inertia[0], inertia[1], inertia[2]
    )
}

fn cylinder(radius: f64, half_length: f64) -> (String, [f64; 3]) {
    let across = radius * radius / 4.0 + half_length * half_length / 3.0;
    let shape = format!("kind = \"cylinder\"\nradius = {radius}\nhalf_length = {half_length}");
    (shape, [across, across, radius * radius / 2.0])
}

const UPRIGHT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];
const LYING: [f64; 4] = [std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0];

/// A second of a scene with a cylinder of radius 34 mm and half length 40 mm standing on the floor and something let down on it by 1 mm:
/// it may never be lower than `height` above the cylinder's end \[m\], and in the end it is there.
fn rests(what: &str, step: f64, upper: &str, height: f64) {
    let (shape, inertia) = cylinder(0.034, 0.04);
    let scene = format!(
        "schema_version = 1\n[time]\nstep = {step}\nduration = 1.0\nintegrator = \"euler\"\n\
         [[plane]]\nname = \"floor\"\nfriction = 0.4\n{}{upper}",
        body("low", &shape, inertia, [0.0, 0.0, 0.041], UPRIGHT)
    );
    let scene = pliant_scene::parse_scene(&scene, "rims.toml").unwrap();
    let steps = (1.0 / step).round() as usize;
    let roll = Case::new(&scene, steps).run(StepOptions { record: false, ..StepOptions::default() });
    let above = |x: &pliant_math::State| x.q[9] - x.q[2] - 0.04 - height;
    let lowest = roll.states.iter().map(above).fold(f64::INFINITY, f64::min);
    let last = &roll.states[steps];
    let speed = last.v.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    assert!(lowest > -1e-6, "{what}, h = {step}: {lowest:e} m lower than it can be");
    // gaps of some 1e-8 m tilt the end by 1e-6 rad, down which round things roll
    assert!(above(last).abs() < 1e-6 && speed < 1e-5, "{what}, h = {step}: {:e} m high, {speed:e} m/s", above(last));
    let energy = roll.energy();
    let most = energy.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(most <= energy[0] * (1.0 + 1e-9), "{what}, h = {step}: {} J, then {most} J", energy[0]);
}

/// The box's corners lie beyond the rim, and its edges cross the circle between any eight points.
#[test]
fn a_box_wider_than_the_circle_stands_on_a_cylinder() {
    let (a, c) = (0.026_f64, 0.04_f64);
    let inertia = [(a * a + c * c) / 3.0, (a * a + c * c) / 3.0, 2.0 * a * a / 3.0];
    for step in [0.004, 0.002, 0.001] {
        for angle in [0.0_f64, 0.2] {
            let turned = [(angle / 2.0).cos(), 0.0, 0.0, (angle / 2.0).sin()];
            let upper = body("high", "kind = \"box\"\nhalf_extents = [0.026, 0.026, 0.04]", inertia, [0.002, 0.0, 0.123], turned);
            rests("a box", step, &upper, 0.04);
        }
    }
}

#[test]
fn a_capsule_lies_across_a_rim() {
    for step in [0.004, 0.001] {
        let shape = "kind = \"capsule\"\nradius = 0.01\nhalf_length = 0.06";
        let upper = body("high", shape, [1.3e-3, 1.3e-3, 5e-5], [0.021, 0.003, 0.093], LYING);
        rests("a capsule", step, &upper, 0.01);
    }
}

#[test]
fn a_cylinder_lies_across_a_rim() {
    for step in [0.004, 0.001] {
        let (shape, inertia) = cylinder(0.012, 0.06);
        let upper = body("high", &shape, inertia, [0.021, 0.003, 0.095], LYING);
        rests("a lying cylinder", step, &upper, 0.012);
    }
}

/// Their ends overlap in a lens.
#[test]
fn a_cylinder_stands_beside_the_middle_of_another() {
    for step in [0.004, 0.002, 0.001] {
        let (shape, inertia) = cylinder(0.034, 0.04);
        let upper = body("high", &shape, inertia, [0.012, 0.005, 0.123], UPRIGHT);
        rests("a standing cylinder", step, &upper, 0.04);
    }
}
