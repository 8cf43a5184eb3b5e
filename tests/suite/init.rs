//! `pliant init`: from a model and logs to a verdict, and every way in which they do not fit together.

use crate::command::{assert_refused, entries, json, pliant, text};
use std::path::Path;

const MODEL: &str = "examples/arm_log/arm.urdf";
const LOGS: [&str; 3] = ["examples/arm_log/run1.csv", "examples/arm_log/run2.csv", "examples/arm_log/run3.csv"];

/// Arguments of `init` with a model and logs.
fn arguments<'a>(model: &'a str, logs: &[&'a str], out: &'a str) -> Vec<&'a str> {
    let given = logs.iter().flat_map(|log| ["--log", log]);
    ["init", "--model", model, "--out", out].into_iter().chain(given).collect()
}

/// A log of a few samples with this header.
fn log(folder: &Path, name: &str, header: &str) -> String {
    // clocks count up by 10, and so do the others, in a smaller unit
    let clock = |name: &str| name.starts_with('t') && name != "turn" && name != "temperature";
    let cell = |k: usize, name: &str| if clock(name) { format!("{}", 10 * k) } else { format!("0.00{k:02}") };
    let row = |k: usize| header.split(',').map(|name| cell(k, name)).collect::<Vec<_>>().join(",");
    let path = folder.join(name);
    std::fs::write(&path, format!("{header}\n{}\n", (0..24).map(row).collect::<Vec<_>>().join("\n"))).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The logs are MuJoCo's, of an arm whose elbow has a damping of 0.08 N·m·s/rad that the URDF lacks.
#[test]
fn a_urdf_and_three_logs_become_a_verdict() {
    let around = tempfile::tempdir().unwrap();
    let out = around.path().join("arm");
    let out = out.to_str().unwrap();
    let made = pliant(&arguments(MODEL, &LOGS, out));
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let said = text(&made.stdout);
    for line in
        ["time_ms -> time [ms], by its name", "elbow_pos_deg -> position of elbow [deg]", "motor_elbow", "held out", "next: "]
    {
        assert!(said.contains(line), "{line:?} is not in {said}");
    }
    let scene = format!("{out}/scene.toml");
    let found = json(&pliant(&["diagnose", &scene, "--json", "--out", &format!("{out}/report")]));
    assert_eq!((&found["verdict"], &found["causes"][0]["name"]), (&"named".into(), &"viscous_friction".into()));
    let damping = &found["causes"][0]["parameters"][0];
    assert_eq!(damping["path"], "elbow.damping");
    assert!((damping["estimate"].as_f64().unwrap() / 0.08 - 1.0).abs() < 0.01, "{damping}");
    // The scene is somebody's now.
    assert_refused(&pliant(&arguments(MODEL, &LOGS, out)), &["is there already", "--force"]);
    assert_eq!(pliant(&[&arguments(MODEL, &LOGS, out)[..], &["--force"]].concat()).status.code(), Some(0));
    // One that has an experiment is not given another.
    let again = format!("{out}/again");
    assert_refused(&pliant(&arguments(&scene, &LOGS, &again)), &["has an [experiment] already"]);
}

/// Of a dozen samples a log the same, less sharply.
#[test]
fn short_logs_become_a_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let thinned = |log: &str| {
        let text = std::fs::read_to_string(log).unwrap();
        let rows: Vec<&str> = text.lines().skip(1).step_by(15).take(12).collect();
        let path = folder.path().join(Path::new(log).file_name().unwrap());
        std::fs::write(&path, format!("{}\n{}\n", text.lines().next().unwrap(), rows.join("\n"))).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let logs = LOGS.map(thinned);
    let out = folder.path().join("arm").to_str().unwrap().to_owned();
    let made = pliant(&arguments(MODEL, &logs.each_ref().map(String::as_str), &out));
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let found = json(&pliant(&["diagnose", &format!("{out}/scene.toml"), "--json"]));
    assert_eq!((&found["verdict"], &found["causes"][0]["name"]), (&"named".into(), &"viscous_friction".into()));
    let [low, high] = [0, 1].map(|end| found["causes"][0]["parameters"][0]["interval"][end].as_f64().unwrap());
    assert!(low < 0.08 && 0.08 < high && high - low < 0.03, "{low} {high}");
}

/// The arm with stops at which it never arrives is simulated as that without; a stop that is reached stays.
#[test]
fn stops_that_no_reading_comes_near_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let stops = |low: f64, high: f64| {
        let urdf = std::fs::read_to_string(MODEL).unwrap().replace("continuous", "revolute");
        let limit = format!("<limit lower=\"{low}\" upper=\"{high}\" effort=\"1\" velocity=\"1\"/></joint>");
        let path = folder.path().join("arm.urdf");
        std::fs::write(&path, urdf.replace("</joint>", &limit)).unwrap();
        let out = folder.path().join("arm");
        let logs: Vec<&str> = std::iter::once("--log").chain(LOGS).collect();
        let start = ["init", "--model", path.to_str().unwrap(), "--force", "--out", out.to_str().unwrap()];
        let made = pliant(&[&start[..], &logs[..]].concat());
        assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
        (text(&made.stdout), std::fs::read_to_string(out.join("scene.toml")).unwrap())
    };
    let (said, scene) = stops(-6.0, 6.0);
    assert!(said.contains("stops left out, as no reading comes near them: shoulder, elbow"), "{said}");
    assert!(scene.contains("integrator = \"midpoint\"") && !scene.contains("limits"), "{scene}");
    let (said, scene) = stops(-0.2, 6.0);
    assert!(said.contains("`euler`, of first order"), "{said}");
    assert!(scene.contains("integrator = \"euler\"") && scene.contains("limits"), "{scene}");
}

