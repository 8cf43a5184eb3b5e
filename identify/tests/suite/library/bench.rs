//! Small scenes whose logs are simulated with an effect that the scene lacks.

use crate::stats_helpers::gaussians;
use pliant_engine::model::Model;
use pliant_identify::log::{Logs, Record, Setup, Split};
use pliant_identify::sensor::SENSOR_PATHS;
use pliant_identify::shooting::{Plan, RecordPlan, ShotWants, StartState, shoot};
use pliant_identify::unknown::{Unknown, Values};
use pliant_math::State;
use pliant_scene::Source;
use std::path::PathBuf;

/// A scene with its experiment, and the motions that are logged.
pub struct Bench {
    /// Scene and experiment.
    pub text: String,
    /// Number of records, and samples of each after the first.
    pub records: [usize; 2],
    /// Samples per second [Hz].
    pub rate: f64,
    /// Standard deviation of every reading [m or rad].
    pub noise: f64,
    /// Inputs of a record at a time [s].
    pub inputs: fn(&Model, usize, f64) -> Vec<f64>,
    /// Time of a record up to which its readings are smooth in every parameter [s]: before a joint with dry friction stops.
    pub smooth: Option<f64>,
    /// Change of a coordinate for central differences [-]; large enough for the tolerance of the step not to show.
    pub change: f64,
    /// Coordinates and velocities that a record begins with; `None` for equilibrium.
    pub start: fn(usize) -> Option<[Vec<f64>; 2]>,
}

