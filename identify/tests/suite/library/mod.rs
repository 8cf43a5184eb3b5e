//! Every cause of the library on its own: derivatives of its readings, found where it is there, not taken for its nearest imitation.
//!
//! One row per cause says in which scene it is tested, the size it has there, and which other row imitates it best. Logs are simulated
//! with that size and noise; the scene lacks it. All is judged by the scores, with the levels of a diagnosis and without a refit.

mod bench;

use bench::{Bench, Made, Truth, predicted};
use pliant_identify::causes::{Cause, LIBRARY, Situation, library};
use pliant_identify::diagnose::{Scores, score_scene};
use pliant_identify::shooting::{Plan, ShotWants, shoot};
use pliant_identify::unknown::Unknown;
use std::collections::BTreeMap;

/// A cause in a scene.
struct Row {
    /// Title of the cause: its name, and its object in brackets.
    title: &'static str,
    /// Sizes that the logs have and the scene lacks.
    truth: Truth<'static>,
    /// Row of the same scene whose effect is most like this one.
    imitation: &'static str,
    /// Causes that the naming rule leaves beside it, because no log of these sensors tells them apart.
    equivalents: &'static [&'static str],
}

const fn row(title: &'static str, truth: Truth<'static>, imitation: &'static str) -> Row {
    Row { title, truth, imitation, equivalents: &[] }
}

impl Row {
    /// With its equivalents.
    const fn beside(self, equivalents: &'static [&'static str]) -> Self {
        Self { equivalents, ..self }
    }
}

const ARM: &[Row] = &[
    row("viscous_friction (shoulder)", &[("shoulder.damping", 0.03)], "joint_plasticity (elbow)"),
    row("quadratic_damping (shoulder)", &[("shoulder.quadratic_damping", 0.01)], "viscous_friction (shoulder)"),
    row("joint_stiffness (shoulder)", &[("shoulder.stiffness", 0.05)], "cubic_stiffness (shoulder)"),
    row("cubic_stiffness (shoulder)", &[("shoulder.cubic_stiffness", 0.05)], "joint_stiffness (shoulder)"),
    row("joint_plasticity (elbow)", &[("elbow.plastic_time", 4.0), ("elbow.yield", 0.05)], "viscous_friction (shoulder)"),
    row(
        "cogging_torque (shoulder)",
        &[("shoulder.cogging_sine", 0.03), ("shoulder.cogging_cosine", 0.02)],
        "cubic_stiffness (shoulder)",
    ),
    row("own_force (seal)", &[("seal.c", 0.06)], "viscous_friction (shoulder)"),
    row("payload (lower)", &[("lower.mass", 0.63)], "link_inertia (lower)"),
    row("link_mass (upper)", &[("upper.mass", 0.63)], "payload (lower)"),
    row("link_inertia (lower)", &[("lower.spread[2]", 0.085)], "armature (elbow)"),
    row("center_of_mass (lower)", &[("lower.center_of_mass[0]", 0.025), ("lower.center_of_mass[2]", -0.155)], "payload (lower)"),
    row("armature (elbow)", &[("elbow.armature", 1e-3)], "link_inertia (lower)"),
    row("torque_gain (motor_shoulder)", &[("motor_shoulder.gain", 1.03)], "saturation (motor_shoulder)"),
    row("torque_offset (motor_shoulder)", &[("motor_shoulder.offset", 0.03)], "joint_stiffness (shoulder)"),
    row("actuator_delay (motor_elbow)", &[("motor_elbow.delay", 0.004)], "actuator_lag (motor_elbow)")
        .beside(&["actuator_lag (motor_elbow)"]),
    row("actuator_lag (motor_elbow)", &[("motor_elbow.lag", 0.02)], "actuator_delay (motor_elbow)"),
    row(
        "saturation (motor_shoulder)",
        &[("motor_shoulder.saturation[0]", -1.6), ("motor_shoulder.saturation[1]", 1.6)],
        "torque_gain (motor_shoulder)",
    ),
    row("encoder_scale (shoulder)", &[("shoulder.position_scale", 1.01)], "torque_gain (motor_shoulder)"),
    row("encoder_drift (shoulder)", &[("shoulder.position_drift", 0.01)], "encoder_scale (shoulder)"),
    row("sensor_delay (elbow)", &[("elbow.position_delay", 0.003)], "actuator_delay (motor_elbow)"),
];