#[test]
fn logs_that_do_not_fit_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let out = at.join("arm");
    let out = out.to_str().unwrap();
    let good = log(at, "good.csv", "t,shoulder,elbow");
    let mistakes = [
        ("a.csv", "shoulder,elbow", "no column is the time; there are shoulder, elbow"),
        ("a.mcap", "", "python -m pliant.logs"),
        ("b.csv", "t,time,elbow", "columns `t` and `time` both look like the time"),
        ("c.csv", "t,wrist", "no column names a joint of the model: columns t, wrist; joints shoulder, elbow"),
        ("d.csv", "t,elbow_torque", "no column names a joint of the model"),
        ("e.csv", "t,elbow_pos,elbow_q", "columns `elbow_pos` and `elbow_q` both belong to elbow"),
        ("f.csv", "t,elbow,elbow_q_deg", "--leave-out \"elbow_q_deg\""),
        ("g.csv", "t,elbow_mm", "is in mm, and joint `elbow` turns"),
    ];
    for (name, header, said) in mistakes {
        assert_refused(&pliant(&arguments(MODEL, &[&log(at, name, header)], out)), &[name, said]);
    }
    let other = log(at, "other.csv", "t,elbow,wrist");
    assert_refused(&pliant(&arguments(MODEL, &[&good, &other], out)), &["other.csv", "it has wrist and lacks shoulder"]);
    let other = log(at, "other.csv", "t_ms,elbow,shoulder");
    assert_refused(&pliant(&arguments(MODEL, &[&good, &other], out)), &["other.csv", "has other columns"]);
    assert_refused(&pliant(&arguments(MODEL, &["missing.csv"], out)), &["missing.csv", "cannot be read"]);
    assert_refused(&pliant(&arguments("missing.urdf", &[&good], out)), &["missing.urdf"]);
    std::fs::write(at.join("still.csv"), format!("t,elbow\n{}", "1,0\n".repeat(24))).unwrap();
    assert_refused(
        &pliant(&arguments(MODEL, &[at.join("still.csv").to_str().unwrap()], out)),
        &["still.csv:3: column t", "stands still"],
    );
    let before = entries(at);
    assert!(!Path::new(out).exists() && before == mistakes.len() + 3, "{before}");
}

