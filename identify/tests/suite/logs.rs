//! Logs are read as the experiment maps them, and bad ones are refused with file, line, column and fix.

use ndarray::{Array1, Array3, Array4};
use ndarray_npy::NpzWriter;
use pliant_identify::fit_scene;
use pliant_identify::log::{Beginning, Interpolation, LogError, Logs, Role, Setup, Split};
use pliant_scene::Source;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

const SCENE: &str = r#"schema_version = 1
[time]
step = 0.01
[[rope]]
name = "cable"
nodes = 5
length = 1.0
linear_density = 0.05
stretch_stiffness = 1.0e4
initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
[[gripper]]
name = "left"
rope = "cable"
end = "first"
[[gripper]]
name = "right"
rope = "cable"
nodes = [-1]
mode = "velocity"
"#;

const CSV: &str = r#"[experiment]
initial = "rest"
time = { column = "t", unit = "ms" }
[[experiment.marker]]
rope = "cable"
node = 2
columns = ["m_x", "m_y", "m_z"]
unit = "mm"
[[experiment.input]]
gripper = "right"
columns = ["r_x", "r_y", "r_z"]
unit = "cm"
[[experiment.input]]
gripper = "left"
columns = ["l_x", "l_y", "l_z", "a_x", "a_y", "a_z"]
[experiment.fit]
free = [{ path = "cable.bend_stiffness", lower = 1e-6, upper = 1.0 }]
[[experiment.record]]
file = "run.csv"
"#;

const NPZ: &str = r#"[experiment]
time = { rate = 100.0 }
[[experiment.marker]]
rope = "cable"
arc = 0.35
index = 1
may_be_missing = true
[[experiment.marker]]
rope = "cable"
node = -2
index = -2
[[experiment.input]]
gripper = "left"
indices = [0, 2]
[[experiment.input]]
gripper = "right"
indices = [-1]
[[experiment.record]]
file = "logs.npz"
array = "train"
role = "fit"
skip = [1]
[[experiment.record]]
file = "logs.npz"
array = "eval"
role = "held_out"
"#;

struct Case {
    folder: TempDir,
    scene: String,
}

impl Case {
    fn new(experiment: &str) -> Self {
        Self { folder: TempDir::new().unwrap(), scene: format!("{SCENE}{experiment}") }
    }

    /// A CSV case with these lines of a good log replaced.
    fn csv(edit: impl Fn(&mut Vec<String>)) -> Self {
        let case = Self::new(CSV);
        case.write("run.csv", edit);
        case
    }

