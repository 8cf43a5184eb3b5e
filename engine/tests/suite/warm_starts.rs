//! A step is a function of the state, the control and θ: what the steps before it have left for Newton's method to start from changes
//! nothing but its work.

use crate::common::{Case, scene};
use pliant_engine::rollout::Rollout;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_math::State;

const OPTIONS: StepOptions = StepOptions { record: false, max_halvings: None };

/// Every scene of `tests/scenes`, by name.
fn each_scene(check: impl Fn(&str, &Case, &Rollout)) {
    let folder = format!("{}/../tests/scenes", env!("CARGO_MANIFEST_DIR"));
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut names: Vec<String> = files.map(|file| file.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    names.sort();
    assert!(names.len() > 30);
    for name in names {
        let case = Case::new(&scene(&name), 100);
        check(&name, &case, &case.run(OPTIONS));
    }
}

#[test]
fn a_step_from_a_new_stepper_is_that_of_the_rollout() {
    each_scene(|name, case, roll| {
        for (k, u) in case.u.iter().enumerate() {
            let mut cold = roll.states[k].clone();
            Stepper::new(&case.model, &case.theta, OPTIONS).unwrap().step(&mut cold, u).unwrap();
            let warm = &roll.states[k + 1];
            let fastest = warm.v.iter().fold(9.81 * case.model.step_length(), |most, v| most.max(v.abs()));
            let apart = warm.v.iter().zip(&cold.v).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart <= 1e-8 * fastest, "{name}, step {k}: {apart:e} of {fastest:e} m/s");
        }
    });
}

#[test]
fn a_loop_over_steps_is_the_rollout_to_the_bit() {
    each_scene(|name, case, roll| {
        let mut stepper = Stepper::new(&case.model, &case.theta, OPTIONS).unwrap();
        let mut state: State = case.x0.clone();
        for (k, u) in case.u.iter().enumerate() {
            stepper.step(&mut state, u).unwrap();
            assert_eq!(state, roll.states[k + 1], "{name}, step {k}");
        }
    });
}
