//! `pliant plan` and `pliant mpc`, with the example of a rope that is carried over a bar.

use crate::command::{assert_refused, entries, json, pliant, text};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

const TASK: &str = "examples/carry/task.toml";

/// The example in a folder, with texts replaced in its task and its scene; the path of the task.
fn example(folder: &Path, in_task: [&str; 2], in_scene: [&str; 2]) -> String {
    let origin = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/carry");
    for (file, [from, to]) in [("task.toml", in_task), ("scene.toml", in_scene)] {
        let text = std::fs::read_to_string(origin.join(file)).unwrap();
        assert!(text.contains(from), "{from}");
        std::fs::write(folder.join(file), text.replacen(from, to, 1)).unwrap();
    }
    folder.join("task.toml").to_str().unwrap().to_owned()
}

fn done(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    json(output)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A path in a folder, as a text.
fn at(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

#[test]
fn a_plan_is_found_written_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let [out, inputs, view] = ["motion.csv", "inputs.csv", "motion.html"].map(|name| at(folder.path(), name));
    let planned = done(&pliant(&["plan", TASK, "--json", "--out", &out, "--inputs", &inputs, "--view", &view]));
    assert_eq!((&planned["schema_version"], &planned["steps"], &planned["step_s"]), (&1.into(), &60.into(), &0.02.into()));
    assert_eq!(
        (&planned["status"], &planned["surrogate"]),
        (&"stalled".into(), &false.into()),
        "the rope leaves the bar: a kink"
    );
    assert!(number(&planned["cost"]) + number(&planned["penalty"]) < 0.5 * number(&planned["cost_before"]), "{planned:#}");
    let search = planned["search"].as_array().unwrap();
    assert!(search.len() > 2 && search[0]["cost"] == planned["cost_before"] && search[0]["rollouts"].is_number());
    assert!(number(&planned["rollouts"]) > search.len() as f64 && number(&planned["wall_s"]) > 0.0);
    for (key, path) in [("out", &out), ("inputs", &inputs), ("view", &view)] {
        assert_eq!(planned[key], path.as_str());
    }
    assert_eq!(entries(folder.path()), 3, "no temporary file is left");
    let log = std::fs::read_to_string(&inputs).unwrap();
    assert!(log.starts_with("t,hand.velocity.x,hand.velocity.y,hand.velocity.z\n0,") && log.lines().count() == 61, "{log}");
    let motion = std::fs::read_to_string(&out).unwrap();
    assert!(motion.starts_with("t,rope.node[0].x,") && motion.lines().count() == 62);
    let page = std::fs::read_to_string(&view).unwrap();
    assert!(page.contains("<title>scene</title>") && page.contains("pliant plan"));

    let again = done(&pliant(&["plan", TASK, "--json", "--guess", &inputs, "--iterations", "0"]));
    let (cost, before) = (number(&planned["cost"]), number(&again["cost_before"]));
    assert!((cost - before).abs() <= 1e-12 * cost, "{cost} is {before} when it is read back");
    assert_eq!(
        (&again["status"], &again["search"], &again["rollouts"]),
        (&"iterations".into(), &Value::Array(Vec::new()), &1.into())
    );
    assert_eq!(again["violations"], planned["violations"]);
}

#[test]
fn a_summary_says_how_it_ended_and_what_is_violated() {
    let folder = tempfile::tempdir().unwrap();
    let output = pliant(&["plan", TASK]);
    let said = text(&output.stdout);
    assert!(said.contains("60 steps of 0.02 s\ncost ") && said.contains(" -> ") && said.contains("\nstalled: "), "{said}");
    assert!(said.trim_end().ends_with("all constraints hold"), "{said}");

    let limited = done(&pliant(&["plan", TASK, "--json", "--time-limit", "1e-9"]));
    assert_eq!(
        (&limited["status"], &limited["cost"], &limited["rollouts"]),
        (&"time".into(), &limited["cost_before"], &1.into())
    );
    let short = done(&pliant(&["plan", TASK, "--json", "--steps", "5", "--iterations", "2", "--tolerance", "0"]));
    assert_eq!((&short["steps"], short["search"].as_array().unwrap().len()), (&5.into(), 2));
    assert_eq!(short["status"], "iterations");
    let smoothed = done(&pliant(&["plan", TASK, "--json", "--steps", "5", "--rest-gap", "1e-3", "--iterations", "1"]));
    assert_eq!((&smoothed["surrogate"], &smoothed["search"][0]["rest_gap"]), (&true.into(), &1e-3.into()));

    // a price of almost nothing: the rope goes straight through the margin
    let cheap = example(folder.path(), ["radius = 0.034\nprice = 100.0", "radius = 0.06\nprice = 1e-9"], ["", ""]);
    let output = pliant(&["plan", &cheap]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let listed = said.split("VIOLATED: the plan breaks ").nth(1).unwrap();
    assert_eq!(listed.matches("\n  by ").count(), 5, "{said}");
    assert!(listed.contains("\n  and ") && listed.contains("node") && listed.contains("\"rope\""), "{said}");
    let output = pliant(&["plan", &cheap, "--json"]);
    let violations = done(&output)["violations"].as_array().unwrap().clone();
    let by: Vec<f64> = violations.iter().map(|v| number(&v["by"])).collect();
    assert!(by.len() > 5 && by.is_sorted_by(|a, b| a >= b) && violations[0]["constraint"].is_string());
    assert!(text(&output.stderr).contains(&format!("warning: the plan violates {} constraint(s)", by.len())));
}

#[test]
fn mistakes_in_tasks_are_located() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, parts) in [
        (
            "object = \"rope\"",
            "object = \"rpoe\"",
            ["cost[0].object: there is no rope or cloth \"rpoe\"", "did you mean \"rope\"?"],
        ),
        ("hand.velocity.x", "hand.velocty.x", ["there is no input \"hand.velocty.x\"", "did you mean \"hand.velocity.x\"?"]),
        ("weight = 0.5", "wieght = 0.5", ["unknown key `wieght`", "did you mean `weight`?"]),
        (
            "line = { from",
            "nodes = [0, 1]\ngoal = [[0, 0, 0]]\n# ",
            ["cost[0].goal: has 1 entries instead of 2", "write 2 entries"],
        ),
        ("{ from =", "{ form =", ["cost[0].line.form: unknown key `form`", "did you mean `from`?"]),
        ("line = {", "line = 3 # {", ["cost[0].line: is the whole number 3, not a table", "write a table"]),
        ("line = {", "# {", ["cost[0]: none of the keys goal, line is given", ""]),
        ("\"scene.toml\"", "\"scnee.toml\"", ["task.toml:3: scene: cannot be read", "check the path"]),
        ("lower = -0.5", "lower = 0.6", ["limit[1].upper: is 0.5, but must lie between 0.6 and inf", "wrong order"]),
        ("steps = 60", "steps = 0", ["steps", "must be positive"]),
        ("horizon = 20", "horizon = 20_000_000_000", ["horizon: is 2e10, but must lie between 1 and 10000000", "wrong order"]),
        ("horizon = 20", "horizon = 61", ["horizon: is 61, but must lie between 1 and 60", ""]),
    ] {
        let task = example(folder.path(), [from, to], ["", ""]);
        for command in ["plan", "mpc"] {
            assert_refused(&pliant(&[command, &task]), &parts);
        }
    }
    for command in ["plan", "mpc"] {
        assert_refused(&pliant(&[command, "missing.toml"]), &["missing.toml: cannot be read"]);
    }
}