    fn write(&self, name: &str, edit: impl Fn(&mut Vec<String>)) {
        let mut lines = vec!["t,m_x,m_y,m_z,l_x,l_y,l_z,a_x,a_y,a_z,r_x,r_y,r_z".to_owned()];
        for k in 0..20 {
            let mut line = format!("{}", 500 + 10 * k);
            for value in [500.0, f64::from(k), -30.0, 0.0, 0.0, 0.001 * f64::from(k), 1.0, 0.0, 0.0, 1.0, 2.0, f64::from(k)] {
                write!(line, ",{value}").unwrap();
            }
            lines.push(line);
        }
        edit(&mut lines);
        fs::write(self.path(name), lines.join("\n")).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The scene with a text replaced.
    #[track_caller]
    fn with(mut self, old: &str, new: &str) -> Self {
        assert!(self.scene.contains(old), "{old}");
        self.scene = self.scene.replacen(old, new, 1);
        self
    }

    fn setup(&self) -> Result<Setup, LogError> {
        Setup::from_source(Source::new("scene.toml", self.scene.clone()), self.folder.path().to_owned())
    }

    fn logs(&self) -> Result<Logs, LogError> {
        self.setup()?.read_logs(&[])
    }

    /// Checks that the case is refused at this place with these words.
    #[track_caller]
    fn refused(&self, place: &str, parts: &[&str]) {
        let error = self.logs().unwrap_err().to_string();
        let start = format!("{}{}", self.folder.path().display(), std::path::MAIN_SEPARATOR);
        let error = error.replace(&start, "");
        assert!(error.starts_with(&format!("{place}: ")), "{error}");
        assert!(error.contains("\n  likely cause: ") && error.contains("\n  fix: "), "{error}");
        for part in parts {
            assert!(error.contains(part), "no `{part}` in\n{error}");
        }
    }
}

fn points(records: usize, times: usize) -> Array4<f64> {
    Array4::from_shape_fn((records, times, 4, 3), |(r, k, p, a)| {
        0.1 * r as f64 + 0.001 * k as f64 + 0.25 * p as f64 + 0.01 * a as f64
    })
}

fn npz_case(train: &Array4<f64>) -> Case {
    let case = Case::new(NPZ);
    let mut writer = NpzWriter::new_compressed(fs::File::create(case.path("logs.npz")).unwrap());
    writer.add_array("train", &train.mapv(|x| x as f32)).unwrap();
    writer.add_array("eval", &points(2, 15)).unwrap();
    writer.add_array("count", &Array1::from(vec![1_i64, 2])).unwrap();
    writer.add_array("single", &Array3::<f64>::zeros((12, 4, 3))).unwrap();
    writer.finish().unwrap();
    case
}

#[test]
fn csv_in_si_units_and_model_order() {
    let case = Case::csv(|_| {});
    let logs = case.logs().unwrap();
    assert_eq!((logs.split, logs.records.len()), (Split::NothingHeldOut, 1));
    let record = &logs.records[0];
    assert_eq!((record.name.as_str(), record.time.len(), record.time[0]), ("run.csv", 20, 0.0));
    assert!((record.duration() - 0.19).abs() < 1e-12);
    assert_eq!(record.markers[3], [[0.5, 0.003, -0.03]]);
    assert_eq!(record.inputs[4], [0.0, 0.0, 0.004, 1.0, 0.0, 0.0, 0.01, 0.02, 0.04]);
    assert_eq!(record.phase, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5]);
    assert_eq!(case.setup().unwrap().experiment.initial, Beginning::Rest);
}

#[test]
fn the_command_line_adds_records() {
    let case = Case::csv(|_| {});
    case.write("more.csv", |lines| lines[5] = lines[5].replacen("-30", "-31", 1));
    let logs = case.setup().unwrap().read_logs(&[case.path("more.csv")]).unwrap();
    assert_eq!((logs.split, logs.held_out().count()), (Split::EveryFourth, 1));
}

#[test]
fn a_measurement_is_read_once() {
    let twice = |role: &str| format!("[[experiment.record]]\nfile = \"copy.csv\"\nrole = \"{role}\"\n");
    for role in ["fit", "held_out"] {
        let mut case = Case::csv(|_| {});
        case.write("copy.csv", |lines| lines.insert(0, "# under another name".into()));
        case.scene += &twice(role);
        let first = "the same times and readings as record run.csv (scene.toml:38: experiment.record[0].file)";
        case.refused("scene.toml:40: experiment.record[1].file", &["record copy.csv", first, "keep one of the two"]);
    }
    let case = Case::csv(|_| {});
    let error = case.setup().unwrap().read_logs(&[case.path("run.csv")]).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: record ", case.path("run.csv").display())), "{error}");
}

#[test]
fn semicolons_and_comments() {
    let case = Case::csv(|lines| {
        *lines = lines.iter().map(|line| line.replace(',', "; ")).collect();
        lines.insert(0, "# a comment, with a comma".into());
    });
    assert_eq!(case.logs().unwrap().records[0].inputs[4][2], 0.004);
}

#[test]
fn npz_records() {
    let mut train = points(3, 20);
    train[[2, 7, 1, 0]] = f64::NAN;
    let logs = npz_case(&train).logs().unwrap();
    let names: Vec<&str> = logs.records.iter().map(|record| record.name.as_str()).collect();
    assert_eq!(names, ["logs.npz/train[0]", "logs.npz/train[2]", "logs.npz/eval[0]", "logs.npz/eval[1]"]);
    assert_eq!((logs.split, logs.held_out().count()), (Split::Declared, 2));
    assert!(logs.records[1].markers[7][0][0].is_nan());
    assert_eq!(logs.records[2].role, Role::HeldOut);
    assert_eq!(logs.records[3].inputs[5].len(), 9);
    assert!((logs.records[3].markers[5][1][2] - (0.1 + 0.005 + 0.5 + 0.02)).abs() < 1e-12);
    assert!((logs.records[3].time[14] - 0.14).abs() < 1e-12);
}