const DRIVES: &[Row] = &[
    row("drive_stiffness (motor_shoulder)", &[("motor_shoulder.stiffness", 20.4)], "armature (shoulder)"),
    row("drive_damping (motor_elbow)", &[("motor_elbow.damping", 0.31)], "viscous_friction (elbow)"),
    row("armature (shoulder)", &[("shoulder.armature", 1e-3)], "drive_stiffness (motor_shoulder)"),
    row("viscous_friction (shoulder)", &[("shoulder.damping", 0.04)], "drive_stiffness (motor_shoulder)"),
    row("viscous_friction (elbow)", &[("elbow.damping", 0.02)], "drive_damping (motor_elbow)"),
];

/// The shoulder has dry friction, in the scene as well.
const FRICTION: &[Row] = &[
    row("viscous_friction (shoulder)", &[("shoulder.damping", 0.03)], "coulomb_friction (shoulder)"),
    row(
        "coulomb_friction (shoulder)",
        &[("shoulder.friction", 0.045), ("shoulder.friction_backward", 0.045)],
        "viscous_friction (shoulder)",
    ),
    row(
        "stribeck (shoulder)",
        &[("shoulder.stiction", 0.06), ("shoulder.stribeck_velocity", 1.5)],
        "coulomb_friction (shoulder)",
    ),
    row("asymmetric_friction (shoulder)", &[("shoulder.friction_backward", 0.06)], "torque_offset (motor_shoulder)"),
    row(
        "cogging_torque (shoulder)",
        &[("shoulder.cogging_sine", 0.03), ("shoulder.cogging_cosine", 0.02)],
        "coulomb_friction (shoulder)",
    ),
    row("load_friction (shoulder)", &[("shoulder.load_friction", 0.05)], "coulomb_friction (shoulder)"),
    row("torque_offset (motor_shoulder)", &[("motor_shoulder.offset", 0.03)], "asymmetric_friction (shoulder)"),
];

const SLIDER: &[Row] = &[
    row("ground_height (floor)", &[("floor.height", 0.0006)], "encoder_bias (z)").beside(&["encoder_bias (z)"]),
    row("contact_friction (floor)", &[("floor.friction", 0.205)], "encoder_scale (x)").beside(&["encoder_scale (x)"]),
    row("encoder_bias (z)", &[("z.position_bias", 0.0006)], "ground_height (floor)"),
    row("encoder_scale (x)", &[("x.position_scale", 1.02)], "contact_friction (floor)"),
];

const TOSS: &[Row] = &[
    row("gravity_magnitude", &[("gravity.magnitude", 9.9)], "length_scale").beside(&["length_scale"]),
    row("length_scale", &[("sensor.scale", 1.01)], "gravity_magnitude"),
    row("linear_drag", &[("air.viscosity", 0.05)], "quadratic_drag"),
    row("quadratic_drag", &[("air.density", 6.0)], "linear_drag"),
];

/// In thick air, which the scene has as well.
const BLOWN: &[Row] = &[
    row("wind", &[("air.wind[0]", 0.5), ("air.wind[1]", -0.5), ("air.wind[2]", 0.3)], "gravity_tilt"),
    row("gravity_tilt", &[("gravity.tilt[0]", 0.02), ("gravity.tilt[1]", -0.02)], "wind"),
];

const ROPE: &[Row] = &[
    row("linear_drag", &[("cable.drag_linear", 0.03)], "quadratic_drag"),
    row("quadratic_drag", &[("cable.drag_quadratic", 0.03)], "linear_drag"),
    row("wind", &[("air.wind[0]", 0.1), ("air.wind[1]", -0.1), ("air.wind[2]", 0.05)], "gravity_tilt"),
    row("gravity_tilt", &[("gravity.tilt[0]", 0.01), ("gravity.tilt[1]", -0.01)], "frame_rotation"),
    row("extensibility", &[("cable.stretch_stiffness", 50.0)], "length_scale"),
    row("internal_damping", &[("cable.bend_damping", 1e-4)], "linear_drag"),
    row("tip_mass", &[("cable.tip_mass", 1e-3)], "extensibility"),
    row("own_force (draft)", &[("draft.a", 0.01), ("draft.b", -0.006)], "wind"),
    row("gripper_offset (hand)", &[("hand.offset[0]", 2e-3), ("hand.offset[1]", -2e-3), ("hand.offset[2]", 2e-3)], "sensor_bias")
        .beside(&["sensor_bias"]),
    row("sensor_bias", &[("sensor.bias[0]", 2e-3), ("sensor.bias[1]", -1e-3), ("sensor.bias[2]", 1e-3)], "gripper_offset (hand)")
        .beside(&["gripper_offset (hand)"]),
    row(
        "frame_rotation",
        &[("sensor.rotation[0]", 0.01), ("sensor.rotation[1]", -0.01), ("sensor.rotation[2]", 0.01)],
        "gravity_tilt",
    ),
    row("length_scale", &[("sensor.scale", 1.01)], "extensibility"),
    row("time_offset", &[("sensor.time_offset", 0.004)], "linear_drag"),
];

