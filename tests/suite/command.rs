//! The command: exit codes, data on stdout, messages on stderr, and files that are complete or absent.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub(crate) fn pliant(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments).output().unwrap()
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

pub(crate) fn json(output: &Output) -> Value {
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

pub(crate) fn entries(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

/// Exit code 2, nothing on stdout, and the four parts of an error on stderr.
pub(crate) fn assert_refused(output: &Output, parts: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for part in ["error: ", "\n  likely cause: ", "\n  fix: "].iter().chain(parts) {
        assert!(message.contains(part), "{part:?} is not in {message}");
    }
}

/// A cable with a clip is written, reads back and runs; sizes that make no sense are refused.
#[test]
fn cables() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("cable.toml");
    let path = out.to_str().unwrap();
    let sizes =
        ["cable", "--links", "5", "--position", "-0.2", "0", "0.01", "--clip", "0", "0", "0", "-0.1", "--floor", "-0.003"];
    let written = pliant(&[&sizes[..], &["--out", path]].concat());
    assert_eq!(written.status.code(), Some(0), "{}", text(&written.stderr));
    assert_eq!(text(&pliant(&sizes).stdout).trim_end(), std::fs::read_to_string(&out).unwrap().trim_end());
    let scene = std::fs::read_to_string(&out).unwrap();
    assert!(scene.contains("name = \"cable_4\"") && scene.contains("name = \"clip_0_right\""), "{scene}");
    let short = scene.replace("duration = 1.0", "duration = 0.05");
    std::fs::write(&out, short).unwrap();
    assert_eq!(pliant(&["simulate", path]).status.code(), Some(0));
    assert_refused(&pliant(&["cable", "--links", "100"]), &["cable.links: 100 links are 0.00375 m long", "fewer links"]);
}

/// Trajectories hold the history variables of joints and motors under their names.
#[test]
fn trajectories_have_internal_variables() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run.csv");
    let output = pliant(&["simulate", "tests/scenes/arm_plastic.toml", "--json", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let csv = std::fs::read_to_string(&out).unwrap();
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (header, first) = (lines.next().unwrap(), lines.next().unwrap());
    let start = |name: &str| first[header.iter().position(|h| *h == name).unwrap()];
    assert_eq!([start("shoulder.plastic[1]"), start("elbow.plastic"), start("wrist.plastic[2]")], ["-0.2", "0", "-0.1"]);
    assert!(lines.all(|line| line.len() == header.len()));
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

/// Sheets count and are written as ropes are; a mesh is found beside its scene.
#[test]
fn simulate_writes_sheets() {
    let folder = tempfile::tempdir().unwrap();
    let grid = "grid = { nodes = [9, 6], size = [0.4, 0.25], diagonal = \"down\" }\nu_axis = [1, 0, 0]\nv_axis = [0, 0, -1]";
    let scene = changed(folder.path(), "cloth_hung.toml", grid, "mesh = \"square.obj\"");
    let text_of = std::fs::read_to_string(&scene).unwrap().replace("nodes = [48]", "nodes = [1]").replace("0.25", "0.05");
    std::fs::write(&scene, text_of).unwrap();
    let mesh = "v 0 0 0\nv 0.2 0 0\nv 0.2 0.2 0\nv 0 0.2 0\nf 1 2 3 4\n";
    std::fs::write(folder.path().join("square.obj"), mesh).unwrap();
    let out = folder.path().join("run.npz");
    let output = pliant(&["simulate", scene.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert!(output.status.success() && text(&output.stdout).contains("4 nodes, 10 steps"), "{}", text(&output.stderr));
    let mut npz = ndarray_npy::NpzReader::new(std::fs::File::open(&out).unwrap()).unwrap();
    let position: ndarray::Array3<f64> = npz.by_name("sheet.position").unwrap();
    let velocity: ndarray::Array3<f64> = npz.by_name("sheet.velocity").unwrap();
    assert_eq!((position.shape(), velocity.shape()), (&[11, 4, 3][..], &[11, 4, 3][..]));
    std::fs::write(folder.path().join("square.obj"), mesh.replace("f 1 2 3 4", "f 1 2 3 5")).unwrap();
    assert_refused(&pliant(&["simulate", scene.to_str().unwrap()]), &["square.obj:5: cloth[0].mesh: the face names vertex 5"]);
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
    let scene =
        changed(folder.path(), "pile_explodes_2.toml", "[time]", "[solver]\nmax_iterations = 1\nmax_halvings = 0\n[time]");
    let out = folder.path().join("run.csv");
    std::fs::write(&out, "old").unwrap();
    let output = pliant(&["simulate", scene.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains(": not converged after") && message.contains("fix: shorten `time.step`"), "{message}");
    assert!(output.stdout.is_empty());
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
    assert_eq!(entries(folder.path()), 2);
}

/// Half a period of a sine from −π/2 on is twice its amplitude: more than a number holds.
#[test]
fn an_impossible_command_is_an_input_error() {
    let folder = tempfile::tempdir().unwrap();
    let motion = "motion = { kind = \"sine\", amplitude = [1e308, 0, 0], frequency = 50.0, phase = -1.5707963267948966 }";
    let scene = changed(folder.path(), "edge_clamp.toml", "motion = { kind = \"hold\" }", motion);
    for command in ["simulate", "gradcheck"] {
        let output = pliant(&[command, scene.to_str().unwrap()]);
        assert_refused(&output, &["step 0: gripper `clamp`: control 0 is inf", "impossible target"]);
    }
}

#[test]
fn mistakes_in_scenes_are_located() {
    let folder = tempfile::tempdir().unwrap();
    let scene = changed(folder.path(), "windy.toml", "length", "lenght");
    for command in ["simulate", "gradcheck"] {
        assert_refused(&pliant(&[command, scene.to_str().unwrap()]), &["unknown key `lenght`", "did you mean `length`?"]);
        assert_refused(&pliant(&[command, "missing.toml"]), &["missing.toml: cannot be read"]);
    }
    let inside = folder.path().join("scene.toml");
    std::fs::copy(&scene, &inside).unwrap();
    let whole = folder.path().to_str().unwrap();
    assert_refused(&pliant(&["simulate", whole]), &["is a folder", &format!("write {}", inside.display())]);
    std::fs::remove_file(&inside).unwrap();
    assert_refused(&pliant(&["diagnose", whole]), &["is a folder", "write the path of the scene's file"]);
    assert_eq!(pliant(&["simulate"]).status.code(), Some(2));
    assert_eq!(pliant(&["juggle"]).status.code(), Some(2));
}

#[test]
fn gradcheck_reports_every_block() {
    let arguments = ["gradcheck", "tests/scenes/windy.toml", "--steps", "5"];
    let output = pliant(&[&arguments[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    let report = json(&output);
    for key in ["worst_relative_error", "taylor_slope", "dot_test", "switches"] {
        assert!(report[key].is_number(), "{key}");
    }
    let blocks = report["blocks"].as_array().unwrap();
    assert_eq!((&report["schema_version"], &report["verdict"]), (&2.into(), &"pass".into()));
    assert!(report["judged"] == blocks.len() && report["total"] == blocks.len() && blocks[0]["reason"].is_null());
    assert_eq!(report["steps"], 5);
    assert!(blocks.iter().any(|block| block["name"] == "cord.bend_stiffness"));
    let longer = json(&pliant(&["gradcheck", "tests/scenes/edge_clamp.toml", "--steps", "22", "--json"]));
    assert_eq!((&longer["steps"], &longer["verdict"]), (&22.into(), &"pass".into()), "two more than its duration has");
    let table = text(&pliant(&arguments).stdout);
    assert!(table.starts_with("input") && table.trim_end().ends_with(" blocks judged over 5 steps; verdict: pass"), "{table}");
}

/// A delay of whole steps is a kink of the map: no difference judges it.
#[test]
fn an_inconclusive_gradcheck_exits_with_three() {
    let folder = tempfile::tempdir().unwrap();
    let scene = changed(folder.path(), "arm_actuators.toml", "delay = 0.0123", "delay = 0.01");
    let output = pliant(&["gradcheck", scene.to_str().unwrap(), "--steps", "5"]);
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stdout));
    let (table, message) = (text(&output.stdout), text(&output.stderr));
    assert!(table.trim_end().ends_with("; inconclusive: shoulder_servo.delay; verdict: inconclusive"), "{table}");
    assert!(
        message.starts_with("block 1 of ")
            && message.contains("\nshoulder_servo.delay: ")
            && message.contains("switches within the smallest difference"),
        "{message}"
    );
}

#[test]
fn the_schema_describes_the_experiment_too() {
    let schema = json(&pliant(&["schema", "scene"]));
    assert_eq!(schema["$defs"]["Rope"]["properties"]["length"]["description"], "Rest length [m].");
    assert!(schema["$defs"]["Marker"]["properties"]["columns"].is_object());
    let schema = json(&pliant(&["schema", "diagnosis"]));
    assert!(schema["properties"]["verdict"].is_object() && schema["$defs"]["Estimate"].is_object());
    assert!(schema["properties"]["unidentifiable"]["description"].as_str().unwrap().contains("their bounds"));
    for object in ["Gain", "Estimate"] {
        let interval = &schema["$defs"][object]["properties"]["interval"];
        assert!(interval["type"].to_string().contains("null"), "{object}: {interval}");
    }
    let schema = json(&pliant(&["schema", "fit"]));
    assert!(schema["properties"]["warnings"]["description"].is_string());
}

/// Paths of keys without description.
fn silent(schema: &Value, path: &str, out: &mut Vec<String>) {
    for (key, value) in schema["properties"].as_object().into_iter().flatten() {
        let path = format!("{path}.{key}");
        if value["description"].is_null() && value["const"].is_null() {
            out.push(path.clone());
        }
        silent(value, &path, out);
    }
    for branch in ["oneOf", "anyOf"].iter().flat_map(|list| schema[list].as_array().into_iter().flatten()) {
        silent(branch, path, out);
    }
    for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
        silent(definition, name, out);
    }
}

#[test]
fn every_key_of_a_task_is_described() {
    let output = pliant(&["schema", "task"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let mut schema = json(&output);
    let silent_keys = |schema: &Value| {
        let mut out = Vec::new();
        silent(schema, "task", &mut out);
        out
    };
    assert_eq!(silent_keys(&schema), [""; 0]);
    assert!(schema["properties"]["horizon"]["description"].is_string());
    let nodes = schema["$defs"]["Cost"]["oneOf"].as_array_mut().unwrap();
    let nodes = nodes.iter_mut().find(|branch| branch["properties"]["kind"]["const"] == "nodes").unwrap();
    assert_eq!(nodes["properties"]["weight"]["description"], "Weight [1/m²].");
    nodes["properties"]["weight"]["description"] = Value::Null;
    assert_eq!(silent_keys(&schema), ["Cost.weight"], "the check sees a key without a description");
}

/// The built-in example's files in a folder; a text in one of them replaced.
fn example(folder: &Path, file: &str, from: &str, to: &str) -> String {
    let origin = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/hidden_effect");
    for entry in std::fs::read_dir(origin).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), folder.join(entry.file_name())).unwrap();
    }
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    assert!(text.contains(from), "{from}");
    std::fs::write(folder.join(file), text.replacen(from, to, 1)).unwrap();
    folder.join("scene.toml").to_str().unwrap().to_owned()
}

#[test]
fn mistakes_in_experiments_and_logs_are_located() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let diagnose = |scene: &str| pliant(&["diagnose", scene, "--out", out.to_str().unwrap()]);
    let scene = example(folder.path(), "scene.toml", "gripper = \"left\"\ncolumns", "gripper = \"left\"\ncolums");
    assert_refused(&diagnose(&scene), &["unknown key `colums`", "did you mean `columns`?"]);
    let scene = example(folder.path(), "run2.csv", "\n0.00000,", "\n0.00000,x");
    assert_refused(&diagnose(&scene), &["run2.csv:2"]);
    assert_refused(&pliant(&["fit", &scene]), &["run2.csv:2"]);
    let scene = example(folder.path(), "scene.toml", "cable.bend_stiffness", "cable.bend_stifness");
    assert_refused(&pliant(&["fit", &scene]), &["cable.bend_stifness", "cable.bend_stiffness"]);
    for (from, to, parts) in [
        ("cable.bend_stiffness", "sensor.foo", ["scene.toml:92: experiment.fit.free[0].path", "`sensor.bias[0]`"]),
        (
            "role = \"held_out\"",
            "role = \"fit\"\n[[experiment.record]]\nfile = \"run1.csv\"",
            ["record[3].file", "keep one of the two"],
        ),
    ] {
        let scene = example(folder.path(), "scene.toml", from, to);
        assert_refused(&pliant(&["fit", &scene]), &parts);
        assert_refused(&diagnose(&scene), &parts);
    }
    let scene = example(folder.path(), "scene.toml", "", "");
    let held_out = folder.path().join("run3.csv");
    assert_refused(
        &pliant(&["fit", &scene, "--log", held_out.to_str().unwrap()]),
        &["run3.csv: record", "scene.toml:88: experiment.record[2].file"],
    );
    let log = folder.path().join("missing.csv");
    let scene = example(folder.path(), "scene.toml", "", "");
    assert_refused(&pliant(&["fit", &scene, "--log", log.to_str().unwrap()]), &["missing.csv: cannot be read"]);
    assert!(!out.exists());
    assert_refused(&diagnose("tests/scenes/windy.toml"), &["no [experiment]"]);
}

#[test]
fn a_report_never_replaces_what_is_not_one() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("thesis.tex"), "years").unwrap();
    assert_refused(&pliant(&["diagnose", "--out", folder.path().to_str().unwrap()]), &["holds `thesis.tex`"]);
    let missing = folder.path().join("missing/report");
    assert_refused(&pliant(&["diagnose", "--out", missing.to_str().unwrap()]), &["does not exist"]);
    assert_eq!(entries(folder.path()), 1);
    assert_eq!(pliant(&["diagnose", "--log", "run.csv"]).status.code(), Some(2), "a log needs its scene");
    assert_eq!(pliant(&["diagnose", "--threads", "0"]).status.code(), Some(2));
}

#[test]
fn fit_prints_estimates() {
    let output = pliant(&["fit", "examples/hidden_effect/scene.toml", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report = json(&output);
    assert_eq!(report["parameters"][0]["path"], "cable.bend_stiffness");
    assert!(report["parameters"][0]["estimate"].as_f64().unwrap() > 0.0 && report["rmse_fit"].is_number());
}

#[test]
fn the_built_in_example_is_diagnosed_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let output = pliant(&["diagnose", "--json", "--seed", "1", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let diagnosis = json(&output);
    for key in ["verdict", "reason", "causes", "candidates", "gain", "remainder", "noise", "audit", "stages"] {
        assert!(!diagnosis[key].is_null(), "{key}");
    }
    for file in ["report.html", "diagnosis.json", "scene_extended.toml", "reproduce.toml", "example/run3.csv"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    assert_eq!(entries(folder.path()), 1, "nothing is left beside the report");
    // The extended scene is a scene, and finds its logs.
    let extended = out.join("scene_extended.toml");
    assert!(pliant(&["simulate", extended.to_str().unwrap()]).status.success());
    assert!(std::fs::read_to_string(&extended).unwrap().contains("file = \"example/run1.csv\""));
    // A fit of it frees what was found beside what was free, stays there, and is as far from the records held out.
    let refitted = json(&pliant(&["fit", extended.to_str().unwrap(), "--json"]));
    let found = &diagnosis["causes"][0]["parameters"][0];
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
    let whole = diagnosis["gain"].as_array().unwrap().last().unwrap();
    assert_eq!(refitted["parameters"][1]["path"], found["path"]);
    assert!((number(&refitted["parameters"][1], "estimate") / number(found, "estimate") - 1.0).abs() < 1e-4, "{refitted}");
    assert!((number(&refitted, "rmse_held_out") / number(whole, "rmse_after") - 1.0).abs() < 1e-4, "{refitted}");
    // The page can be made again from the rest, the copied example included.
    let page = std::fs::read(out.join("report.html")).unwrap();
    std::fs::remove_file(out.join("report.html")).unwrap();
    let again = pliant(&["report", out.to_str().unwrap(), "--svg", folder.path().join("figures").to_str().unwrap()]);
    assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
    assert_eq!(std::fs::read(out.join("report.html")).unwrap(), page);
    assert!(folder.path().join("figures/curve_1.svg").is_file());
    // and its figures be drawn, by a program that can and where there is a font
    let pictures = folder.path().join("pictures");
    let drawn = pliant(&["report", out.to_str().unwrap(), "--png", pictures.to_str().unwrap()]);
    let refusals = ["built without them", "there is no font"];
    if cfg!(not(feature = "png")) || text(&drawn.stderr).contains(refusals[1]) {
        assert_refused(&drawn, &["figures as PNG: ", refusals[usize::from(cfg!(feature = "png"))]]);
        assert!(!pictures.exists());
    } else {
        assert_eq!(drawn.status.code(), Some(0), "{}", text(&drawn.stderr));
        assert_eq!(entries(&pictures), entries(&folder.path().join("figures")));
        let picture = std::fs::read(pictures.join("curve_1.png")).unwrap();
        assert!(picture.starts_with(b"\x89PNG") && picture.len() > 5000, "{}", picture.len());
    }
    assert_eq!(pliant(&["report", folder.path().to_str().unwrap()]).status.code(), Some(2));
}

/// A diagnosis without its times.
fn timeless(mut diagnosis: Value) -> Value {
    for key in ["wall_s", "parts"] {
        assert!(diagnosis.as_object_mut().unwrap().remove(key).is_some());
    }
    diagnosis
}

/// Interrupted once it has finished something, a diagnosis goes on from there and says the same; with other inputs, or with a file that is
/// damaged, it begins anew and says why.
#[test]
fn an_interrupted_diagnosis_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let scene = example(folder.path(), "scene.toml", "", "");
    let out = folder.path().join("report");
    let progress = out.join("progress.json");
    let arguments = |seed: &'static str| ["diagnose", &scene, "--json", "--seed", seed, "--out", out.to_str().unwrap()];
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    let null = std::process::Stdio::null;
    let mut child = command.args(arguments("0")).stdout(null()).stderr(null()).spawn().unwrap();
    let so_far = loop {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was interrupted");
        let read = std::fs::read_to_string(&progress).ok();
        // it is there whole whenever it is there
        let so_far: Option<Value> = read.map(|text| serde_json::from_str(&text).unwrap());
        match so_far.filter(|so_far| so_far["states"]["round"].is_string()) {
            Some(so_far) => break so_far,
            None => std::thread::sleep(std::time::Duration::from_millis(5)),
        }
    };
    // harder than Ctrl-C, which a shell's background jobs ignore
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    assert_eq!((&so_far["schema_version"], &so_far["causes"][0]["name"]), (&1.into(), &"internal_damping".into()));
    assert!(so_far["baseline"]["rmse"].as_f64().unwrap() > 0.0 && so_far["rounds"].is_array());
    let schema = json(&pliant(&["schema", "progress"]));
    let described = schema["properties"].as_object().unwrap();
    assert!(so_far.as_object().unwrap().keys().all(|key| described.contains_key(key)));
    let kept = std::fs::read(&progress).unwrap();

    let resumed = pliant(&arguments("0"));
    let said = text(&resumed.stderr);
    assert!(said.contains("goes on with an interrupted diagnosis, which had accepted one cause"), "{said}");
    assert!(out.join("report.html").is_file() && !progress.exists());
    assert_eq!(entries(&out), 4);

    std::fs::write(&progress, &kept[..kept.len() / 2]).unwrap();
    let anew = pliant(&arguments("0"));
    let said = text(&anew.stderr);
    assert!(said.contains("progress.json: is damaged") && said.contains("begins anew"), "{said}");
    assert_eq!(timeless(json(&resumed)), timeless(json(&anew)));

    std::fs::write(&progress, &kept).unwrap();
    let other = pliant(&arguments("1"));
    let said = text(&other.stderr);
    assert!(said.contains("changed since: the options: the diagnosis begins anew"), "{said}");
    assert_eq!(other.status.code(), Some(0), "{said}");
}

#[test]
fn import_writes_a_scene_that_simulates_and_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("arm.toml");
    let output = pliant(&["import", "tests/models/arm7.xml", "--json", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report = json(&output);
    assert_eq!((&report["schema_version"], &report["joints"], &report["actuators"]), (&1.into(), &7.into(), &7.into()));
    assert!(report["entries"].as_array().unwrap().iter().all(|e| e["line"].is_number() && e["verdict"].is_string()));
    assert!(pliant(&["simulate", out.to_str().unwrap()]).status.success());

    let output = pliant(&["import", "tests/models/crane.urdf"]);
    assert!(text(&output.stdout).contains("name = \"boom\"") && text(&output.stderr).contains("crane.urdf:52: limit \"luff\""));
    assert_refused(&pliant(&["import", "tests/scenes/windy.toml"]), &["tests/scenes/windy.toml:1: is not valid XML"]);
}