/// Motors of a model are kept where a column commands them.
#[test]
fn motors_without_a_command_are_left_out_of_an_imported_model() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let motor = |joint: &str| format!("<motor name=\"{joint}_motor\" joint=\"{joint}\"/>");
    let body = "<body><joint name=\"lift\" type=\"slide\" axis=\"0 0 1\"/><geom type=\"sphere\" size=\"0.1\" mass=\"1\"/>\
                <body pos=\"0 0 1\"><joint name=\"turn\" axis=\"0 1 0\"/><geom type=\"sphere\" size=\"0.1\" pos=\"0.2 0 0\" mass=\"1\"/></body></body>";
    let model = format!(
        "<mujoco><option gravity=\"0 0 0\"/><worldbody>{body}</worldbody><actuator>{}{}</actuator></mujoco>",
        motor("lift"),
        motor("turn")
    );
    let path = at.join("lift.xml");
    std::fs::write(&path, model).unwrap();
    let out = at.join("made");
    let run = log(at, "run.csv", "time,lift_pos_mm,turn,lift_motor,temperature");
    let made = pliant(&arguments(path.to_str().unwrap(), &[&run], out.to_str().unwrap()));
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let said = text(&made.stdout);
    for line in [
        "actuators left out, as no column commands them: turn_motor",
        "time -> time [ms], by the size of its differences",
        "lift_pos_mm -> position of lift [mm]",
        "left out, as they name nothing in the model: temperature",
        "a single log: nothing is held out",
    ] {
        assert!(said.contains(line), "{line:?} is not in {said}");
    }
    let scene = std::fs::read_to_string(out.join("scene.toml")).unwrap();
    assert!(scene.contains("actuator = \"lift_motor\"") && !scene.contains("turn_motor"), "{scene}");
    // A torque is no command of a servo.
    let servo = std::fs::read_to_string(&path).unwrap().replace("<motor name=\"turn", "<position kp=\"5\" name=\"turn");
    std::fs::write(&path, servo).unwrap();
    let torques = log(at, "torques.csv", "time,lift,turn,lift_motor,turn_torque");
    let made = pliant(&arguments(path.to_str().unwrap(), &[&torques], at.join("servo").to_str().unwrap()));
    assert!(text(&made.stdout).contains("no column commands them: turn_motor"), "{}", text(&made.stderr));
    // What it is told may have the name of its joint.
    let targets = log(at, "targets.csv", "time,lift,turn,lift_motor,turn_target_rad");
    let told = at.join("told");
    let made = pliant(&arguments(path.to_str().unwrap(), &[&targets], told.to_str().unwrap()));
    assert!(text(&made.stdout).contains("turn_target_rad -> command of turn_motor [rad]"), "{}", text(&made.stderr));
    let servo = std::fs::read_to_string(told.join("scene.toml")).unwrap();
    assert!(servo.contains("columns = [\"turn_target_rad\"]\nangle_unit = \"rad\""), "{servo}");
    // A scene of one's own keeps its motors, and each needs a command.
    let own = at.join("own.toml");
    let start = scene.find("[experiment]").unwrap();
    std::fs::write(&own, format!("{}\n[[actuator]]\nname = \"extra\"\njoint = \"turn\"\nkind = \"torque\"\n", &scene[..start]))
        .unwrap();
    let refused = pliant(&arguments(own.to_str().unwrap(), &[&run], at.join("second").to_str().unwrap()));
    assert_refused(&refused, &["no column has the command of actuator `extra` at joint `turn`", "`turn_torque`"]);
    let servo = std::fs::read_to_string(&own).unwrap().replace("kind = \"torque\"\n", "kind = \"position\"\nstiffness = 5.0\n");
    std::fs::write(&own, servo).unwrap();
    let refused = pliant(&arguments(own.to_str().unwrap(), &[&run], at.join("third").to_str().unwrap()));
    assert_refused(&refused, &["no column has the command of actuator `extra` at joint `turn`", "`turn_cmd`"]);
}

/// What `init` says of a log in a file of its own, and the scene that it writes.
struct Made {
    status: Option<i32>,
    said: String,
    errors: String,
    scene: String,
}

/// `init` on a log of this text, or on several, given by their paths in a folder.
fn made(logs: &[(&str, String)], more: &[&str]) -> Made {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    logs.iter().for_each(|(name, text)| std::fs::write(path(name), text).unwrap());
    let paths: Vec<String> = logs.iter().map(|(name, _)| path(name)).collect();
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let out = path("arm");
    let output = pliant(&[&arguments(MODEL, &paths, &out)[..], more].concat());
    let scene = std::fs::read_to_string(path("arm/scene.toml")).unwrap_or_default();
    let here = format!("{}/", folder.path().display());
    let [said, errors] = [&output.stdout, &output.stderr].map(|bytes| text(bytes).replace(&here, ""));
    Made { status: output.status.code(), said, errors, scene }
}

/// The text of a log of 24 rows at 100 Hz of an arm that moves a little: the clock in ms, then `columns` numbers.
fn rows(header: &str, columns: usize) -> String {
    let cells = |k: usize| (0..columns).map(|c| format!(",{:.4}", 0.1 * ((k + c) as f64 * 0.2).sin())).collect::<String>();
    format!("{header}\n{}", (0..24).map(|k| format!("{}{}\n", 10 * k, cells(k))).collect::<String>())
}

