//! What is hidden in a rod between two grippers is named, and readings know everything that grippers and sections hide.
#![allow(clippy::unwrap_used)]

use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::scene::{Source, parse_scene};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_identify::log::Setup;
use pliant_identify::shoot::{Plan, ShotWants, shoot};
use pliant_identify::unknown::Unknown;
use pliant_identify::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use std::fmt::Write;
use std::sync::Arc;
use tempfile::TempDir;

const NODES: usize = 9;
const RATE: f64 = 100.0;
const SAMPLES: usize = 120;
/// Standard deviation of the markers [m].
const NOISE: f64 = 3e-4;
/// Steps of the truth per sample.
const FINE: usize = 8;

/// A rod that hangs between two pairs of nodes; `step` in seconds, `more` in its `[rope.twist]`.
fn rod(step: f64, integrator: &str, more: &str) -> String {
    format!(
        r#"schema_version = 1
[time]
step = {step}
duration = 1.2
integrator = "{integrator}"
[[rope]]
name = "rod"
nodes = {NODES}
length = 0.6
linear_density = 0.03
stretch_stiffness = 300.0
stretch_damping = 0.3
bend_stiffness = 1e-3
bend_damping = 3e-5
initial = {{ shape = "between", from = [0, 0, 0], to = [0.45, 0, 0.05] }}
[rope.twist]
stiffness = 1e-3
damping = 3e-5
inertia = 4e-7
{more}
[[gripper]]
name = "left"
rope = "rod"
nodes = [0, 1]
[[gripper]]
name = "right"
rope = "rod"
nodes = [{}, {}]
"#,
        NODES - 2,
        NODES - 1
    )
}

fn model(scene: &str) -> Arc<Model> {
    Arc::new(ModelBuilder::new(&parse_scene::<()>(scene, "scene.toml").unwrap()).unwrap().build())
}

/// Where the grippers have their nodes at a time: as the scene begins, then swinging and turning, otherwise in every record.
fn held(model: &Model, record: usize, t: f64) -> Vec<f64> {
    let q = model.initial_positions();
    let k = record as f64;
    let wave = |amplitude: f64, frequency: f64, phase: f64| amplitude * ((frequency * t + phase).sin() - phase.sin());
    let mut out = Vec::new();
    for (side, [end, next]) in [[0, 1], [NODES - 1, NODES - 2]].into_iter().enumerate() {
        let s = side as f64;
        let by = [wave(0.06, 5.0 + k, s), wave(0.08, 4.0 + 0.7 * k, 1.0 + k + s), wave(0.05, 6.0, 2.0 * s + k)];
        let at = |node: usize| [0, 1, 2].map(|a| q[3 * node + a]);
        let (end, next) = (at(end), at(next));
        // the edge turns about the vertical
        let (sin, cos) = wave(0.5, 4.0 + s, k).sin_cos();
        let d = [next[0] - end[0], next[1] - end[1], next[2] - end[2]];
        let turned = [d[0] * cos - d[1] * sin, d[0] * sin + d[1] * cos, d[2]];
        let moved = [0, 1, 2].map(|a| end[a] + by[a]);
        let other = [0, 1, 2].map(|a| moved[a] + turned[a]);
        // controls of a gripper are in the order of its nodes
        let pair = if side == 0 { [moved, other] } else { [other, moved] };
        out.extend(pair.concat());
    }
    out
}

/// Logs of a rod that has `more`, by smaller steps of another integrator, and the setup of one that has not.
fn setup(folder: &TempDir, more: &str) -> Setup {
    let truth = model(&rod(1.0 / RATE / FINE as f64, "sdirk2", more));
    let mut noise = gaussians();
    for record in 0..4 {
        let mut stepper = Stepper::new(&truth, truth.params().values(), StepOptions::default()).unwrap();
        let rest = equilibrium(&truth, truth.params().values(), truth.initial_positions(), &held(&truth, record, 0.0)).unwrap();
        let (mut x, mut log) = (rest.state(), header());
        for sample in 0..=SAMPLES {
            let t = sample as f64 / RATE;
            let markers = (2..NODES - 2).flat_map(|node| [0, 1, 2].map(|a| x.q[3 * node + a]));
            let row: Vec<String> =
                markers.map(|p| p + NOISE * noise()).chain(held(&truth, record, t)).map(|x| format!("{x:.7}")).collect();
            writeln!(log, "{t},{}", row.join(",")).unwrap();
            for k in 1..=FINE {
                // the log is interpolated linearly, and so is what moves the truth
                let part = k as f64 / FINE as f64;
                let (a, b) = (held(&truth, record, t), held(&truth, record, t + 1.0 / RATE));
                let u: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + part * (b - a)).collect();
                stepper.step(&mut x, &u).unwrap();
            }
        }
        std::fs::write(folder.path().join(format!("run{record}.csv")), log).unwrap();
    }
    Setup::from_source(Source::new("scene.toml", &(rod(0.25 / RATE, "midpoint", "") + &experiment())), folder.path().to_owned())
        .unwrap()
}

fn columns(node: usize) -> String {
    ["x", "y", "z"].map(|axis| format!("n{node}{axis}")).join(",")
}

