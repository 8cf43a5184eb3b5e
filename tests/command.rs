//! The command: exit codes, data on stdout, messages on stderr, and files that are complete or absent.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn pliant(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A scene file in `folder`, made from a shared one by replacing a text in it.
fn changed(folder: &Path, scene: &str, from: &str, to: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes").join(scene);
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from}");
    let path = folder.join(scene);
    std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
    path
}

fn entries(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

/// Exit code 2, nothing on stdout, and the four parts of an error on stderr.
fn assert_refused(output: &Output, parts: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for part in ["error: ", "\n  likely cause: ", "\n  fix: "].iter().chain(parts) {
        assert!(message.contains(part), "{part:?} is not in {message}");
    }
}

#[test]
fn simulate_prints_one_object_and_writes_named_columns() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run.csv");
    let output = pliant(&["simulate", "tests/scenes/windy.toml", "--json", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = json(&output);
    assert_eq!(summary["steps"], 20);
    assert_eq!(summary["energy"].as_array().unwrap().len(), 21);
    for key in ["newton_iterations", "factorizations", "retries", "wall_s"] {
        assert!(summary[key].is_number(), "{key}");
    }
    let csv = std::fs::read_to_string(&out).unwrap();
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    assert_eq!(header[..4], ["t", "cord.node[0].x", "cord.node[0].y", "cord.node[0].z"]);
    assert!(csv.lines().count() == 22 && csv.lines().all(|line| line.split(',').count() == header.len()));
    assert_eq!(entries(folder.path()), 1, "no temporary file is left");
}

#[test]
fn simulate_writes_arrays_by_rope() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run.npz");
    let output = pliant(&["simulate", "tests/scenes/edge_clamp.toml", "--out", out.to_str().unwrap()]);
    assert!(output.status.success() && text(&output.stdout).contains("20 steps"));
    let mut npz = ndarray_npy::NpzReader::new(std::fs::File::open(&out).unwrap()).unwrap();
    let names = npz.names().unwrap();
    assert!(names.iter().any(|name| name.ends_with(".velocity")), "{names:?}");
    let time: ndarray::Array1<f64> = npz.by_name("t").unwrap();
    assert!((time[20] - 0.2).abs() < 1e-12);
}

#[test]
fn nothing_is_computed_for_an_output_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing/run.csv");
    assert_refused(
        &pliant(&["simulate", "tests/scenes/windy.toml", "--out", missing.to_str().unwrap()]),
        &["missing/run.csv: cannot be written", "the folder does not exist"],
    );
    let kind = folder.path().join("run.mat");
    assert_refused(&pliant(&["simulate", "tests/scenes/windy.toml", "--out", kind.to_str().unwrap()]), &["neither"]);
    let is_folder = folder.path().join("folder.csv");
    std::fs::create_dir(&is_folder).unwrap();
    assert_refused(&pliant(&["simulate", "tests/scenes/windy.toml", "--out", is_folder.to_str().unwrap()]), &["mixed up"]);
    assert_eq!(entries(folder.path()), 1);
}

#[test]
fn a_failed_simulation_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let scene = changed(folder.path(), "sliding.toml", "[time]", "[solver]\nmax_iterations = 1\nmax_halvings = 0\n[time]");
    let out = folder.path().join("run.csv");
    std::fs::write(&out, "old").unwrap();
    let output = pliant(&["simulate", scene.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("step 0: not converged") && message.contains("fix: shorten `time.step`"), "{message}");
    assert!(output.stdout.is_empty());
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
    assert_eq!(entries(folder.path()), 2);
}

#[test]
fn mistakes_in_scenes_are_located() {
    let folder = tempfile::tempdir().unwrap();
    let scene = changed(folder.path(), "windy.toml", "length", "lenght");
    for command in ["simulate", "gradcheck"] {
        assert_refused(&pliant(&[command, scene.to_str().unwrap()]), &["unknown key `lenght`", "did you mean `length`?"]);
        assert_refused(&pliant(&[command, "missing.toml"]), &["missing.toml: cannot be read"]);
    }
    assert_eq!(pliant(&["simulate"]).status.code(), Some(2));
    assert_eq!(pliant(&["juggle"]).status.code(), Some(2));
}

#[test]
fn gradcheck_reports_every_block() {
    let arguments = ["gradcheck", "tests/scenes/windy.toml", "--steps", "5"];
    let output = pliant(&[&arguments[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    let report = json(&output);
    for key in ["worst_relative_error", "taylor_slope", "dot_test", "contact_switches"] {
        assert!(report[key].is_number(), "{key}");
    }
    assert_eq!(report["pass"], true);
    assert_eq!(report["steps"], 5);
    assert!(report["blocks"].as_array().unwrap().iter().any(|block| block["name"] == "cord.bend_stiffness"));
    let table = text(&pliant(&arguments).stdout);
    assert!(table.starts_with("input") && table.trim_end().ends_with(": pass"), "{table}");
}

#[test]
fn the_schema_describes_the_experiment_too() {
    let schema = json(&pliant(&["schema", "scene"]));
    assert_eq!(schema["$defs"]["Rope"]["properties"]["length"]["description"], "Rest length [m].");
    assert!(schema["$defs"]["Marker"]["properties"]["columns"].is_object());
}