fn one(text: String, more: &[&str]) -> Made {
    made(&[("run.csv", text)], more)
}

#[test]
fn torques_are_read_in_the_units_and_words_of_their_names() {
    for (name, unit) in [
        ("torque_mNm", "mNm"),
        ("torque_Nmm", "Nmm"),
        ("torque_Ncm", "Ncm"),
        ("torque [N·m]", "Nm"),
        ("torque_N_m", "Nm"),
        ("cmd_torque", ""),
        ("effort_cmd", ""),
        ("torque_cmd_Nm", "Nm"),
    ] {
        let made = one(rows(&format!("t_ms,shoulder,elbow,shoulder_{name},elbow_{name}"), 4), &[]);
        assert_eq!(made.status, Some(0), "{name}: {}", made.errors);
        assert_eq!(made.scene.matches("[[experiment.input]]").count(), 2, "{}", made.scene);
        assert_eq!(made.scene.contains(&format!("torque_unit = \"{unit}\"")), !unit.is_empty(), "{name}: {}", made.scene);
    }
    // one that was measured drives, not the one that was wanted
    let made = one(rows("t_ms,shoulder,elbow,elbow_effort_cmd,elbow_effort", 4), &[]);
    assert!(made.said.contains("elbow_effort_cmd: left out") && made.said.contains("elbow_effort -> command"), "{}", made.said);
    assert!(made.said.contains("taken to be passive, as no column drives them: shoulder\n"), "{}", made.said);
    let wrong = one(rows("t_ms,elbow,elbow_torque_deg", 2), &[]);
    assert!(
        wrong.errors.contains("is in deg, and joint `elbow` turns") && wrong.errors.contains("Nm, Ncm, Nmm, mNm"),
        "{}",
        wrong.errors
    );
}

/// An undriven arm would be diagnosed instead of the one that ran.
#[test]
fn columns_that_may_drive_are_not_left_out_silently() {
    for name in ["tau2", "elbow_current_A", "ElbowTargetPos", "force_sensor_x", "u1"] {
        let text = rows(&format!("t_ms,elbow,{name}"), 2);
        let refused = one(text.clone(), &[]);
        assert_eq!(refused.status, Some(2), "{name}");
        for part in [&format!("column `{name}`"), "nothing else drives joint `elbow`", "`elbow_torque_Nm`", "--leave-out \""] {
            assert!(refused.errors.contains(part), "{part:?} is not in {}", refused.errors);
        }
        let made = one(text, &["--leave-out", name]);
        assert_eq!(made.status, Some(0), "{name}: {}", made.errors);
        assert!(made.said.starts_with("no motor: "), "{}", made.said);
        assert!(made.said.contains(&format!("left out, as you said: {name}\n")), "{}", made.said);
    }
    // beside the torque of the same joint they cannot be what drives it
    let made = one(rows("t_ms,elbow,elbow_tau,elbow_current_A,elbow_pos_des", 4), &[]);
    assert!(made.said.contains("left out, as they name nothing in the model: elbow_current_A, elbow_pos_des"), "{}", made.errors);
    let unknown = one(rows("t_ms,elbow", 1), &["--leave-out", "elbwo"]);
    assert!(unknown.errors.contains("no log has a column `elbwo` to leave out; there are t_ms, elbow"), "{}", unknown.errors);
}

#[test]
fn missing_readings_are_allowed_and_missing_torques_are_not() {
    let text = rows("t_ms,shoulder,elbow,elbow_torque", 3);
    // rows 7 and 9 of the file
    let cut = |column: usize, value: &str| {
        let row = |(k, line): (usize, &str)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if k == 6 || k == 8 {
                cells[column] = value;
            }
            cells.join(",") + "\n"
        };
        text.lines().enumerate().map(row).collect::<String>()
    };
    for value in ["", "NaN"] {
        let made = one(cut(2, value), &[]);
        assert_eq!(made.status, Some(0), "{}", made.errors);
        assert!(made.said.contains("elbow: missing readings: 2, the first at run.csv:7;"), "{}", made.said);
        assert_eq!(made.scene.matches("may_be_missing = true").count(), 1, "{}", made.scene);
    }
    let made = one(cut(3, ""), &[]);
    assert!(made.errors.contains("run.csv:7: column elbow_torque") && made.errors.contains("the command that was in force"));
    let none = text.lines().enumerate().map(|(k, line)| if k == 0 { format!("{line}\n") } else { format!("{},,0,0\n", 10 * k) });
    let made = one(none.collect(), &[]);
    assert!(
        made.errors.contains("column `shoulder`: has no number in any row") && made.errors.contains("--leave-out \"shoulder\"")
    );
}