#[test]
fn mistakes_in_guesses_are_located() {
    let folder = tempfile::tempdir().unwrap();
    let guess = at(folder.path(), "guess.csv");
    let refused = |text: String, parts: &[&str]| {
        std::fs::write(&guess, text).unwrap();
        assert_refused(&pliant(&["plan", TASK, "--guess", &guess]), parts);
    };
    let row = |cells: &str, count: usize| format!("{cells}\n").repeat(count);
    let header = "hand.velocity.x,hand.velocity.y,hand.velocity.z\n";
    let typing = header.replace("velocity.z", "velocity.zz");
    refused(typing + &row("0,0,0", 60), &["there is no input \"hand.velocity.zz\"", "did you mean \"hand.velocity.z\"?"]);
    refused(header.to_owned() + &row("0,0,0", 59), &["has 59 rows, but the plan has 60 steps", "--steps 59"]);
    refused(header.to_owned() + &row("0,0", 60), &["guess.csv:2: the row has 2 cells, but the header 3"]);
    refused(header.to_owned() + &row("0,0,0", 30) + &row("0,NaN,0", 30), &["guess.csv:32: column hand.velocity.y: is NaN"]);
    refused("hand.velocity.x\n".to_owned() + &row("0", 60), &["input \"hand.velocity.y\" has no column"]);
    let missing = at(folder.path(), "missing.csv");
    assert_refused(&pliant(&["plan", TASK, "--guess", &missing]), &["missing.csv: cannot be read"]);

    std::fs::write(&guess, header.to_owned() + &row("0.1,0,0.7", 60)).unwrap();
    let output = pliant(&["plan", TASK, "--guess", &guess, "--iterations", "0"]);
    assert!(output.status.success() && text(&output.stderr).contains("60 inputs lie outside of their limits"));
}