#[test]
fn an_experiment_survives_a_round_trip() {
    for text in [CSV, NPZ] {
        let case = Case::new(text);
        let setup = case.setup().unwrap();
        let written = toml::to_string(&setup.to_scene()).unwrap();
        let again = Setup::from_source(Source::new("written.toml", written), PathBuf::new()).unwrap();
        assert_eq!((again.experiment, again.scene), (setup.experiment, setup.scene));
    }
}

/// The cable's experiment with a marker on a sheet.
fn sheet(marker: &str) -> Case {
    let sheet = "[[cloth]]\nname = \"sheet\"\ngrid = { nodes = [4, 3], size = [0.3, 0.2] }\norigin = [0, 0, 1]\nthickness = 1e-3\n\
                 area_density = 0.2\nyoungs_modulus = 1e5\n[experiment]\n";
    Case::csv(|_| ()).with("[experiment]\n", sheet).with("rope = \"cable\"\nnode = 2\n", marker)
}

#[test]
fn markers_of_sheets() {
    assert_eq!(sheet("cloth = \"sheet\"\nnode = 11\n").logs().unwrap().records[0].markers[3], [[0.5, 0.003, -0.03]]);
    let place = "scene.toml:30: experiment.marker[0]";
    sheet("cloth = \"sheet\"\n").refused(place, &["none of the keys `node`"]);
    sheet("cloth = \"sheet\"\nnode = 1\nrope = \"cable\"\n")
        .refused(place, &["more than one of the keys `rope`, `cloth`, `body`"]);
    sheet("cloth = \"shet\"\nnode = 1\n")
        .refused("scene.toml:31: experiment.marker[0].cloth", &["no cloth \"shet\"", "did you mean \"sheet\"?"]);
    let node = "scene.toml:32: experiment.marker[0].node";
    sheet("cloth = \"sheet\"\nnode = 12\n")
        .refused(node, &["cloth \"sheet\" has no node 12: it has 12", "node (i, j) of a grid", "from 0 to 11"]);
    sheet("cloth = \"sheet\"\nnode = -13\n").refused(node, &["has no node -13"]);
    sheet("cloth = \"sheet\"\narc = 0.1\n").refused("scene.toml:32: experiment.marker[0].arc", &["only markers on ropes"]);
    sheet("cloth = \"sheet\"\nnode = 1\noffset = [0, 0]\n")
        .refused("scene.toml:33: experiment.marker[0].offset", &["that twist"]);
    sheet("cloth = \"sheet\"\nnode = 1\n")
        .with("initial = \"rest\"", "initial = \"given\"")
        .refused("scene.toml:28: experiment.initial", &["node 0 of cloth \"sheet\" has no marker", "`initial = \"measured\"`"]);
    // a length of the sheet in mm that is read as m
    sheet("cloth = \"sheet\"\nnode = 1\n")
        .with("unit = \"mm\"", "unit = \"m\"")
        .refused("run.csv: markers", &["500.0000 m", "ropes and cloth are 1.3606 m long", "write `unit = \"mm\"`"]);
}

#[test]
fn clocks() {
    Case::csv(|lines| lines.swap(7, 8))
        .refused("run.csv:9: column t", &["runs backwards from 0.570000 s to 0.560000 s", "sort its rows"]);
    Case::csv(|lines| lines[8] = lines[7].clone()).refused("run.csv:9: column t", &["stands still", "remove one"]);
    Case::csv(|lines| lines[8] = lines[8].replacen("570", "", 1)).refused("run.csv:9: column t", &["is empty", "remove the row"]);
    let seconds = Case::csv(|_| {}).with("unit = \"ms\"", "unit = \"s\"");
    seconds.refused("run.csv:2: column t", &["10.000000 s apart", "1000 steps", "`unit = \"ms\"`"]);
    let microseconds = Case::csv(|_| {}).with("unit = \"ms\"", "unit = \"us\"");
    microseconds.refused("run.csv:2: column t", &["0.000010 s apart", "0.0010 steps", "unit that `time.unit` says"]);
    Case::csv(|lines| lines[8] = lines[8].replacen("570", "1e300", 1))
        .refused("run.csv:10: column t", &["runs backwards from 1.000e297 s to 0.580000 s"]);
}