/// Causes and fixes are those of a log, its names and its path, for there is no scene that could be changed.
#[test]
fn fixes_are_possible_without_a_scene() {
    let scaled = |factor: f64| {
        let row = |k: usize| format!("{},{},0\n", 10 * k, factor * (0.3 * k as f64).sin());
        format!("t_ms,elbow_pos,shoulder\n{}", (0..24).map(row).collect::<String>())
    };
    let good = scaled(1.0);
    let lines: Vec<&str> = good.lines().collect();
    let reversed = format!("{}\n{}\n", lines[0], lines[1..].iter().rev().copied().collect::<Vec<_>>().join("\n"));
    let commas = good.replace(',', ";").replace('.', ",").replacen("0;0", "0,0;0", 1);
    let cases = [
        (scaled(100.0), "moves over 199.4 rad|rename the column `elbow_pos_deg`"),
        (good.replace("t_ms", "t_s"), "rename the column `t_s` after its unit: `time_ms`"),
        (good.replace("t_ms", "t_us"), "shorter than lead_in|rename the column `t_us` after its unit"),
        (reversed, "run.csv:3: column t_ms|runs backwards from 0.230000 s|in reverse order"),
        (commas, "run.csv:2: column t_ms|\"0,0\" is not a number|decimal commas|decimal points"),
        (format!("{}\n0,1,0,2,0\n", lines[0]).replace("0,1,0,2,0", "0,1,0,2,0,3"), "6 cells instead of 3|decimal commas"),
        (format!("{}\n", lines[0]), "run.csv: |0 samples; at least 10|has a header and no rows"),
        (lines[..10].join("\n"), "run.csv:10: column t_ms|9 samples; at least 10"),
        (lines[1..].join("\n"), "its first row has numbers|without a header"),
    ];
    for (text, parts) in cases {
        let made = one(text, &[]);
        assert_eq!(made.status, Some(2), "{parts}");
        for part in parts.split('|') {
            assert!(made.errors.contains(part), "{part:?} is not in {}", made.errors);
        }
        for wrong in ["angle_unit", "may_be_missing", "arm/", ".."] {
            assert!(!made.errors.contains(wrong), "{wrong:?} is in {}", made.errors);
        }
    }
    let twice = made(&[("a.csv", good.clone()), ("b.csv", good.clone())], &[]);
    assert!(twice.errors.contains("b.csv: record b.csv has the same times and readings as record a.csv"), "{}", twice.errors);
}

#[test]
fn clocks_and_columns_are_found_by_name_in_every_log() {
    for (name, factor, unit) in [("timestamp_sec", 0.01, "s"), ("t_secs", 0.01, "s"), ("seconds", 0.01, "s"), ("t_ns", 1e7, "ns")]
    {
        let row = |k: usize| format!("{},{}\n", factor * k as f64, 0.01 * (0.3 * k as f64).sin());
        let made = one(format!("{name},elbow\n{}", (0..24).map(row).collect::<String>()), &[]);
        assert_eq!(made.status, Some(0), "{name}: {}", made.errors);
        assert!(made.scene.contains(&format!("time = {{ column = \"{name}\", unit = \"{unit}\" }}")), "{}", made.scene);
        assert!(made.said.contains("0.23 s at 100 Hz"), "{}", made.said);
    }
    // the header of numpy.savetxt
    let made = one(rows("# bench\n# t_ms, elbow,elbow_tau", 2), &[]);
    assert!(made.status == Some(0) && made.said.contains("elbow_tau -> command of motor_elbow"), "{}", made.errors);
    let orders = [("a.csv", rows("t_ms,elbow,elbow_tau", 2)), ("b.csv", rows("t_ms,elbow_tau,elbow", 2))];
    let made = self::made(&orders, &[]);
    assert_eq!(made.status, Some(0), "{}", made.errors);
    assert!(made.said.contains("a.csv: fitted") && made.said.contains("b.csv: held out"), "{}", made.said);
}
