//! Initial states as the data have them.

use approx::assert_relative_eq;
use pliant_identify::log::Setup;
use pliant_identify::shooting::{Plan, state_at};
use pliant_scene::Source;
use std::fmt::Write;
use tempfile::TempDir;

const SCENE: &str = r#"schema_version = 1
[time]
step = 0.005
duration = 1.0
integrator = "midpoint"
[[body]]
name = "rotor"
mass = 1.0
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[[body.joint]]
name = "axle"
kind = "revolute"
axis = [0, 0, 1]
[experiment]
time = { column = "t" }
[[experiment.joint]]
joint = "axle"
column = "angle"
[[experiment.record]]
file = "log.csv"
role = "fit"
[experiment.fit]
free = [{ path = "axle.damping", lower = 0.0, upper = 1.0 }]
"#;

#[test]
fn a_link_that_has_turned_round_many_times_starts_where_it_is_and_as_fast_as_it_is() {
    let (angle, speed) = (-143.0, -50.0);
    let folder = TempDir::new().unwrap();
    let mut log = "t,angle\n".to_owned();
    for k in 0..=100 {
        let t = 0.005 * k as f64;
        writeln!(log, "{t},{:.9}", angle + speed * t).unwrap();
    }
    std::fs::write(folder.path().join("log.csv"), log).unwrap();
    let setup = Setup::from_source(Source::new("scene.toml", SCENE), folder.path().to_owned()).unwrap();
    let plan = Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap();
    let record = &plan.fitted[0].record;
    for sample in [0, 40, 100] {
        let start = state_at(&plan, record, sample).unwrap();
        assert_relative_eq!(start.mean.q[0], angle + speed * 0.005 * sample as f64, epsilon = 1e-6);
        assert_relative_eq!(start.mean.v[0], speed, epsilon = 1e-4);
    }
}

/// What is read with another zero of the sensor is another state, that the same prior holds: or it would speak against a wrong zero.
#[test]
fn a_start_follows_the_zero_of_the_sensor_that_it_was_read_from() {
    for (quantity, place) in [("", 0), ("measures = \"velocity\"\n", 1)] {
        let folder = TempDir::new().unwrap();
        let log: String = (0..=100).map(|k| format!("{},0.3\n", 0.005 * k as f64)).collect();
        std::fs::write(folder.path().join("log.csv"), format!("t,angle\n{log}")).unwrap();
        let text = SCENE.replace("column = \"angle\"\n", &format!("column = \"angle\"\n{quantity}"));
        let setup = Setup::from_source(Source::new("scene.toml", text), folder.path().to_owned()).unwrap();
        let plan = Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap();
        let start = &plan.fitted[0].start;
        let begins = |bias: f64| {
            let state = start.state(&plan.model, &[[bias, 1.0, 0.0, 0.0]]);
            [state.q[0], state.v[0]]
        };
        assert_relative_eq!(begins(0.0)[place], 0.3, epsilon = 1e-6);
        assert_relative_eq!(begins(0.02)[place], 0.28, epsilon = 1e-6);
        assert_eq!(begins(0.02)[1 - place], begins(0.0)[1 - place]);
    }
}