/// Values of parameters by their paths.
pub type Truth<'a> = &'a [(&'a str, f64)];

/// Logs, and the simulation that made them.
pub struct Made {
    pub setup: Setup,
    pub logs: Logs,
    /// The experiment with the true initial states.
    pub plan: Plan,
    /// The true values.
    pub values: Values,
}

impl Bench {
    /// Logs with these values and noise of this seed.
    pub fn made(&self, truth: Truth, seed: u64) -> Made {
        let source = Source { file: "scene.toml".to_owned(), text: self.text.clone() };
        let setup = Setup::from_source(source, PathBuf::new()).unwrap();
        let mut logs = Logs { records: self.silent(&setup), split: Split::Declared };
        let mut plan = Plan::opened(&setup, &logs).unwrap();
        let mut values = plan.scene_values.clone();
        truth.iter().for_each(|(path, value)| set(&setup, &plan, &mut values, path, *value));
        let (markers, channels) = (plan.markers.len(), plan.channels());
        for (k, rec) in plan.fitted.iter_mut().enumerate() {
            if let Some([q, v]) = (self.start)(k) {
                let mean = State { q, v, z: plan.model.initial_memory() };
                rec.start = StartState { mean, ..StartState::default() };
            }
        }
        let clean: Vec<Vec<f64>> = plan.fitted.iter().map(|rec| predicted(&plan, rec, &values, None)).collect();
        for (k, readings) in clean.iter().enumerate() {
            let noise = gaussians(readings.len(), seed + k as u64);
            let noisy: Vec<f64> = readings.iter().zip(noise).map(|(y, e)| y + self.noise * e).collect();
            for (t, row) in noisy.chunks_exact(channels).enumerate() {
                (0..markers).for_each(|m| logs.records[k].markers[t][m].copy_from_slice(&row[3 * m..3 * m + 3]));
                logs.records[k].joints[t].copy_from_slice(&row[3 * markers..]);
            }
        }
        Made { setup, logs, plan, values }
    }

    /// Records with their inputs and no readings yet.
    fn silent(&self, setup: &Setup) -> Vec<Record> {
        let model = pliant_engine::model::ModelBuilder::new(&setup.scene).unwrap().build();
        let [records, samples] = self.records;
        let time: Vec<f64> = (0..=samples).map(|k| k as f64 / self.rate).collect();
        let of_grippers = model.nu() - setup.scene.actuator.len();
        // an actuator acts throughout a step, the position of a gripper is that at its end
        let phase: Vec<f64> = (0..model.nu()).map(|k| if k < of_grippers { 1.0 } else { 0.5 }).collect();
        let one = |k: usize| Record {
            name: format!("run{k}"),
            inputs: time.iter().map(|t| (self.inputs)(&model, k, *t)).collect(),
            markers: vec![vec![[0.0; 3]; setup.experiment.marker.len()]; time.len()],
            joints: vec![vec![0.0; setup.experiment.joint.len()]; time.len()],
            orientations: vec![Vec::new(); time.len()],
            phase: phase.clone(),
            time: time.clone(),
            ..Record::default()
        };
        (0..records).map(one).collect()
    }
}

/// Readings of a record up to a time [s].
pub fn predicted(plan: &Plan, rec: &RecordPlan, values: &Values, until: Option<f64>) -> Vec<f64> {
    shoot(plan, rec, values, ShotWants { until, ..ShotWants::default() }).unwrap().predicted
}

/// Sets a parameter of the model, the markers' sensor, a joint's sensor, a marker's place or a motor's delay.
fn set(setup: &Setup, plan: &Plan, values: &mut Values, path: &str, value: f64) {
    let joints = setup.experiment.joint.iter().map(|joint| joint.paths());
    let joint = joints.enumerate().find_map(|(k, paths)| Some((k, paths.iter().position(|p| *p == path)?)));
    let marker = |(k, a): (usize, usize)| path == format!("marker[{k}].offset[{a}]");
    let offset = (0..plan.markers.len()).flat_map(|k| [(k, 0), (k, 1)]).find(|at| marker(*at));
    let actuators = &setup.scene.actuator;
    if let Some(unknown) = Unknown::of_theta(&plan.model, path, 1.0) {
        unknown.set(values, value);
    } else if let Some(k) = SENSOR_PATHS.iter().position(|p| *p == path) {
        values.sensor.0[k] = value;
    } else if let Some((k, entry)) = joint {
        values.joints[k][entry] = value;
    } else if let Some((k, a)) = offset {
        values.offsets[k][a] = value;
    } else if let Some(k) = actuators.iter().position(|a| path == format!("{}.delay", a.name)) {
        values.late[plan.model.nu() - actuators.len() + k] = value;
    } else {
        panic!("no parameter {path}");
    }
}

fn records(n: usize) -> String {
    (0..n).map(|k| format!("[[experiment.record]]\nfile = \"run{k}.csv\"\nrole = \"fit\"\n")).collect()
}

fn columns(prefix: &str, n: usize) -> String {
    (0..n).map(|k| format!("\"{prefix}{k}\"")).collect::<Vec<_>>().join(", ")
}

/// An arm of two links with a motor and an encoder at each joint, whose shoulder has a motor of known cycles per turn; `friction` bounds the dry friction of the shoulder [N·m].
pub fn arm(friction: f64) -> Bench {
    two_links(friction, ["kind = \"torque\""; 2])
}

/// The arm with a position drive at its shoulder and a velocity drive at its elbow.
pub fn driven() -> Bench {
    let inputs = |_: &Model, record: usize, t: f64| {
        let k = record as f64;
        vec![
            0.5 * ((5.0 + k) * t + k).sin() + 0.2 * (14.0 * t + 2.0 * k).sin(),
            2.0 * ((7.0 - k) * t - k).sin() + 1.5 * (15.0 * t + k).cos(),
        ]
    };
    let drives = ["kind = \"position\"\nstiffness = 20.0\ndamping = 0.8", "kind = \"velocity\"\ndamping = 0.3"];
    Bench { inputs, ..two_links(0.0, drives) }
}

fn two_links(friction: f64, drives: [&str; 2]) -> Bench {
    let link = |name: &str, place: &str, joint: &str, keys: &str| {
        format!(
            "[[body]]\nname = \"{name}\"\n{place}\nmass = 0.6\ncenter_of_mass = [0.02, 0, -0.15]\n\
             inertia = [4e-3, 5e-3, 2e-3, 0, 0, 0]\n[[body.joint]]\nname = \"{joint}\"\nkind = \"revolute\"\naxis = [0, -1, 0]\n{keys}\n"
        )
    };
    let upper = link("upper", "", "shoulder", &format!("damping = 0.02\nfriction = {friction:?}\ncogging = {{ cycles = 4 }}"));
    let lower = link("lower", "parent = \"upper\"\nposition = [0, 0, -0.3]", "elbow", "damping = 0.01\nstiffness = 0.6");
    let motor = |joint: &str, drive: &str| format!("[[actuator]]\nname = \"motor_{joint}\"\njoint = \"{joint}\"\n{drive}\n");
    // a seal that drags where it is turned far
    let own = "[[force]]\nname = \"seal\"\njoint = \"shoulder\"\nformula = \"-c*v*q**2\"\nparameters = { c = 0.0 }\n";
    let sensor = |joint: &str| {
        format!(
            "[[experiment.joint]]\njoint = \"{joint}\"\ncolumn = \"{joint}\"\nnoise_floor = 3e-4\n\
             [[experiment.input]]\nactuator = \"motor_{joint}\"\ncolumns = [\"u_{joint}\"]\n"
        )
    };
    let text = format!(
        "schema_version = 1\n[time]\nstep = 0.005\nduration = 1.0\nintegrator = \"midpoint\"\n{upper}{lower}{}{}{own}\
         [experiment]\ntime = {{ column = \"t\" }}\n{}{}{}",
        motor("shoulder", drives[0]),
        motor("elbow", drives[1]),
        sensor("shoulder"),
        sensor("elbow"),
        records(3)
    );
    let inputs = |_: &Model, record: usize, t: f64| {
        let k = record as f64;
        vec![
            1.2 * ((4.0 + k) * t + k).sin() + 0.6 * (11.0 * t + 2.0 * k).sin(),
            0.7 * ((6.0 - k) * t - k).sin() + 0.4 * (14.0 * t + k).cos(),
        ]
    };
    let start = |record: usize| {
        let k = record as f64;
        Some([vec![0.4 - 0.5 * k, 0.8 * k - 0.5], vec![0.8 * [1.0, -1.0, 1.0][record], 0.3 - k]])
    };
    Bench {
        text,
        records: [3, 150],
        rate: 100.0,
        noise: 1e-3,
        inputs,
        smooth: (friction > 0.0).then_some(0.15),
        change: 1e-2,
        start,
    }
}

/// A ball that cannot turn on two slides over a floor, with an encoder at each slide.
pub fn slider() -> Bench {
    let joint = |name: &str, axis: &str| format!("[[body.joint]]\nname = \"{name}\"\nkind = \"prismatic\"\naxis = {axis}\n");
    let sensor = |name: &str| format!("[[experiment.joint]]\njoint = \"{name}\"\ncolumn = \"{name}\"\nnoise_floor = 1e-4\n");
    let text = format!(
        "schema_version = 1\n[time]\nstep = 0.0025\nduration = 1.0\nintegrator = \"euler\"\n[[plane]]\nname = \"floor\"\nfriction = 0.2\n\
         [[body]]\nname = \"ball\"\nmass = 1.0\ninertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]\n{}{}\
         [[body.shape]]\nkind = \"sphere\"\nradius = 0.05\n[experiment]\ntime = {{ column = \"t\" }}\n{}{}{}",
        joint("x", "[1, 0, 0]"),
        joint("z", "[0, 0, 1]\nstart = [0.3]"),
        sensor("x"),
        sensor("z"),
        records(4)
    );
    let start = |record: usize| {
        let k = record as f64;
        Some([vec![0.0, 0.15 + 0.03 * k], vec![[1.4, -1.9, 1.1, -2.3][record], 0.0]])
    };
    Bench { text, records: [4, 140], rate: 200.0, noise: 3e-4, inputs: |_, _, _| Vec::new(), smooth: None, change: 1e-4, start }
}

/// A body with three markers, tossed in air of this density [kg/m³].
pub fn toss(density: f64) -> Bench {
    let marker = |k: usize, point: &str| {
        format!("[[experiment.marker]]\nbody = \"cube\"\npoint = {point}\ncolumns = [{}]\n", columns(&format!("m{k}"), 3))
    };
    let text = format!(
        "schema_version = 1\n[time]\nstep = 0.005\nduration = 1.0\nintegrator = \"midpoint\"\n[air]\ndensity = {density}\n\
         [[body]]\nname = \"cube\"\nmass = 0.3\ninertia = [3e-4, 4e-4, 5e-4, 0, 0, 0]\n[[body.joint]]\nname = \"free\"\nkind = \"free\"\n\
         [experiment]\nnoise_floor = 1e-4\ntime = {{ column = \"t\" }}\n{}{}{}{}",
        marker(0, "[0.05, 0, 0]"),
        marker(1, "[-0.05, 0.02, 0]"),
        marker(2, "[0, -0.05, 0.04]"),
        records(3)
    );
    let start = |record: usize| {
        let k = record as f64;
        Some([vec![0.3 * k, 0.2, 0.9, 1.0, 0.0, 0.0, 0.0], vec![0.5 - 0.4 * k, 0.3, 2.0 + 0.3 * k, 1.0, 2.0 - k, 0.5 * k]])
    };
    Bench { text, records: [3, 80], rate: 100.0, noise: 5e-4, inputs: |_, _, _| Vec::new(), smooth: None, change: 1e-4, start }
}

/// Kind and name of what grippers hold, and its number of nodes.
const CABLE: (&str, &str) = ("rope", "cable");
const SHEET: (&str, &str) = ("cloth", "sheet");

/// A rope or sheet of these keys that grippers hold by nodes.
fn held(
    (kind, name): (&str, &str),
    keys: &str,
    nodes: usize,
    grippers: &[(&str, &[usize])],
    step: f64,
    integrator: &str,
) -> String {
    let list = |nodes: &[usize]| nodes.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let gripper = |(hand, nodes): &(&str, &[usize])| {
        format!("[[gripper]]\nname = \"{hand}\"\n{kind} = \"{name}\"\nnodes = [{}]\n", list(nodes))
    };
    let input = |(name, nodes): &(&str, &[usize])| {
        format!("[[experiment.input]]\ngripper = \"{name}\"\ncolumns = [{}]\n", columns(&format!("{name}_"), 3 * nodes.len()))
    };
    let free = (0..nodes).filter(|node| !grippers.iter().any(|(_, held)| held.contains(node)));
    let marker = |node: usize| {
        format!("[[experiment.marker]]\n{kind} = \"{name}\"\nnode = {node}\ncolumns = [{}]\n", columns(&format!("m{node}_"), 3))
    };
    format!(
        "schema_version = 1\n[time]\nstep = {step}\nduration = 1.0\nintegrator = \"{integrator}\"\n[[{kind}]]\nname = \"{name}\"\n{keys}{}\
         [experiment]\ninitial = \"rest\"\nnoise_floor = 1e-4\ntime = {{ column = \"t\" }}\n{}{}{}",
        grippers.iter().map(gripper).collect::<String>(),
        free.map(marker).collect::<String>(),
        grippers.iter().map(input).collect::<String>(),
        records(3)
    )
}

/// A swing that begins at rest.
fn wave(amplitude: f64, frequency: f64, phase: f64, t: f64) -> f64 {
    // the speed grows from 0 over a tenth of a second
    amplitude * ((frequency * t + phase).sin() - phase.sin()) * (1.0 - (-t / 0.1).exp())
}

/// A rope that hangs from a gripper, with a free end.
pub fn rope() -> Bench {
    let keys = "nodes = 6\nlength = 0.5\nlinear_density = 0.03\nstretch_stiffness = 60.0\nstretch_damping = 0.05\nbend_stiffness = 1e-3\n\
                bend_damping = 2e-5\ndrag_linear = 0.02\ndrag_quadratic = 0.01\n\
                initial = { shape = \"straight\", from = [0.1, 0.0, 0.8], direction = [0, 0, -1] }\n\
                [[force]]\nname = \"draft\"\nrope = \"cable\"\nformula = [\"a*exp(-z/0.3)\", \"b*sin(4*x)\", \"0\"]\n\
                parameters = { a = 0.0, b = 0.0 }\n";
    let inputs = |_: &Model, record: usize, t: f64| {
        let k = record as f64;
        vec![0.1 + wave(0.12, 6.0 + k, k, t), wave(0.10, 5.0 - 0.7 * k, 1.0 + k, t), 0.8 + wave(0.08, 8.0 + k, 2.0 * k, t)]
    };
    Bench {
        text: held(CABLE, keys, 6, &[("hand", &[0])], 0.005, "midpoint"),
        records: [3, 60],
        rate: 50.0,
        noise: 1e-4,
        inputs,
        smooth: None,
        change: 1e-4,
        start: |_| None,
    }
}

/// A strip of cloth that hangs from a gripper by its upper side.
pub fn sheet() -> Bench {
    let keys = "grid = { nodes = [5, 3], size = [0.4, 0.16] }\norigin = [0, 0, 0.8]\nu_axis = [0, 0, -1]\nv_axis = [0, 1, 0]\n\
                thickness = 1e-3\narea_density = 0.2\nyoungs_modulus = 5e4\npoisson_ratio = 0.2\nbend_stiffness = 2e-3\n\
                membrane_damping = 20.0\nbend_damping = 1e-5\ndrag_normal = 0.1\ndrag_quadratic = 0.1\n\
                [[force]]\nname = \"draft\"\ncloth = \"sheet\"\nformula = [\"a*exp(-z/0.3)\", \"b*sin(4*x)\", \"0\"]\n\
                parameters = { a = 0.0, b = 0.0 }\n";
    let inputs = |model: &Model, record: usize, t: f64| {
        let (q, k) = (model.initial_positions(), record as f64);
        let by = [wave(0.06, 6.0 + k, k, t), wave(0.04, 5.0 - 0.7 * k, 1.0 + k, t), wave(0.05, 8.0 + k, 2.0 * k, t)];
        let (sin, cos) = wave(0.3, 5.0 + 0.5 * k, k, t).sin_cos();
        // the upper side moves, and turns about the vertical
        let at = |node: usize| {
            let y = q[3 * node + 1];
            [q[3 * node] - y * sin + by[0], y * cos + by[1], q[3 * node + 2] + by[2]]
        };
        (0..3).flat_map(at).collect()
    };
    Bench {
        text: held(SHEET, keys, 15, &[("hand", &[0, 1, 2])], 0.005, "midpoint"),
        records: [3, 60],
        rate: 50.0,
        noise: 1e-4,
        inputs,
        smooth: None,
        change: 1e-4,
        start: |_| None,
    }
}

/// Nodes of the rod.
const NODES: usize = 8;

/// A rod that is curved free of load, between two grippers; `free` lists the declared free parameters.
pub fn rod(free: &[&str]) -> Bench {
    let keys = "nodes = 8\nlength = 0.6\nlinear_density = 0.03\nstretch_stiffness = 300.0\nstretch_damping = 0.3\nbend_stiffness = 1e-3\n\
                bend_damping = 3e-5\ninitial = { shape = \"between\", from = [0, 0, 0], to = [0.45, 0, 0.05] }\n\
                [rope.twist]\nstiffness = 1e-3\ndamping = 3e-5\ninertia = 4e-7\nrest_curvature = [0.9, -0.6]\n";
    let inputs = |model: &Model, record: usize, t: f64| {
        let (q, k) = (model.initial_positions(), record as f64);
        let mut out = Vec::new();
        for (side, [end, next]) in [[0, 1], [NODES - 1, NODES - 2]].into_iter().enumerate() {
            let s = side as f64;
            let by = [wave(0.06, 5.0 + k, s, t), wave(0.08, 4.0 + 0.7 * k, 1.0 + k + s, t), wave(0.05, 6.0, 2.0 * s + k, t)];
            let d = [0, 1, 2].map(|a| q[3 * next + a] - q[3 * end + a]);
            // the held edge turns about the vertical
            let (sin, cos) = wave(0.6, 4.0 + s, k, t).sin_cos();
            let turned = [d[0] * cos - d[1] * sin, d[0] * sin + d[1] * cos, d[2]];
            let first = [0, 1, 2].map(|a| q[3 * end + a] + by[a]);
            let second = [0, 1, 2].map(|a| first[a] + turned[a]);
            // inputs of a gripper are in the order of its nodes
            out.extend(if side == 0 { [first, second] } else { [second, first] }.concat());
        }
        out
    };
    let grippers: [(&str, &[usize]); 2] = [("left", &[0, 1]), ("right", &[NODES - 2, NODES - 1])];
    let one = |path: &&str| format!("{{ path = \"{path}\", lower = -10.0, upper = 10.0 }}");
    let fit = format!("[experiment.fit]\nfree = [{}]\n", free.iter().map(one).collect::<Vec<_>>().join(", "));
    let text = held(CABLE, keys, NODES, &grippers, 0.01, "midpoint") + &fit;
    Bench { text, records: [3, 50], rate: 50.0, noise: 1e-4, inputs, smooth: None, change: 1e-4, start: |_| None }
}