fn header() -> String {
    let nodes = (2..NODES - 2).chain([0, 1, NODES - 2, NODES - 1]);
    format!("t,{}\n", nodes.map(columns).collect::<Vec<_>>().join(","))
}

fn experiment() -> String {
    let quoted = |nodes: &[usize]| {
        let names: Vec<String> = nodes.iter().flat_map(|n| ["x", "y", "z"].map(|axis| format!("\"n{n}{axis}\""))).collect();
        names.join(", ")
    };
    let mut out = "[experiment]\ntime = { column = \"t\" }\nlead_in = 0.1\ninitial = \"rest\"\n".to_owned();
    for node in 2..NODES - 2 {
        let _ = writeln!(out, "[[experiment.marker]]\nrope = \"rod\"\nnode = {node}\ncolumns = [{}]", quoted(&[node]));
    }
    for (gripper, nodes) in [("left", [0, 1]), ("right", [NODES - 2, NODES - 1])] {
        let _ = writeln!(out, "[[experiment.input]]\ngripper = \"{gripper}\"\ncolumns = [{}]", quoted(&nodes));
    }
    for record in 0..4 {
        let role = if record == 3 { "held_out" } else { "fit" };
        let _ = writeln!(out, "[[experiment.record]]\nfile = \"run{record}.csv\"\nrole = \"{role}\"");
    }
    out + "[experiment.fit]\nfree = [{ path = \"rod.bend_stiffness\", lower = 1e-5, upper = 1e-1 }]\n"
}

/// Standard normal numbers from a fixed seed (sums of twelve uniform ones).
fn gaussians() -> impl FnMut() -> f64 {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

fn diagnosed(more: &str) -> Diagnosis {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, more);
    let logs = setup.read_logs(&[]).unwrap();
    diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| {}).unwrap()
}

#[test]
fn nothing_is_claimed_where_nothing_is_hidden() {
    let d = diagnosed("");
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.reason);
    assert!(d.causes.is_empty());
}

#[test]
fn curvature_by_nature_is_named_with_its_size() {
    let d = diagnosed("rest_curvature = [0.9, -0.6]");
    assert_eq!(d.verdict, Verdict::Named, "{}", d.reason);
    let titles: Vec<String> = d.causes.iter().map(|c| c.title()).collect();
    assert_eq!(titles, ["intrinsic_curvature"], "{}", d.reason);
    for (estimate, truth) in d.causes[0].parameters.iter().zip([0.9, -0.6]) {
        assert!((estimate.estimate - truth).abs() < 0.05, "{estimate:?}");
    }
    let whole = d.gain.last().unwrap();
    assert!(whole.rmse_after < 0.5 * whole.rmse_before, "{whole:?}");
}

/// Of records that begin as the data have them, with twist nobody sees.
#[test]
fn readings_know_what_grippers_and_sections_hide() {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, "");
    let text = setup.source.text.replace("initial = \"rest\"", "initial = \"given\"");
    let setup = Setup::from_source(Source::new("scene.toml", &text), folder.path().to_owned()).unwrap();
    let plan = Plan::opened(&setup, &setup.read_logs(&[]).unwrap()).unwrap();
    let paths = [
        "rod.rest_curvature[0]",
        "rod.rest_curvature[1]",
        "rod.rest_twist",
        "rod.node[3].rest_curvature[0]",
        "rod.node[4].bend_factor",
        "rod.twist_stiffness",
        "rod.creep_fraction",
        "left.offset[1]",
        "right.roll",
        "left.roll_by_direction[1]",
        "right.roll_by_position[0]",
    ];
    let unknowns: Vec<Unknown> = paths.iter().map(|path| Unknown::of_theta(&plan.model, path, 1.0).unwrap()).collect();
    let mut values = plan.scene_values.clone();
    for (u, x) in unknowns.iter().zip([0.4, -0.3, 0.5, 0.2, 0.9, 8e-4, 0.2, 2e-3, 0.3, 0.4, -0.5]) {
        u.set(&mut values, x);
    }
    let rec = &plan.fitted[1];
    let wants = ShotWants { unknowns: &unknowns, tangents: true, until: Some(0.15), states: false };
    let shot = shoot(&plan, rec, &values, wants).unwrap();
    for (j, unknown) in unknowns.iter().enumerate() {
        let slope = unknown.slope(unknown.value(&values));
        let at = |by: f64| {
            let mut moved = values.clone();
            unknown.set(&mut moved, unknown.value(&values) + by);
            shoot(&plan, rec, &moved, ShotWants { until: Some(0.15), ..ShotWants::default() }).unwrap().predicted
        };
        let e = 1e-5 * unknown.scale.min(1.0);
        let (up, down) = (at(e), at(-e));
        let columns = unknowns.len();
        let size = (0..up.len()).map(|r| shot.global[r * columns + j].abs()).fold(0.0, f64::max);
        assert!(size > 0.0, "{}", unknown.path);
        for r in 0..up.len() {
            let difference = (up[r] - down[r]) / (2.0 * e) * slope;
            assert!(
                (shot.global[r * columns + j] - difference).abs() < 2e-5 * size,
                "{} {r}: {}",
                unknown.path,
                difference / size
            );
        }
    }
}
