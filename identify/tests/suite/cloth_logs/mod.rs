//! Logs of a strip of cloth that hangs from a hand and is swung by it.

use crate::stats_helpers::gaussians;
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_identify::log::Setup;
use pliant_scene::{Nothing, Source, parse_scene};
use std::fmt::Write;
use std::sync::Arc;
use tempfile::TempDir;

/// Nodes down the strip and across it.
pub const GRID: [usize; 2] = [5, 3];
/// Samples per second [Hz].
const RATE: f64 = 100.0;
/// Steps of the truth per sample.
const FINE: usize = 8;

/// The logged run.
pub struct Logged<'a> {
    /// Keys of the true sheet that take the place of the scene's.
    pub sheet: &'a [(&'a str, f64)],
    /// True tilt of gravity [rad].
    pub tilt: [f64; 2],
    /// Marked nodes.
    pub marked: &'a [usize],
    /// Start of records, as the scene says it.
    pub initial: &'a str,
    /// Numbers of records to be fitted and held out.
    pub records: [usize; 2],
    /// Samples of a record.
    pub samples: usize,
    /// Samples before the first that is logged.
    pub before: usize,
    /// Standard deviation of the markers [m].
    pub noise: f64,
}

/// Both long sides below the held row.
pub const SIDES: [usize; 6] = [6, 8, 9, 11, 12, 14];

impl Default for Logged<'_> {
    fn default() -> Self {
        Self { sheet: &[], tilt: [0.0; 2], marked: &SIDES, initial: "rest", records: [3, 1], samples: 80, before: 0, noise: 5e-4 }
    }
}

/// The strip; `sheet` has values of keys that are not the scene's.
fn strip(step: f64, integrator: &str, sheet: &[(&str, f64)], tilt: [f64; 2]) -> String {
    let keys = [
        ("thickness", 1e-3),
        ("area_density", 0.2),
        ("youngs_modulus", 2e4),
        ("poisson_ratio", 0.2),
        ("bend_stiffness", 2e-4),
        ("membrane_damping", 100.0),
        ("bend_damping", 2e-6),
        ("drag_normal", 0.05),
        ("drag_quadratic", 0.05),
    ];
    let value = |(key, usual): (&str, f64)| sheet.iter().find(|(own, _)| *own == key).map_or(usual, |(_, value)| *value);
    let keys: String = keys.map(|(key, usual)| format!("{key} = {:e}\n", value((key, usual)))).concat();
    let [down, across] = GRID;
    format!(
        "schema_version = 1\n[time]\nstep = {step}\nduration = 1.0\nintegrator = \"{integrator}\"\n[gravity]\ntilt = {tilt:?}\n\
         [[cloth]]\nname = \"sheet\"\ngrid = {{ nodes = [{down}, {across}], size = [0.4, 0.16] }}\norigin = [0, 0, 1]\n\
         u_axis = [0, 0, -1]\nv_axis = [0, 1, 0]\n{keys}[[gripper]]\nname = \"hand\"\ncloth = \"sheet\"\nnodes = [0, 1, 2]\n"
    )
}

/// Where the hand has its nodes at a time: as the scene begins, then swinging and turning about the vertical, otherwise in every record.
fn held(model: &Model, record: usize, t: f64) -> Vec<f64> {
    let (q, k) = (model.initial_positions(), record as f64);
    let wave = |amplitude: f64, frequency: f64, phase: f64| {
        amplitude * ((frequency * t + phase).sin() - phase.sin()) * (1.0 - (-t / 0.1).exp())
    };
    let by = [wave(0.10, 7.0 + k, k), wave(0.05, 5.0 - 0.7 * k, 1.0 + k), wave(0.04, 9.0 + k, 2.0 * k)];
    let (sin, cos) = wave(0.4, 6.0 + 0.5 * k, k).sin_cos();
    let of_node = |node: usize| {
        let y = q[3 * node + 1];
        [q[3 * node] - y * sin + by[0], y * cos + by[1], q[3 * node + 2] + by[2]]
    };
    (0..GRID[1]).flat_map(of_node).collect()
}

fn columns(nodes: &[usize]) -> Vec<String> {
    nodes.iter().flat_map(|node| ["x", "y", "z"].map(|axis| format!("n{node}{axis}"))).collect()
}

/// Logs of a strip, by smaller steps of another integrator, and the setup of one that has nothing hidden in it; `more` joins the
/// experiment.
pub fn setup(folder: &TempDir, logged: &Logged, more: &str) -> Setup {
    let truth = strip(1.0 / RATE / FINE as f64, "sdirk2", logged.sheet, logged.tilt);
    let truth = Arc::new(ModelBuilder::new(&parse_scene::<Nothing>(&truth, "truth.toml").unwrap()).unwrap().build());
    let theta = truth.params().values();
    let hand: Vec<usize> = (0..GRID[1]).collect();
    let header = [columns(logged.marked), columns(&hand)].concat().join(",");
    for record in 0..logged.records.iter().sum() {
        let mut stepper = Stepper::new(&truth, theta, StepOptions::default()).unwrap();
        let rest = equilibrium(&truth, theta, truth.initial_positions(), &held(&truth, record, 0.0)).unwrap();
        let (mut x, mut log) = (rest.state(), format!("t,{header}\n"));
        let mut noise =
            gaussians((logged.before + logged.samples + 1) * 3 * logged.marked.len(), 100 + record as u64).into_iter();
        for sample in 0..=logged.before + logged.samples {
            let t = sample as f64 / RATE;
            let markers = logged.marked.iter().flat_map(|node| [0, 1, 2].map(|a| x.q[3 * node + a]));
            let noisy: Vec<f64> = markers.map(|p| p + logged.noise * noise.next().unwrap()).collect();
            let row: Vec<String> = noisy.into_iter().chain(held(&truth, record, t)).map(|x| format!("{x:.7}")).collect();
            if sample >= logged.before {
                writeln!(log, "{t},{}", row.join(",")).unwrap();
            }
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
    let text = strip(0.25 / RATE, "midpoint", &[], [0.0; 2]) + &experiment(logged) + more;
    Setup::from_source(Source::new("scene.toml", &text), folder.path().to_owned()).unwrap()
}

fn experiment(logged: &Logged) -> String {
    let quoted = |nodes: &[usize]| columns(nodes).iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    let mut out = format!("[experiment]\ntime = {{ column = \"t\" }}\nlead_in = 0.1\ninitial = \"{}\"\n", logged.initial);
    for node in logged.marked {
        let _ = writeln!(out, "[[experiment.marker]]\ncloth = \"sheet\"\nnode = {node}\ncolumns = [{}]", quoted(&[*node]));
    }
    let _ = writeln!(out, "[[experiment.input]]\ngripper = \"hand\"\ncolumns = [{}]", quoted(&[0, 1, 2]));
    for record in 0..logged.records.iter().sum() {
        let role = if record < logged.records[0] { "fit" } else { "held_out" };
        let _ = writeln!(out, "[[experiment.record]]\nfile = \"run{record}.csv\"\nrole = \"{role}\"");
    }
    out + "[experiment.fit]\nfree = [{ path = \"sheet.bend_stiffness\", lower = 1e-6, upper = 1e-2 }]\n"
}
