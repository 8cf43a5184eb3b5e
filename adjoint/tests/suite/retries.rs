//! Gradients of steps that were halved because they created energy, and of those that sdirk2 leaves to Euler because contact would be
//! thrown back.

use crate::common::Case;
use crate::judged::demand;
use pliant_engine::step::StepOptions;
use pliant_scene::parse_scene;

/// A rope that falls on a floor at step 14 of 30.
const LANDING: &str = r#"
schema_version = 1
[time]
step = 0.01
duration = 0.3
integrator = "sdirk2"
[[rope]]
name = "it"
nodes = 4
length = 0.3
linear_density = 0.1
stretch_stiffness = 1000.0
bend_stiffness = 1e-3
radius = 0.005
initial = { shape = "straight", from = [0.0, 0.0, 0.105], direction = [1.0, 0.0, 0.02] }
velocity = [0.4, 0.1, 0.0]
[[plane]]
name = "floor"
friction = 0.3
"#;

/// Midpoint stretches this stiff sheet as it swings, unless a step is halved.
const SWINGING: &str = r#"
schema_version = 1
[time]
step = 0.033
duration = 0.066
integrator = "midpoint"
[[cloth]]
name = "it"
grid = { nodes = [2, 3], size = [1.0, 0.9] }
u_axis = [0.32637446198439696, -0.8130980741317023, 0.482]
v_axis = [0.9402382284833763, 0.3316566828153056, -0.07717459713137342]
thickness = 0.006
density = 500.0
youngs_modulus = 2e9
bend_stiffness = 10.0
[[gripper]]
name = "hand"
cloth = "it"
nodes = [1]
"#;

#[test]
fn halved_steps_and_those_left_to_euler_have_exact_gradients() {
    for (what, text, steps) in [("landing", LANDING, 30), ("swinging", SWINGING, 2)] {
        let case = Case::new(&parse_scene(text, "retries.toml").unwrap(), steps);
        let run = case.run(StepOptions::default());
        assert!(run.retries() > 0, "{what}: nothing was taken otherwise");
        demand(what, &case, 1);
    }
}