#[test]
fn mistakes_in_arguments_are_refused_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = at(folder.path(), "inputs.npz");
    for command in ["plan", "mpc"] {
        assert_refused(&pliant(&[command, TASK, "--inputs", &inputs]), &["inputs.npz: does not end in .csv"]);
        let missing = at(folder.path(), "missing/inputs.csv");
        assert_refused(&pliant(&[command, TASK, "--inputs", &missing]), &["the folder does not exist"]);
        assert_eq!(pliant(&[command, TASK, "--steps", "0"]).status.code(), Some(2));
    }
    for (arguments, reason) in [
        (["plan", TASK, "--tolerance", "-1"], "must not be negative"),
        (["plan", TASK, "--time-limit", "0"], "must be positive"),
        (["plan", TASK, "--rest-gap", "nan"], "must be finite"),
        (["mpc", TASK, "--disturbance", "-0.1"], "must not be negative"),
        (["mpc", TASK, "--seed", "1"], "--disturbance"),
        (["mpc", TASK, "--tubes", "--json"], "--disturbance"),
    ] {
        let output = pliant(&arguments);
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains(reason), "{arguments:?}: {message}");
    }
    assert_eq!(entries(folder.path()), 0);
}

/// A solver that may not iterate fails within a few steps; whatever was written before stays.
#[test]
fn a_simulation_that_fails_is_a_failure_of_the_numerics() {
    let folder = tempfile::tempdir().unwrap();
    let solver = "[solver]\nmax_iterations = 1\nmax_halvings = 0\n[time]";
    let task = example(folder.path(), ["", ""], ["[time]", solver]);
    let scene = at(folder.path(), "scene.toml");
    let out = at(folder.path(), "motion.csv");
    std::fs::write(&out, "old").unwrap();
    for (arguments, what) in [
        (vec!["plan", &task], "task.toml: the rollout of the first guess fails: step "),
        (
            vec!["mpc", &task, "--plant", "examples/carry/scene.toml"],
            "the controller failed 3 time(s) in a row, the last time at step ",
        ),
        (vec!["mpc", TASK, "--plant", &scene], "the plant has not answered for 1 step(s) in a row, the last of them step "),
    ] {
        let output = pliant(&[&arguments[..], &["--out", &out]].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(
            message.contains(what) && message.contains("not converged") && message.contains("fix: shorten `time.step`"),
            "{message}"
        );
        assert!(output.stdout.is_empty());
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
    }
}

#[test]
fn a_closed_loop_comes_close_to_the_goal_and_reports_itself() {
    let folder = tempfile::tempdir().unwrap();
    let [out, inputs, view] = ["motion.npz", "inputs.csv", "motion.html"].map(|name| at(folder.path(), name));
    let found = done(&pliant(&["mpc", TASK, "--json", "--out", &out, "--inputs", &inputs, "--view", &view]));
    assert_eq!((&found["schema_version"], &found["steps"], &found["horizon"]), (&1.into(), &60.into(), &20.into()));
    let stages = found["stage_costs"].as_array().unwrap();
    assert_eq!((stages.len(), &stages[60]), (61, &found["final_stage_cost"]));
    let sum: f64 = stages.iter().map(number).sum();
    assert!((sum - number(&found["cost"])).abs() < 1e-12 * sum);
    let updates = found["updates"].as_array().unwrap();
    assert!(updates.len() == 60 && updates.iter().all(|u| u["cost"].is_number() && u["tightening"].is_null()));
    let time = &found["update_s"];
    assert!(0.0 < number(&time["mean"]) && number(&time["p95"]) <= number(&time["worst"]));
    assert!(found["stalled"].is_number() && found["failed"].as_array().unwrap().is_empty() && found["seed"].is_null());
    assert_eq!(entries(folder.path()), 3);
    assert_eq!(std::fs::read_to_string(&inputs).unwrap().lines().count(), 61);

    // the inputs that the loop applied lead the undisturbed plant through the same states
    let replayed = done(&pliant(&["plan", TASK, "--json", "--guess", &inputs, "--iterations", "0"]));
    let (cost, again) = (number(&found["cost"]), number(&replayed["cost"]));
    assert!((cost - again).abs() < 1e-6 * cost, "{cost} in closed loop, {again} by a rollout");

    let said = text(&pliant(&["mpc", TASK, "--steps", "4", "--horizon", "5"]).stdout);
    for part in ["4 steps of 0.02 s in closed loop, 5 ahead\n", "of the end alone", "95 % at most", "stalled, 0 failed\n"] {
        assert!(said.contains(part), "{part:?} is not in {said}");
    }
}

#[test]
fn disturbances_are_drawn_by_seed_and_tubes_tighten() {
    let loops = |more: &[&str]| {
        let fixed = ["mpc", TASK, "--json", "--steps", "6", "--horizon", "6", "--disturbance", "2e-4"];
        done(&pliant(&[&fixed[..], more].concat()))
    };
    let [one, same, other] = [loops(&["--seed", "1"]), loops(&["--seed", "1"]), loops(&["--seed", "2"])];
    assert_eq!(one["stage_costs"], same["stage_costs"]);
    assert_ne!(one["stage_costs"], other["stage_costs"]);
    assert_eq!((&one["seed"], &one["tubes"], &one["disturbance"]), (&1.into(), &false.into(), &2e-4.into()));
    let tubes = loops(&["--seed", "1", "--tubes"]);
    let updates = tubes["updates"].as_array().unwrap();
    assert!(updates.iter().all(|u| number(&u["tightening"]) > 0.0 && u["tube_violations"].is_number()), "{tubes:#}");
    assert!(updates.iter().all(|u| u["switches"].as_array().unwrap().is_empty()));
    let said = text(&pliant(&["mpc", TASK, "--steps", "2", "--horizon", "4", "--disturbance", "1e-4", "--tubes"]).stdout);
    assert!(
        said.contains("with tubes, disturbed by up to 0.0001 m a step (seed 0)") && said.contains("tubes tighten by at most")
    );
}

#[test]
fn a_plant_of_its_own_has_the_states_and_inputs_of_the_task() {
    let folder = tempfile::tempdir().unwrap();
    let plant = at(folder.path(), "scene.toml");
    let short = ["mpc", TASK, "--steps", "3", "--horizon", "4", "--plant", &plant];
    for (from, to, what) in [
        ("nodes = 9", "nodes = 8", "the plant has 48 numbers of state (nx), but the task's scene has 54"),
        ("mode = \"velocity\"", "mode = \"velocity\"\n[[gripper]]\nname = \"left\"\nrope = \"rope\"\nnodes = [8]", "inputs (nu)"),
        ("step = 0.02", "step = 0.01", "the plant's `time.step` is 0.01 s, but that of the task's scene is 0.02 s"),
    ] {
        example(folder.path(), ["", ""], [from, to]);
        assert_refused(&pliant(&short), &["scene.toml", what]);
    }
    example(folder.path(), ["", ""], ["linear_density = 0.05", "linear_density = 0.08"]);
    let costs = |arguments: &[&str]| done(&pliant(&[arguments, &["--json"]].concat()))["stage_costs"].clone();
    let (heavier, same) = (costs(&short), costs(&short[..6]));
    assert_ne!(heavier, same, "the plant is heavier than the model of the controller");
    let missing = at(folder.path(), "missing.toml");
    assert_refused(&pliant(&["mpc", TASK, "--plant", &missing]), &["missing.toml: cannot be read"]);
}

/// A task with sensors: the plant gives readings of its nodes, late and with noise, and the controller has no other knowledge.
#[test]
fn a_task_with_sensors_is_run_on_their_readings() {
    let folder = tempfile::tempdir().unwrap();
    let sensing = "[sensing]\ndelay = 2\nsensor = [{ kind = \"nodes\", object = \"rope\", noise = 5e-4 }]\n[[cost]]";
    let task = example(folder.path(), ["[[cost]]", sensing], ["", ""]);
    let fixed = ["mpc", &task, "--steps", "6", "--horizon", "6", "--disturbance", "1e-4", "--rest-gap", "1e-3"];
    let found = done(&pliant(&[&fixed[..], &["--tubes", "--json"]].concat()));
    let nodes = number(&found["readings"]) / 3.0;
    assert!(nodes >= 3.0 && nodes.fract() == 0.0 && number(&found["delay"]) == 2.0, "{found:#}");
    assert!(found["failed"].as_array().unwrap().is_empty());
    let updates = found["updates"].as_array().unwrap();
    assert!(updates.iter().all(|u| number(&u["tightening"]) > 0.0), "{updates:#?}");
    let said = text(&pliant(&fixed).stdout);
    assert!(said.contains("numbers 2 step(s) late"), "{said}");
    let wrong = example(folder.path(), ["[[cost]]", &sensing.replace("\"rope\"", "\"rop\"")], ["", ""]);
    assert_refused(&pliant(&["mpc", &wrong]), &["sensing.sensor[0].object", "did you mean \"rope\""]);
}