#[test]
fn periods_and_lengths() {
    Case::csv(|_| {})
        .with("step = 0.01", "step = 0.003")
        .refused("run.csv:2: column t", &["3.3333 steps of 0.003 s", "write `step = 0.0025`"]);
    Case::csv(|_| {}).with("step = 0.01", "step = 0.02").refused("run.csv:2: column t", &["0.5000 steps", "write `step = 0.01`"]);
    Case::csv(|lines| lines.truncate(6)).refused("run.csv:6: column t", &["5 samples", "at least 10"]);
    let free = "[experiment.fit]";
    let segments = Case::csv(|_| {}).with(free, "[experiment.fit]\nsegment = 0.5");
    segments.refused("run.csv:21: column t", &["0.1900 s", "segment = 0.5 s"]);
    Case::csv(|_| {}).with("initial = \"rest\"", "lead_in = 2").refused("run.csv:21: column t", &["lead_in = 2 s"]);
}

#[test]
fn columns() {
    Case::csv(|lines| lines[0] = lines[0].replace("m_y", "m_yy"))
        .refused("run.csv:1", &["no column \"m_y\"", "did you mean \"m_yy\"?", "`r_z`"]);
    Case::csv(|lines| lines[0] = lines[0].replace("m_y", "m_x")).refused("run.csv:1", &["two columns \"m_x\""]);
    Case::csv(|lines| lines[5].push_str(",3")).refused("run.csv:6", &["14 cells instead of 13"]);
    Case::csv(|lines| lines[5] = lines[5].replacen("-30", "low", 1))
        .refused("run.csv:6: column m_z", &["\"low\" is not a number"]);
}

#[test]
fn what_inputs_do_between_samples_is_told() {
    let way = |name: &str| Case::csv(|_| {}).with("initial = \"rest\"", &format!("interpolation = \"{name}\""));
    let read = |case: &Case| case.setup().unwrap().experiment.interpolation;
    assert_eq!(read(&Case::csv(|_| {})), Interpolation::Linear);
    assert_eq!((read(&way("linear")), read(&way("smooth"))), (Interpolation::Linear, Interpolation::Smooth));
    way("cubic").refused("scene.toml:21: experiment.interpolation", &["\"cubic\" is none of \"linear\", \"smooth\""]);
}

#[test]
fn missing_samples() {
    let hole = |lines: &mut Vec<String>| lines[5] = lines[5].replacen("-30", "nan", 1);
    Case::csv(hole).refused("run.csv:6: column m_z", &["is NaN", "`may_be_missing = true`"]);
    let declared = Case::csv(hole).with("unit = \"mm\"", "unit = \"mm\"\nmay_be_missing = true");
    assert!(declared.logs().unwrap().records[0].markers[4][0][2].is_nan());
    Case::csv(|lines| lines[5] = lines[5].replacen("0.004", "inf", 1))
        .refused("run.csv:6: column l_z", &["is infinite", "inputs drive"]);
}

#[test]
fn wrong_unit() {
    let case = Case::csv(|_| {}).with("unit = \"mm\"", "unit = \"m\"");
    case.refused("run.csv: markers", &["500.0000 m", "write `unit = \"mm\"`"]);
}

#[test]
fn arrays() {
    let good = points(3, 20);
    npz_case(&good)
        .with("array = \"train\"", "array = \"trian\"")
        .refused("logs.npz", &["no array \"trian\"", "did you mean \"train\"?"]);
    npz_case(&good).with("array = \"train\"", "array = \"count\"").refused("logs.npz: count", &["float32 or float64"]);
    npz_case(&good).with("array = \"train\"\n", "").refused("logs.npz", &["which array is meant?", "`eval`"]);
    npz_case(&good).with("skip = [1]", "skip = [3]").refused("logs.npz: train", &["no record 3: the array has 3"]);
    npz_case(&good).with("index = -2", "index = 4").refused("logs.npz: train", &["no point 4", "from 0 to 3"]);
    npz_case(&good)
        .with("rate = 100.0", "column = \"t\"")
        .refused("scene.toml:21: experiment.time", &["no `rate`, which npz files need"]);
    npz_case(&good)
        .with("rate = 100.0", "array = \"single\"")
        .refused("logs.npz: single", &["shape [12, 4, 3]", "(records, time)"]);
    let mut lost = good;
    lost[[0, 3, 2, 1]] = f64::NAN;
    npz_case(&lost).refused("logs.npz: train[0], time 3, point 2, y", &["is NaN"]);
}