const SHEET: &[Row] = &[
    row("linear_drag", &[("sheet.drag_normal", 0.15)], "quadratic_drag"),
    row("quadratic_drag", &[("sheet.drag_quadratic", 0.15)], "linear_drag"),
    row("wind", &[("air.wind[0]", 0.1), ("air.wind[1]", -0.1), ("air.wind[2]", 0.05)], "gravity_tilt"),
    row("gravity_tilt", &[("gravity.tilt[0]", 0.01), ("gravity.tilt[1]", -0.01)], "frame_rotation"),
    row("gravity_magnitude", &[("gravity.magnitude", 9.9)], "cloth_mass"),
    row("extensibility", &[("sheet.youngs_modulus", 4.5e4)], "length_scale"),
    row("internal_damping", &[("sheet.bend_damping", 2e-5)], "linear_drag"),
    row("membrane_damping", &[("sheet.membrane_damping", 30.0)], "linear_drag"),
    row("cloth_mass", &[("sheet.area_density", 0.206)], "gravity_magnitude"),
    row("own_force (draft)", &[("draft.a", 0.05), ("draft.b", -0.03)], "wind"),
    row("gripper_offset (hand)", &[("hand.offset[0]", 2e-3), ("hand.offset[1]", -2e-3), ("hand.offset[2]", 2e-3)], "sensor_bias")
        .beside(&["sensor_bias"]),
    row("sensor_bias", &[("sensor.bias[0]", 2e-3), ("sensor.bias[1]", -1e-3), ("sensor.bias[2]", 1e-3)], "gripper_offset (hand)")
        .beside(&["gripper_offset (hand)"]),
    row(
        "frame_rotation",
        &[("sensor.rotation[0]", 0.01), ("sensor.rotation[1]", -0.01), ("sensor.rotation[2]", 0.01)],
        "gravity_tilt",
    ),
    row("length_scale", &[("sensor.scale", 1.01)], "extensibility"),
    row("time_offset", &[("sensor.time_offset", 0.004)], "linear_drag"),
];

const ROD: &[Row] = &[
    row("intrinsic_curvature", &[("cable.rest_curvature[0]", 1.1), ("cable.rest_curvature[1]", -0.8)], "marker_offset"),
    row("intrinsic_twist", &[("cable.rest_twist", 0.5)], "clamp_roll (right)").beside(&["clamp_roll (right)"]),
    row("uneven_stiffness", &[("cable.node[2].bend_factor", 0.9), ("cable.node[5].bend_factor", 1.1)], "bend_stiffening"),
    row("anisotropic_bending", &[("cable.bend_stiffness_2", 1.2e-3)], "twist_stiffness"),
    row("twist_stiffness", &[("cable.twist_stiffness", 7e-4)], "anisotropic_bending"),
    row("bend_stiffening", &[("cable.stiffening", 3e-3)], "uneven_stiffness"),
    row("clamp_roll (right)", &[("right.roll", 0.3)], "intrinsic_twist"),
    row(
        "clamp_roll_by_direction (left)",
        &[("left.roll_by_direction[0]", 0.5), ("left.roll_by_direction[1]", 0.6), ("left.roll_by_direction[2]", 0.5)],
        "clamp_roll_by_position (left)",
    ),
    row(
        "clamp_roll_by_position (left)",
        &[("left.roll_by_position[0]", 1.0), ("left.roll_by_position[1]", 1.5), ("left.roll_by_position[2]", 1.0)],
        "clamp_roll_by_direction (left)",
    ),
    row(
        "mass_distribution",
        &[("cable.node[2].mass", 2e-4), ("cable.node[3].mass", 5e-4), ("cable.node[4].mass", 1e-4), ("cable.node[5].mass", 3e-4)],
        "edge_lengths",
    ),
    row("edge_lengths", &[("cable.edge[2].rest_strain", 0.01), ("cable.edge[4].rest_strain", -0.01)], "mass_distribution"),
    row(
        "marker_offset",
        &[("marker[0].offset[0]", 2e-3), ("marker[1].offset[1]", -2e-3), ("marker[2].offset[0]", 3e-3)],
        "intrinsic_curvature",
    ),
    row("rod_creep", &[("cable.creep_fraction", 0.3), ("cable.creep_time", 0.5)], "rod_plasticity"),
    row("rod_plasticity", &[("cable.plastic_time", 1.0), ("cable.yield_curvature", 0.5)], "bend_friction"),
    row("bend_friction", &[("cable.friction_moment", 5e-4), ("cable.friction_curvature", 0.5)], "rod_creep"),
];

