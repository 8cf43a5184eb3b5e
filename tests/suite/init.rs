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
    std::fs::write(&path, format!("{header}\n{}\n", (0..20).map(row).collect::<Vec<_>>().join("\n"))).unwrap();
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
        ("f.csv", "t_ns,elbow", "counts nanoseconds"),
        ("g.csv", "t,elbow_mm", "is in mm, and joint `elbow` turns"),
    ];
    for (name, header, said) in mistakes {
        assert_refused(&pliant(&arguments(MODEL, &[&log(at, name, header)], out)), &[name, said]);
    }
    let other = log(at, "other.csv", "t,elbow,shoulder");
    assert_refused(&pliant(&arguments(MODEL, &[&good, &other], out)), &["other.csv", "has other columns"]);
    assert_refused(&pliant(&arguments(MODEL, &["missing.csv"], out)), &["missing.csv", "cannot be read"]);
    assert_refused(&pliant(&arguments("missing.urdf", &[&good], out)), &["missing.urdf"]);
    std::fs::write(at.join("still.csv"), "t,elbow\n1,0\n1,0\n").unwrap();
    assert_refused(&pliant(&arguments(MODEL, &[at.join("still.csv").to_str().unwrap()], out)), &["does not count up"]);
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
    // A scene of one's own keeps its motors, and each needs a command.
    let own = at.join("own.toml");
    let start = scene.find("[experiment]").unwrap();
    std::fs::write(&own, format!("{}\n[[actuator]]\nname = \"extra\"\njoint = \"turn\"\nkind = \"torque\"\n", &scene[..start]))
        .unwrap();
    let refused = pliant(&arguments(own.to_str().unwrap(), &[&run], at.join("second").to_str().unwrap()));
    assert_refused(&refused, &["no column has the command of actuator `extra` at joint `turn`"]);
}