#[test]
fn files() {
    Case::new(CSV).refused("run.csv", &["cannot be read", "relative to the scene's folder"]);
    Case::csv(Vec::clear).refused("run.csv", &["is empty", "record again"]);
    Case::new(CSV).with("run.csv", "run.mat").refused("run.mat", &["is not a log that pliant reads", "python -m pliant.logs"]);
    Case::new(CSV)
        .with("[[experiment.record]]\nfile = \"run.csv\"\n", "")
        .refused("scene.toml:20: experiment", &["no log", "--log FILE"]);
    Case::csv(|_| {})
        .with("columns = [\"m_x\", \"m_y\", \"m_z\"]", "index = 1")
        .refused("scene.toml:23: experiment.marker[0]", &["which CSV files need"]);
}

#[test]
fn mappings() {
    Case { folder: TempDir::new().unwrap(), scene: SCENE.into() }.refused("scene.toml: experiment", &["no [experiment]"]);
    let place = "scene.toml:23: experiment.marker[0]";
    Case::new(CSV).with("node = 2\n", "").refused(place, &["none of the keys `node`, `arc`"]);
    Case::new(CSV).with("node = 2\n", "node = 2\narc = 0.5\n").refused(place, &["more than one"]);
    Case::new(CSV)
        .with("node = 2\n", "node = 5\n")
        .refused("scene.toml:25: experiment.marker[0].node", &["rope \"cable\" has no node 5: it has 5", "from 0 to 4"]);
    Case::new(CSV).with("node = 2\n", "arc = 500\n").refused("scene.toml:25: experiment.marker[0].arc", &["between 0 and 1 m"]);
    let typo = Case::new(CSV).with("gripper = \"right\"", "gripper = \"rihgt\"");
    typo.refused("scene.toml:29: experiment.input[0].gripper", &["no gripper \"rihgt\"", "did you mean \"right\"?"]);
    let twice = Case::new(CSV)
        .with("gripper = \"right\"", "gripper = \"left\"")
        .with("columns = [\"r_x\", \"r_y\", \"r_z\"]", "indices = [0, 1]");
    twice.refused("scene.toml:32: experiment.input[1]", &["more than one"]);
    let few = Case::new(CSV).with(", \"a_x\", \"a_y\", \"a_z\"", "");
    few.refused("scene.toml:34: experiment.input[1].columns", &["3 columns", "6 inputs", "`left.axis.z`", "list 6 columns"]);
    let none = Case::new(CSV)
        .with("[[experiment.input]]\ngripper = \"right\"\ncolumns = [\"r_x\", \"r_y\", \"r_z\"]\nunit = \"cm\"\n", "");
    none.refused("scene.toml:20: experiment", &["gripper \"right\" has no [[experiment.input]]", "gripper = \"right\""]);
    Case::new(CSV).with("column = \"t\", ", "").refused("scene.toml:22: experiment.time", &["none of the keys"]);
    Case::new(CSV)
        .with("unit = \"mm\"", "unit = \"inch\"")
        .refused("scene.toml:27: experiment.marker[0].unit", &["\"m\", \"cm\", \"mm\""]);
    let error = Case::new(CSV).with("unit = \"mm\"", "unit = \"kg\"").setup().unwrap_err().to_string();
    assert!(error.contains("write one of \"m\", \"cm\", \"mm\"") && !error.contains("did you mean"), "{error}");
    Case::new(CSV).with("node = 2\n", "nod = 2\n").refused("scene.toml:25: experiment.marker[0].nod", &["did you mean `node`?"]);
}