/// The even part of the curvature is declared free: `uneven_curvature` is tested beside it.
const CURVED: &[Row] = &[
    row(
        "uneven_curvature",
        &[("cable.node[2].rest_curvature[0]", 1.3), ("cable.node[5].rest_curvature[1]", -0.2)],
        "uneven_stiffness",
    ),
    row("uneven_stiffness", &[("cable.node[2].bend_factor", 0.9), ("cable.node[5].bend_factor", 1.1)], "uneven_curvature"),
];

/// Seed of the noise.
const SEED: u64 = 7;

/// All rows, by scene.
const TABLES: [&[Row]; 10] = [ARM, DRIVES, FRICTION, SLIDER, TOSS, BLOWN, ROPE, SHEET, ROD, CURVED];

fn name(title: &str) -> &str {
    title.split(" (").next().unwrap_or(title)
}

#[test]
fn every_cause_of_the_library_has_a_row() {
    let rows: Vec<&Row> = TABLES.iter().copied().flatten().collect();
    for cause in LIBRARY {
        assert!(rows.iter().any(|row| name(row.title) == cause.name), "{} has no row", cause.name);
    }
    for row in rows {
        assert!(LIBRARY.iter().any(|cause| name(row.title) == cause.name), "{} is no cause", row.title);
    }
}

/// Level of a diagnosis.
const LEVEL: f64 = 0.05;
/// Largest error of a derivative over the largest derivative by the cause's coordinates.
const TOLERANCE: f64 = 1e-3;

/// Tests the rows of a scene: derivatives; each cause is significant and left by the naming rule in its own logs, beside those that no log
/// tells from it; and it is not named in the logs of its imitation.
fn check(bench: &Bench, rows: &[Row]) {
    let scored = |row: &Row| {
        let made = bench.made(row.truth, SEED);
        let error = derivative_error(bench, &made, row);
        assert!(error < TOLERANCE, "{}: the derivative is off by {error:e} of its size", row.title);
        (row.title, score_scene(&made.setup, &made.logs, 0).unwrap())
    };
    let found: BTreeMap<&str, Scores> = rows.iter().map(scored).collect();
    for row in rows {
        let (own, leading) = (&found[row.title], found[row.title].leading());
        let p = own.p_value(row.title).unwrap_or_else(|| panic!("{} was not tested", row.title));
        assert!(p <= LEVEL, "{} is not significant: p = {p}", row.title);
        for title in std::iter::once(&row.title).chain(row.equivalents) {
            assert!(leading.iter().any(|l| l == title), "{}: {title} is not among {leading:?}", row.title);
        }
        assert_ne!(found[row.imitation].leading(), [row.title.to_owned()], "in logs of {}", row.imitation);
    }
}

/// The cause of this row as the scene stands.
fn cause(plan: &Plan, row: &Row) -> Cause {
    let at = Situation { plan, values: &plan.scene_values, free: &[], together: true };
    library(&at).into_iter().find(|cause| cause.title() == row.title).unwrap_or_else(|| panic!("{} is not there", row.title))
}

/// Largest difference between the derivatives of the readings by the coordinates of the cause's unknowns, at its true size, and central
/// differences, over the largest derivative.
fn derivative_error(bench: &Bench, made: &Made, row: &Row) -> f64 {
    let (plan, rec, values) = (&made.plan, &made.plan.fitted[1], &made.values);
    let unknowns = cause(plan, row).unknowns;
    let shot =
        shoot(plan, rec, values, ShotWants { unknowns: &unknowns, tangents: true, until: bench.smooth, ..ShotWants::default() })
            .unwrap();
    let size = shot.global.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let at = |unknown: &Unknown, change: f64| {
        let mut moved = values.clone();
        unknown.set(&mut moved, unknown.moved(unknown.value(values), change));
        predicted(plan, rec, &moved, bench.smooth)
    };
    // central differences, extrapolated from a change and half of it: a logarithm's error of second order is as large as what is looked for
    let difference = |unknown: &Unknown, change: f64| -> Vec<f64> {
        let (up, down) = (at(unknown, change), at(unknown, -change));
        up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * change)).collect()
    };
    let error = |(j, unknown): (usize, &Unknown)| {
        let [whole, half] = [bench.change, 0.5 * bench.change].map(|change| difference(unknown, change));
        let column = shot.global.iter().skip(j).step_by(unknowns.len());
        let off = column.zip(whole.iter().zip(&half)).map(|(d, (whole, half))| (d - (4.0 * half - whole) / 3.0).abs());
        off.fold(0.0, f64::max)
    };
    unknowns.iter().enumerate().map(error).fold(0.0, f64::max) / size
}

