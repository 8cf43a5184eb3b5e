//! The page of a run: its header, the numbers behind it, and that it needs nothing else.

use pliant::view::{Caption, page};
use pliant::{Case, Rollout, StepOptions, rollout};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn pliant(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pliant"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn simulated(scene: &str) -> Rollout {
    let case = Case::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes").join(scene)).unwrap();
    let options = StepOptions { record: false, ..StepOptions::default() };
    rollout(&case.model, case.model.params().values(), &case.x0, &case.controls, options).unwrap()
}

/// Contents of a page: the header, and the numbers.
struct Read {
    header: Value,
    numbers: Vec<f32>,
}

impl Read {
    fn of(html: &str) -> Self {
        let between = |start: &str| html.split_once(start).unwrap().1.split_once("</script>").unwrap().0;
        let header = serde_json::from_str(between("id=\"header\">")).unwrap();
        let bytes = decoded(between("id=\"numbers\">"));
        assert_eq!(bytes.len() % 4, 0);
        let numbers = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        Self { header, numbers }
    }

    fn array(&self, slice: &Value) -> &[f32] {
        let number = |key: &str| usize::try_from(slice[key].as_u64().unwrap()).unwrap();
        &self.numbers[number("offset")..number("offset") + number("length")]
    }

    fn center(&self, axis: usize) -> f64 {
        self.header["center"][axis].as_f64().unwrap()
    }
}

/// Base64, of a length that needs no care beyond its padding.
fn decoded(coded: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("{c} is no digit"),
    };
    let digits: Vec<u8> = coded.trim().trim_end_matches('=').bytes().map(digit).collect();
    let group = |four: &[u8]| {
        let bits = (0..4).fold(0, |bits, k| bits << 6 | u32::from(four.get(k).copied().unwrap_or(0)));
        bits.to_be_bytes()[1..four.len()].to_vec()
    };
    digits.chunks(4).flat_map(group).collect()
}

#[test]
fn the_page_has_every_simulated_position() {
    let folder = tempfile::tempdir().unwrap();
    let (out, view) = (folder.path().join("run.npz"), folder.path().join("run.html"));
    let paths = [out.to_str().unwrap(), view.to_str().unwrap()];
    let output = pliant(&["simulate", "tests/scenes/sphere_drape.toml", "--json", "--out", paths[0], "--view", paths[1]]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "nothing was left out: {}", text(&output.stderr));
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["view"], paths[1]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary file is left");

    let html = std::fs::read_to_string(&view).unwrap();
    assert!(
        html.contains("<title>sphere_drape</title>") && html.contains("sphere_drape.toml") && html.contains("pliant simulate")
    );
    let read = Read::of(&html);
    let rope = &read.header["ropes"][0];
    assert_eq!((&rope["nodes"], &rope["radius"], &rope["held"]), (&8.into(), &0.004.into(), &serde_json::json!([0])));
    let mut npz = ndarray_npy::NpzReader::new(std::fs::File::open(&out).unwrap()).unwrap();
    let expected: ndarray::Array3<f64> = npz.by_name("cable.position").unwrap();
    let shown = read.array(&rope["positions"]);
    assert_eq!(shown.len(), expected.len());
    for (k, (shown, expected)) in shown.iter().zip(&expected).enumerate() {
        assert!((f64::from(*shown) + read.center(k % 3) - expected).abs() < 1e-7, "number {k}");
    }
    let time = read.array(&read.header["time"]);
    assert_eq!(time.len(), 21);
    assert!((time[20] - 0.2).abs() < 1e-6);
    let energy: ndarray::Array1<f64> = npz.by_name("energy").unwrap();
    let shown = read.array(&read.header["energy"]);
    assert!(shown.iter().zip(&energy).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6 * b.abs()));
    assert_eq!(read.header["solids"][0]["form"], "ball");
    assert_eq!(read.array(&rope["colour"]).len(), 21 * 7, "a strain for each edge");
}

#[test]
fn bodies_are_where_the_model_says() {
    let run = simulated("rope_on_box.toml");
    let made = page(&run, &Caption::default()).unwrap();
    assert_eq!((made.frames, made.states, made.left_out()), (121, 121, None));
    let read = Read::of(&made.html);
    let poses = read.array(&read.header["poses"]);
    for (state, pose) in run.states.iter().zip(poses.chunks_exact(7)) {
        let (position, quaternion) = run.model.body_poses(&state.q)[0];
        for a in 0..3 {
            assert!((f64::from(pose[a]) + read.center(a) - position[a]).abs() < 1e-7);
        }
        assert!(pose[3..].iter().zip(quaternion).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));
    }
    let solids = read.header["solids"].as_array().unwrap();
    let solid = |name: &str| solids.iter().find(|s| s["name"] == name).unwrap();
    assert_eq!((&solid("block.shape[0]")["form"], &solid("block.shape[0]")["body"]), (&"block".into(), &0.into()));
    assert_eq!(solid("post")["sizes"], serde_json::json!([0.03, 0.1]));
    assert_eq!((&solid("floor")["form"], &solid("floor")["body"]), (&"plane".into(), &Value::Null));
    assert_eq!(solids.len(), 3, "nodes are drawn as the rope");
}

