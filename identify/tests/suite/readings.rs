//! Sensor readings of bodies, and their derivatives by all unknowns, against central differences.

use pliant_identify::log::Setup;
use pliant_identify::sensor::{BIAS, DELAY, DRIFT, GAIN, TIME_OFFSET};
use pliant_identify::shooting::{Plan, RecordPlan, ShotWants, shoot};
use pliant_identify::unknown::{Unknown, Values};
use pliant_scene::Source;
use std::fmt::Write;
use tempfile::TempDir;

/// A ball-jointed link with a servo-driven elbow beyond it, and a free body beside; everything that can be observed is.
const SCENE: &str = r#"schema_version = 1
[time]
step = 0.004
duration = 1.0
integrator = "midpoint"
[[body]]
name = "upper"
mass = 1.0
center_of_mass = [0.02, 0, -0.15]
inertia = [0.009, 0.008, 0.002, 0, 0, 0]
[[body.joint]]
name = "shoulder"
kind = "ball"
damping = 0.05
[[body]]
name = "lower"
parent = "upper"
position = [0, 0, -0.3]
mass = 0.5
center_of_mass = [0, 0, -0.1]
inertia = [0.003, 0.003, 0.001, 0, 0, 0]
[[body.joint]]
name = "elbow"
kind = "revolute"
axis = [0, 1, 0]
[[body]]
name = "stone"
position = [1, 0, 0.5]
mass = 0.2
inertia = [0.001, 0.002, 0.0015, 0, 0, 0]
[[body.joint]]
name = "flight"
kind = "free"
[[actuator]]
name = "servo"
joint = "elbow"
kind = "position"
stiffness = 3.0
damping = 0.1
[experiment]
time = { column = "t" }
lead_in = 0.05
sensor = { scale = 1.01, rotation = [0.1, -0.05, 0.2], bias = [0.01, 0, 0], time_offset = 0.0013 }
[[experiment.joint]]
joint = "elbow"
column = "q"
scale = 0.98
delay = 0.0021
[[experiment.joint]]
joint = "elbow"
measures = "velocity"
column = "v"
[[experiment.joint]]
joint = "elbow"
measures = "torque"
column = "tau"
[[experiment.marker]]
body = "lower"
point = [0, 0, -0.2]
columns = ["x", "y", "z"]
[[experiment.marker]]
body = "stone"
columns = ["x", "y", "z"]
[[experiment.orientation]]
body = "lower"
columns = ["qw", "qx", "qy", "qz"]
[[experiment.orientation]]
body = "stone"
columns = ["rx", "ry", "rz"]
[[experiment.input]]
actuator = "servo"
columns = ["u"]
[[experiment.record]]
file = "run.csv"
"#;

fn plan(folder: &TempDir) -> Plan {
    let mut log = "t,q,v,tau,x,y,z,qw,qx,qy,qz,rx,ry,rz,u\n".to_owned();
    for k in 0..12 {
        let t = 0.004 * f64::from(k) * 2.0;
        let (s, c) = (0.5 * (0.4 + t)).sin_cos();
        let _ = writeln!(
            log,
            "{t},{},0.5,0.1,{},0.1,-0.5,{c},0,{s},0,0.1,{},0.3,{}",
            0.3 + t,
            0.2 + t,
            0.2 + 0.5 * t,
            (9.0 * t).sin()
        );
    }
    std::fs::write(folder.path().join("run.csv"), log).unwrap();
    let source = Source { file: "scene.toml".to_owned(), text: SCENE.to_owned() };
    let setup = Setup::from_source(source, folder.path().to_owned()).unwrap();
    Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap()
}

fn unknowns(plan: &Plan) -> Vec<Unknown> {
    let theta = |path: &str| Unknown::of_theta(&plan.model, path, 1.0).unwrap();
    let any = (f64::NEG_INFINITY, f64::INFINITY);
    let joint = |k: usize, entry: usize| Unknown::of_joint(format!("joint {k}.{entry}"), "-", (k, entry), 1.0, any);
    let mut out: Vec<Unknown> =
        ["shoulder.damping", "servo.stiffness", "servo.offset", "lower.mass", "gravity.tilt[0]"].map(theta).into();
    out.extend([0, 3, 5, TIME_OFFSET].map(|entry| Unknown::of_sensor(entry, 1.0, any)));
    out.extend([(0, BIAS), (0, GAIN), (0, DELAY), (0, DRIFT), (1, DELAY), (2, GAIN)].map(|(k, entry)| joint(k, entry)));
    out
}

#[test]
fn derivatives_are_those_of_the_readings() {
    let folder = TempDir::new().unwrap();
    let plan = plan(&folder);
    let (mut rec, unknowns) = (plan.fitted[0].clone(), unknowns(&plan));
    rec.start.z.iter_mut().enumerate().for_each(|(k, z)| *z = 0.3 * (1.7 * k as f64).cos());
    let values = plan.scene_values.clone();
    let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
    let shot = shoot(&plan, &rec, &values, wants).unwrap();
    let residual = |rec: &RecordPlan, values: &Values| shoot(&plan, rec, values, ShotWants::default()).unwrap().residual;
    assert_eq!(plan.channels(), 3 + 6 + 6);
    assert_eq!(shot.residual.len(), 12 * plan.channels());
    let (k, m) = (unknowns.len(), shot.own_columns);
    assert_eq!(m, 2 * (3 + 1 + 6));
    // measured − simulated falls as the simulated reading rises
    let check = |name: &str, up: &[f64], down: &[f64], step: f64, slope: f64, column: &dyn Fn(usize) -> f64| {
        let size = (0..up.len()).map(|r| column(r).abs()).fold(1e-3, f64::max);
        for r in 0..up.len() {
            let difference = slope * (down[r] - up[r]) / (2.0 * step);
            assert!((difference - column(r)).abs() < 2e-4 * size, "{name}, row {r}: {difference} {}", column(r));
        }
    };
    for (j, unknown) in unknowns.iter().enumerate() {
        let (value, step) = (unknown.value(&values), 1e-5);
        let at = |x: f64| {
            let mut moved = values.clone();
            unknown.set(&mut moved, x);
            residual(&rec, &moved)
        };
        let (up, down) = (at(value + step), at(value - step));
        check(&unknown.path, &up, &down, step, unknown.slope(value), &|r| shot.global[r * k + j]);
    }
    for j in 0..m {
        let at = |d: f64| {
            let mut moved = rec.clone();
            moved.start.z[j] += d;
            residual(&moved, &values)
        };
        check(&format!("z[{j}]"), &at(1e-4), &at(-1e-4), 1e-4, 1.0, &|r| shot.own[r * m + j]);
    }
}

#[test]
fn the_start_agrees_with_what_is_read() {
    let folder = TempDir::new().unwrap();
    let plan = plan(&folder);
    let state = plan.fitted[0].start.state(&plan.model, &plan.scene_values.joints);
    let (n, tree) = (plan.model.n_node_dofs(), plan.model.tree());
    // the free body is seen by a marker and an orientation of its own
    let flight = tree.joint("flight.turn").unwrap();
    let turned = tree.joints()[flight].q + n;
    let measured = plan.fitted[0].record.orientations[0][1];
    let same: f64 = (0..4).map(|k| measured[k] * state.q[turned + k]).sum();
    assert!(same.abs() > 1.0 - 1e-4, "{:?} {measured:?}", &state.q[turned..turned + 4]);
    // 0.3 rad read at 98 % of the true angle
    let elbow = tree.joint("elbow").unwrap();
    assert!((state.q[n + tree.joints()[elbow].q] - 0.3 / 0.98).abs() < 0.02);
}