#[test]
fn causes_of_an_arm() {
    check(&bench::arm(0.0), ARM);
}

/// The damping of a position drive is the friction of its joint, and is no cause of its own.
#[test]
fn causes_of_drives() {
    let bench = bench::driven();
    check(&bench, DRIVES);
    let made = bench.made(&[], SEED);
    let at = Situation { plan: &made.plan, values: &made.values, free: &[], together: true };
    let gains = library(&at).into_iter().filter(|cause| cause.name.starts_with("drive_"));
    assert_eq!(
        gains.map(|cause| cause.title()).collect::<Vec<_>>(),
        ["drive_stiffness (motor_shoulder)", "drive_damping (motor_elbow)"]
    );
}

#[test]
fn causes_of_friction() {
    check(&bench::arm(0.03), FRICTION);
}

#[test]
fn causes_of_a_contact() {
    check(&bench::slider(), SLIDER);
}

/// Of a body that turns freely the ratios of its inertia are seen, and no common factor: it moves all three logarithms alike.
#[test]
fn a_common_factor_of_a_free_bodys_inertia_is_not_seen() {
    let (bench, row) = (bench::toss(0.0), &row("link_inertia (cube)", &[("cube.spread[1]", 0.027)], "gravity_tilt"));
    let made = bench.made(row.truth, SEED);
    let unknowns = cause(&made.plan, row).unknowns;
    let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
    let shot = shoot(&made.plan, &made.plan.fitted[1], &made.values, wants).unwrap();
    let size = shot.global.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let common = shot.global.chunks_exact(3).map(|row| row.iter().sum::<f64>().abs()).fold(0.0, f64::max);
    assert!(size > 0.0 && common < 1e-8 * size, "{common} {size}");
}

#[test]
fn causes_of_a_tossed_body() {
    check(&bench::toss(0.0), TOSS);
    check(&bench::toss(6.0), BLOWN);
}

/// Drag on bodies is a cause where a sensor of positions watches them, and wind only where the scene has drag: with a small drag that was
/// found a strong wind is any constant force. Encoders of an arm see nothing of the air that is not damping of its joints.
#[test]
fn the_air_is_asked_for_where_positions_are_watched() {
    let asked = |bench: &Bench, found: &[(&str, f64)]| -> Vec<&'static str> {
        let made = bench.made(found, SEED);
        let at = Situation { plan: &made.plan, values: &made.values, free: &[], together: true };
        let of_air = ["linear_drag", "quadratic_drag", "wind"];
        let tested = library(&at).into_iter().filter(|cause| of_air.contains(&cause.name) && !cause.unknowns.is_empty());
        tested.map(|cause| cause.name).collect()
    };
    assert_eq!(asked(&bench::toss(0.0), &[("air.density", 0.1)]), ["linear_drag", "quadratic_drag"]);
    assert_eq!(asked(&bench::toss(6.0), &[]), ["linear_drag", "quadratic_drag", "wind"]);
    assert_eq!(asked(&bench::arm(0.0), &[]), [""; 0]);
}

#[test]
fn causes_of_a_rope() {
    check(&bench::rope(), ROPE);
}

#[test]
fn causes_of_a_sheet() {
    check(&bench::sheet(), SHEET);
}

#[test]
fn causes_of_a_rod() {
    check(&bench::rod(&[]), ROD);
}

/// What a gripper cannot do is no explanation: a gust on an edge that hardly turned was told as a roll of −622 rad.
#[test]
fn rolls_of_grippers_have_a_physical_size() {
    let made = bench::rod(&[]).made(&[], SEED);
    for row in ROD.iter().filter(|row| row.title.starts_with("clamp_roll_by")) {
        for unknown in cause(&made.plan, row).unknowns {
            assert_eq!(unknown.bounds, (-std::f64::consts::TAU, std::f64::consts::TAU), "{}", unknown.path);
        }
    }
}

#[test]
fn causes_of_a_rod_whose_curvature_is_fitted() {
    check(&bench::rod(&["cable.rest_curvature[0]", "cable.rest_curvature[1]"]), CURVED);
}
