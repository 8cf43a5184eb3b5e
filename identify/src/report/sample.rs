//! A diagnosis made by hand, for tests.
#![allow(clippy::unwrap_used)]

use crate::diagnose::*;
use crate::log::Setup;
use pliant_scene::Source;

const SCENE: &str = r#"
schema_version = 1
[time]
step = 0.01
[[rope]]
name = "cable"
nodes = 5
length = 0.5
linear_density = 0.05
stretch_stiffness = 100.0
bend_stiffness = 1e-3
initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
[[gripper]]
name = "left"
rope = "cable"
nodes = [0]
[experiment]
time = { column = "t" }
[[experiment.marker]]
rope = "cable"
node = 3
columns = ["x", "y", "z"]
[[experiment.input]]
gripper = "left"
columns = ["gx", "gy", "gz"]
[[experiment.record]]
file = "run1.csv"
"#;

/// A set-up whose records stand in `/somewhere/data`.
pub(super) fn setup() -> Setup {
    Setup::from_source(Source::new("scene.toml", SCENE), "/somewhere/data".into()).unwrap()
}

/// An estimate ± 20 %.
pub(super) fn estimate(path: &str, estimate: f64) -> Estimate {
    let interval = Some([0.8 * estimate, 1.2 * estimate]);
    Estimate { path: path.into(), estimate, unit: "N·m²·s".into(), interval, scene_value: 0.0 }
}

/// A rope that swings and is damped less by the baseline than in truth.
pub(crate) fn diagnosis() -> Diagnosis {
    let damping = estimate("cable.bend_damping", 1.5e-4);
    let stiffness = estimate("cable.bend_stiffness", 2.1e-3);
    let stage = |name: &str, rmse: f64, parameters: &[&Estimate]| Stage {
        name: name.into(),
        rmse_fit: rmse,
        rmse_held_out: 1.1 * rmse,
        mean_abs_held_out: 0.5 * rmse,
        held_out: vec![HorizonError {
            horizon_s: 2.0,
            mean_abs: 0.5 * rmse,
            median_record: 0.4 * rmse,
            without_worst: 0.45 * rmse,
        }],
        parameters: parameters.iter().map(|e| (*e).clone()).collect(),
    };
    let gain = |horizon_s: f64, rmse_before: f64| Gain {
        horizon_s,
        rmse_before,
        rmse_after: 0.2 * rmse_before,
        unit: "m".into(),
        interval: Some([1.2, 1.9]),
        explained_fraction: 0.93,
        mean_abs: [0.5 * rmse_before, 0.1 * rmse_before],
    };
    Diagnosis {
        schema_version: SCHEMA_VERSION,
        scene: "scene.toml".into(),
        verdict: Verdict::Named,
        reason: "Its score is far beyond chance, and no other cause comes close.".into(),
        causes: vec![Cause {
            name: "internal_damping".into(),
            object: None,
            meaning: "The cable loses energy when it is bent.".into(),
            parameters: vec![damping.clone()],
            statistic: 312.0,
            foretold: Some(0.96),
            constancy_p: Some(0.4),
            sizes: Vec::new(),
            rivals: vec![Rival { name: "linear_drag".into(), object: None, cosine: 0.71 }],
        }],
        extension: Vec::new(),
        alternatives: Vec::new(),
        alternative_objects: Vec::new(),
        advice: Vec::new(),
        next: Vec::new(),
        remainder: Remainder {
            significant: false,
            forms: Vec::new(),
            over_scatter: 1.4,
            by_motion: Some(0.01),
            input_p: 0.4,
            rmse: 1.1e-3,
            unit: "m".into(),
            explained_fraction: 0.97,
            note: "white up to lag 8".into(),
        },
        candidates: vec![
            candidate("internal_damping", Status::Tested, Some(312.0), "accepted"),
            candidate("linear_drag", Status::Tested, Some(148.0), "weaker than internal damping"),
            candidate("gravity_tilt", Status::Absorbed, None, "the gripper's offset hides it"),
            candidate("wind", Status::Untestable, None, "<script>alert('no')</script>"),
        ],
        gain: vec![gain(0.5, 4e-3), gain(2.0, 1e-2)],
        ceiling: Some(Ceiling { rmse: 6e-3, rmse_on_top: 1.9e-3, unit: "m".into(), explained_fraction: 0.7, share: Some(1.37) }),
        numerics: Vec::new(),
        imitated: Vec::new(),
        refined: None,
        warnings: Vec::new(),
        noise: Noise { ar: vec![0.4, 0.1], sigma: 1e-3, sensor_sigma: 8e-4, effective_samples: 420.0 },
        records: RecordCount { fit: 2, held_out: 1 },
        audit: vec![AuditFinding {
            severity: "warning".into(),
            record: "run2.csv".into(),
            place: "Point(2)".into(),
            time_s: Some(0.7),
            what: "frozen for 12 samples".into(),
            number: 12.0,
            unit: "samples".into(),
            advice: "mask them".into(),
        }],
        baseline: vec![Estimate { estimate: 1.9e-3, ..stiffness.clone() }],
        unidentifiable: Vec::new(),
        stages: vec![stage("baseline", 9e-3, &[&stiffness]), stage("internal_damping", 1.1e-3, &[&stiffness, &damping])],
        curves: (0..3).map(curve).collect(),
        snapshots: [0.4, 1.3].map(snapshot).to_vec(),
        wall_s: 12.0,
        parts: vec![PartTime { part: "search".into(), seconds: 9.0 }],
    }
}

fn candidate(name: &str, status: Status, statistic: Option<f64>, reason: &str) -> CandidateReport {
    CandidateReport {
        name: name.into(),
        object: None,
        status,
        statistic,
        dof: 1,
        p_value: statistic.map(|t| (-0.5 * t).exp()),
        absorbed_fraction: Some(if status == Status::Absorbed { 0.98 } else { 0.2 }),
        smallest_detectable: statistic.map(|_| 1e-5),
        one_step: vec![1e-4],
        unit: "N·m²·s".into(),
        reason: reason.into(),
    }
}

/// Swings with decay `rate` [1/s]; arc length s [m].
fn shape(s: f64, t: f64, rate: f64) -> [f64; 3] {
    let swing = 0.12 * (-rate * t).exp() * (7.0 * t).sin() * (std::f64::consts::PI * s / 0.5).sin();
    [0.9 * s, swing, -1.6 * s * (0.5 - s) + 0.3 * swing]
}

fn curve(marker: usize) -> Curve {
    let s = 0.1 + 0.1 * marker as f64;
    let time: Vec<f64> = (0..250).map(|k| 0.01 * f64::from(k)).collect();
    let run = |rate: f64| time.iter().map(|t| shape(s, *t, rate)).collect::<Vec<_>>();
    let noise = |k: usize, a: usize| 1e-3 * (((k * 7919 + a * 104_729 + marker * 31) % 1000) as f64 / 500.0 - 1.0);
    let measured = run(1.5).iter().enumerate().map(|(k, p)| [0, 1, 2].map(|a| p[a] + noise(k, a))).collect();
    Curve { record: "run3.csv".into(), marker, measured, before: run(0.6), after: run(1.48), time, ..Curve::default() }
}

fn snapshot(time: f64) -> Snapshot {
    let at = |rate: f64, n: u32| (0..n).map(|i| shape(0.5 * f64::from(i) / f64::from(n - 1), time, rate)).collect();
    Snapshot { record: "run3.csv".into(), time, measured: at(1.5, 6), before: at(0.6, 13), after: at(1.48, 13) }
}
