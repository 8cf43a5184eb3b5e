//! Logs of a rod that twists, held by two grippers that swing.

use nalgebra::Vector3;
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_identify::log::Setup;
use pliant_scene::{Nothing, Source, parse_scene};
use std::fmt::Write;
use std::sync::Arc;
use tempfile::TempDir;

pub const NODES: usize = 9;
const RATE: f64 = 100.0;
/// Steps of the truth per sample.
const FINE: usize = 8;

/// A rod that hangs between two pairs of nodes; `step` in seconds, further keys of its tables as in [`Logged`].
fn rod(step: f64, integrator: &str, [rope, more, hand]: [&str; 3]) -> String {
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
{rope}
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
{hand}
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
    Arc::new(ModelBuilder::new(&parse_scene::<Nothing>(scene, "scene.toml").unwrap()).unwrap().build())
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

/// The logged run.
pub struct Logged<'a> {
    /// Further keys of the true rod's `[[rope]]`.
    pub rope: &'a str,
    /// Of its `[rope.twist]`, and tables behind it.
    pub more: &'a str,
    /// Of its left `[[gripper]]`.
    pub hand: &'a str,
    /// Whether the scene has `more` too, so that it is not hidden.
    pub known: bool,
    /// Numbers of records to be fitted and held out.
    pub records: [usize; 2],
    /// Samples of a record.
    pub samples: usize,
    /// Standard deviation of the markers [m].
    pub noise: f64,
    /// Offset of all markers from the centreline along the two material axes [m].
    pub offset: [f64; 2],
    /// Amplitude of a smooth drift of every marker that every record has of its own, at 0.3 to 1.5 Hz [m].
    pub drift: f64,
}

impl Default for Logged<'_> {
    fn default() -> Self {
        Self {
            rope: "",
            more: "",
            hand: "",
            known: false,
            records: [3, 1],
            samples: 120,
            noise: 3e-4,
            offset: [0.0; 2],
            drift: 0.0,
        }
    }
}

/// Logs of a rod, by smaller steps of another integrator, and the setup of one that has nothing hidden in it.
pub fn setup(folder: &TempDir, logged: &Logged) -> Setup {
    let truth = model(&rod(1.0 / RATE / FINE as f64, "sdirk2", [logged.rope, logged.more, logged.hand]));
    let mut noise = gaussians();
    let mut drifting = gaussians();
    for record in 0..logged.records[0] + logged.records[1] {
        let waves: Vec<[f64; 2]> = (0..3 * NODES).map(|_| [0.9 + 0.2 * drifting().clamp(-3.0, 3.0), drifting()]).collect();
        let mut stepper = Stepper::new(&truth, truth.params().values(), StepOptions::default()).unwrap();
        let rest = equilibrium(&truth, truth.params().values(), truth.initial_positions(), &held(&truth, record, 0.0)).unwrap();
        let (mut x, mut log) = (rest.state(), header());
        for sample in 0..=logged.samples {
            let t = sample as f64 / RATE;
            let drift = |k: usize| logged.drift * (std::f64::consts::TAU * (waves[k][0] * t + waves[k][1])).sin();
            let axes = truth.material_axes(&x.q, &x.z);
            let markers = (2..NODES - 2).flat_map(|node| {
                let beside = beside(&x.q, &axes, node, logged.offset);
                [0, 1, 2].map(|a| x.q[3 * node + a] + beside[a] + drift(3 * node + a))
            });
            let row: Vec<String> =
                markers.map(|p| p + logged.noise * noise()).chain(held(&truth, record, t)).map(|x| format!("{x:.7}")).collect();
            writeln!(log, "{t},{}", row.join(",")).unwrap();
            for k in 1..=FINE {
                // the log is interpolated linearly, and so are the true motion's inputs
                let part = k as f64 / FINE as f64;
                let (a, b) = (held(&truth, record, t), held(&truth, record, t + 1.0 / RATE));
                let u: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + part * (b - a)).collect();
                stepper.step(&mut x, &u).unwrap();
            }
        }
        std::fs::write(folder.path().join(format!("run{record}.csv")), log).unwrap();
    }
    Setup::from_source(
        Source::new(
            "scene.toml",
            &(rod(0.25 / RATE, "midpoint", ["", if logged.known { logged.more } else { "" }, ""]) + &experiment(logged.records)),
        ),
        folder.path().to_owned(),
    )
    .unwrap()
}

/// An offset at a node: along the mean of the material axes of the two edges that meet there.
fn beside(q: &[f64], first: &[Vector3<f64>], node: usize, offset: [f64; 2]) -> Vector3<f64> {
    let at = |k: usize| Vector3::new(q[3 * k], q[3 * k + 1], q[3 * k + 2]);
    let of_edge = |k: usize| first[k] * offset[0] + (at(k + 1) - at(k)).normalize().cross(&first[k]) * offset[1];
    (of_edge(node - 1) + of_edge(node)) * 0.5
}

fn columns(node: usize) -> String {
    ["x", "y", "z"].map(|axis| format!("n{node}{axis}")).join(",")
}

fn header() -> String {
    let nodes = (2..NODES - 2).chain([0, 1, NODES - 2, NODES - 1]);
    format!("t,{}\n", nodes.map(columns).collect::<Vec<_>>().join(","))
}

fn experiment([fitted, held_out]: [usize; 2]) -> String {
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
    for record in 0..fitted + held_out {
        let role = if record < fitted { "fit" } else { "held_out" };
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