/// A capsule between two points has its z axis along them.
#[test]
fn fixed_capsules_point_from_end_to_end() {
    let run = simulated("capsule_drape.toml");
    let read = Read::of(&page(&run, &Caption::default()).unwrap().html);
    let capsule = read.header["solids"].as_array().unwrap().iter().find(|s| s["form"] == "capsule").unwrap();
    let number = |key: &str, k: usize| capsule[key][k].as_f64().unwrap();
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| number("quaternion", k));
    let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    let theta =
        |path: &str| run.theta[run.model.params().find(&format!("{}.{path}", capsule["name"].as_str().unwrap())).unwrap()];
    for (a, along) in axis.iter().enumerate() {
        let end = number("position", a) + read.center(a) + number("sizes", 1) * along;
        assert!((end - theta(&format!("b[{a}]"))).abs() < 1e-12, "axis {a}");
    }
}

#[test]
fn bodies_without_shapes_are_lines() {
    let read = Read::of(&page(&simulated("four_bar.toml"), &Caption::default()).unwrap().html);
    let bones = read.header["bones"].as_array().unwrap();
    let to = |body: usize, mass: bool| {
        let found: Vec<&Value> = bones.iter().filter(|b| b["body"] == body && b["mass"] == mass).map(|b| &b["to"]).collect();
        found.into_iter().cloned().collect::<Vec<_>>()
    };
    assert_eq!(to(0, false), [serde_json::json!([0.0, 0.0, 0.15])], "from the crank to the coupler");
    assert_eq!(to(1, false), [serde_json::json!([0.3, 0.0, 0.1])], "from the coupler to its pin");
    assert!([0, 1, 2].iter().all(|body| to(*body, true).len() == 1), "a centre of mass each");
    assert_eq!(read.header["parents"], serde_json::json!([null, 0, null]));
}

#[test]
fn the_page_needs_nothing_else_and_escapes_every_text() {
    let run = simulated("windy.toml");
    let caption = Caption {
        title: "</script><script>alert(1)".to_owned(),
        scene: "<scene>".to_owned(),
        command: "pliant simulate <scene>".to_owned(),
    };
    let html = page(&run, &caption).unwrap().html;
    for part in ["http:", "https:", "//www", "src=", "<link", "@import", "url(", "import(", "fetch("] {
        assert!(!html.contains(part), "{part:?}");
    }
    assert_eq!(html.matches("<script").count(), 3, "two of data and one of code");
    assert_eq!(html.matches("</script>").count(), 3);
    assert!(html.contains("&lt;scene&gt;") && html.trim_end().ends_with("</html>"));
    assert_eq!(Read::of(&html).header["title"], caption.title.as_str());
}

#[test]
fn states_that_are_left_out_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let view = folder.path().join("cable.html");
    let output = pliant(&["simulate", "examples/hidden_effect/scene.toml", "--view", view.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("126 of 501 states are shown"), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("cable.html"));
    let read = Read::of(&std::fs::read_to_string(&view).unwrap());
    assert!(read.header["note"].as_str().unwrap().starts_with("126 of 501 states"));
    let time = read.array(&read.header["time"]);
    assert_eq!((time.len(), time[125]), (126, 2.5));
}

#[test]
fn what_is_no_page_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("run.mp4");
    let folder_path = folder.path().join("folder.html");
    std::fs::create_dir(&folder_path).unwrap();
    let missing = folder.path().join("missing/run.html");
    for (path, parts) in [
        (&other, ["does not end in .html", "fix: write `--view "]),
        (&folder_path, ["cannot be written", "mixed up"]),
        (&missing, ["cannot be written", "the folder does not exist"]),
    ] {
        let output = pliant(&["simulate", "tests/scenes/windy.toml", "--view", path.to_str().unwrap()]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(output.stdout.is_empty() && parts.iter().all(|part| message.contains(part)), "{message}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_run_without_states_is_refused() {
    let run = Rollout { states: vec![], ..simulated("windy.toml") };
    assert!(page(&run, &Caption::default()).unwrap_err().to_string().starts_with("the run has no states"));
}