#[test]
fn free_parameters() {
    let field = "scene.toml:36: experiment.fit.free[0]";
    let bounds = Case::new(CSV).with("lower = 1e-6", "lower = 2");
    bounds.refused(&format!("{field}.lower"), &["2 is not below the upper bound 1"]);
    let prior = Case::new(CSV).with("upper = 1.0", "upper = 1.0, prior = { mean = 3, std = 1 }");
    prior.refused(&format!("{field}.prior.mean"), &["is 3", "its bounds"]);
}

/// The error of fitting the good log with another list of free parameters.
fn free_error(list: &str) -> String {
    let case = Case::csv(|_| {}).with("{ path = \"cable.bend_stiffness\", lower = 1e-6, upper = 1.0 }", list);
    let setup = case.setup().unwrap();
    let logs = setup.read_logs(&[]).unwrap();
    let error = fit_scene(&setup, &logs, &mut |_| {}).unwrap_err();
    assert!(error.is_input(), "{error}");
    let error = error.to_string();
    assert!(error.contains("\n  likely cause: ") && error.contains("\n  fix: "), "{error}");
    error
}

#[test]
fn free_parameters_that_the_model_does_not_allow() {
    let field = "scene.toml:36: experiment.fit.free[0]";
    let free = |path: &str, bounds: &str| format!("{{ path = \"{path}\", {bounds} }}");
    let cases = [
        ("cable.bend_stifness", "lower = 0, upper = 1", "path: there is no parameter", "did you mean \"cable.bend_stiffness\"?"),
        ("cable.temperature", "lower = 0, upper = 1", "path: there is no parameter", "`cable.node[*].mass`"),
        ("sensor.foo", "lower = 0, upper = 1", "path: there is no parameter", "`sensor.bias[0]`, `sensor.bias[1]`"),
        ("sensor.bias[*]", "lower = -1, upper = 1", "path: `sensor.bias[*]` would tie", "one by one: `sensor.bias[0]`"),
        ("cable.length", "lower = 2, upper = 3", "lower: the scene's `cable.length` is 1 m, outside its bounds 2 to 3", "widen"),
        ("cable.bend_damping", "lower = -1, upper = 3", "lower: the bound of `cable.bend_damping` is -1", "from 0 to inf"),
    ];
    for (path, bounds, what, fix) in cases {
        let error = free_error(&free(path, bounds));
        assert!(error.starts_with(&format!("{field}.{what}")) && error.contains(fix), "{error}");
    }
    let length = free("cable.length", "lower = 0.5, upper = 2");
    let error = free_error(&format!("{length}, {length}"));
    assert!(error.starts_with("scene.toml:36: experiment.fit.free[1].path: `cable.length` is free already"), "{error}");
    let error = free_error(&format!(
        "{}, {}",
        free("cable.node[*].mass", "lower = 0, upper = 1"),
        free("cable.node[2].mass", "lower = 0, upper = 1")
    ));
    assert!(error.contains("free already, by experiment.fit.free[0], `cable.node[*].mass`"), "{error}");
    let error = free_error("");
    assert!(error.starts_with("scene.toml:35: experiment.fit: lists no free parameter"), "{error}");
}

#[test]
fn something_must_be_left_to_fit_to() {
    let mut case = Case::csv(|_| {});
    case.scene += "role = \"held_out\"\n";
    let setup = case.setup().unwrap();
    let error = fit_scene(&setup, &setup.read_logs(&[]).unwrap(), &mut |_| {}).unwrap_err();
    let error = error.to_string();
    assert!(error.starts_with("scene.toml:39: experiment.record[0].role: every record is held out"), "{error}");
}

#[test]
fn what_is_known_of_the_sensor() {
    let known = "[experiment]\nsensor = { bias = [0, 0, 0.01], time_offset = 0.02 }";
    let sensor = Case::new(CSV).with("[experiment]", known).setup().unwrap().experiment.sensor;
    assert_eq!(sensor.values().0, [0.0, 0.0, 0.01, 1.0, 0.0, 0.0, 0.0, 0.02]);
    let wrong = Case::new(CSV).with("[experiment]", "[experiment]\nsensor = { scale = 1000.0 }");
    wrong.refused("scene.toml:21: experiment.sensor.scale", &["is 1000", "between 0.5 and 2"]);
}
