//! Copies that are stepped together take the steps that each would take alone, to the bit.

use crate::common::{Case, scene};
use pliant_engine::rollout::rollout;
use pliant_engine::step::{StepError, StepOptions, Stepper};
use pliant_engine::vector::{VectorError, VectorStepper};
use pliant_math::State;
use pliant_scene::parse_scene;
use std::num::NonZero;

const OPTIONS: StepOptions = StepOptions { record: false, max_halvings: None };

/// Names of the scenes of `tests/scenes`.
fn scenes() -> Vec<String> {
    let folder = format!("{}/../tests/scenes", env!("CARGO_MANIFEST_DIR"));
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut names: Vec<String> = files.map(|file| file.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    names.sort();
    assert!(names.len() > 30);
    names
}

/// Copies of a scene, each with a gravity and a start of its own, and the inputs of all by step.
struct Flock {
    case: Case,
    thetas: Vec<Vec<f64>>,
    starts: Vec<State>,
    u: Vec<Vec<f64>>,
}

impl Flock {
    fn new(name: &str, copies: usize, steps: usize) -> Self {
        let case = Case::new(&scene(name), steps);
        let gravity = case.model.params().find("gravity.magnitude").unwrap();
        let part = |k: usize| 1.0 - 0.05 * k as f64;
        let theta = |k| case.theta.iter().enumerate().map(|(i, x)| if i == gravity { x * part(k) } else { *x }).collect();
        let start = |k| State { v: case.x0.v.iter().map(|v| v * part(k)).collect(), ..case.x0.clone() };
        let u = case.u.iter().map(|row| row.repeat(copies)).collect();
        Self { thetas: (0..copies).map(theta).collect(), starts: (0..copies).map(start).collect(), u, case }
    }

    fn stepper(&self) -> VectorStepper {
        let mut vector = VectorStepper::new(&self.case.model, self.starts.len()).unwrap();
        for (k, (theta, start)) in self.thetas.iter().zip(&self.starts).enumerate() {
            vector.set_theta(k, theta).unwrap();
            vector.reset(k, start).unwrap();
        }
        vector
    }

    /// States by step and copy.
    fn run(&self, vector: &mut VectorStepper) -> Vec<Vec<State>> {
        self.u.iter().map(|u| step(vector, u)).collect()
    }
}

/// Takes a step, and returns the states of all copies.
fn step(vector: &mut VectorStepper, u: &[f64]) -> Vec<State> {
    vector.step(u, false).unwrap();
    states(vector)
}

fn states(vector: &VectorStepper) -> Vec<State> {
    vector.copies().iter().map(|copy| copy.state().clone()).collect()
}

/// The states of `steps`, and why they end.
fn alone(flock: &Flock, copy: usize) -> (Vec<State>, Option<String>) {
    let mut stepper = Stepper::new(&flock.case.model, &flock.thetas[copy], OPTIONS).unwrap();
    let (mut state, mut out) = (flock.starts[copy].clone(), Vec::new());
    for (k, u) in flock.case.u.iter().enumerate() {
        if let Err(error) = stepper.step(&mut state, u) {
            return (out, Some(error.at_step(k).to_string()));
        }
        out.push(state.clone());
    }
    (out, None)
}

#[test]
fn every_copy_takes_the_steps_of_a_loop_and_of_a_rollout() {
    let (mut whole, mut different) = (0, 0);
    for name in scenes() {
        let flock = Flock::new(&name, 3, 40);
        let mut vector = flock.stepper();
        let together = flock.run(&mut vector);
        for (k, copy) in vector.copies().iter().enumerate() {
            let (looped, failure) = alone(&flock, k);
            looped.iter().enumerate().for_each(|(i, state)| assert_eq!(together[i][k], *state, "{name}, copy {k}, step {i}"));
            assert_eq!(copy.failure().map(ToString::to_string), failure, "{name}, copy {k}");
            assert_eq!(copy.theta(), flock.thetas[k]);
            assert!((copy.time() - looped.len() as f64 * flock.case.model.step_length()).abs() < 1e-12);
            if failure.is_none() {
                let roll = rollout(&flock.case.model, &flock.thetas[k], &flock.starts[k], &flock.case.u, OPTIONS).unwrap();
                assert_eq!(roll.states.last(), Some(copy.state()), "{name}, copy {k}");
                assert_eq!(roll.traces.last(), Some(copy.trace()), "{name}, copy {k}");
                whole += 1;
            }
        }
        let last = together.last().unwrap();
        different += usize::from(last[0] != last[1]);
    }
    assert!(whole > 90 && different > 30, "{whole} rollouts, copies differ in {different} scenes");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    for name in ["windy", "sliding", "pile_gains", "cloth_sphere", "rod_friction"] {
        let flock = Flock::new(name, 9, 20);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| flock.run(&mut flock.stepper()))
        };
        let one = run(1);
        for threads in [2, 3, 2 * std::thread::available_parallelism().map_or(2, NonZero::get)] {
            assert!(run(threads) == one, "{name} on {threads} threads");
        }
    }
}

#[test]
fn a_reset_copy_knows_nothing_of_before() {
    for name in scenes() {
        let flock = Flock::new(&name, 2, 20);
        let mut vector = flock.stepper();
        let first = flock.run(&mut vector);
        // once after sound steps, once after a step that failed
        for speed in [1.0, 1e200] {
            let fast = State { v: vec![speed; flock.case.model.nv()], ..flock.starts[1].clone() };
            if speed > 1.0 && !fast.v.is_empty() {
                vector.reset(1, &fast).unwrap();
                vector.step(&flock.u[0], false).unwrap();
            }
            for (k, start) in flock.starts.iter().enumerate() {
                vector.reset(k, start).unwrap();
                assert_eq!((vector.copies()[k].time(), vector.copies()[k].failure().is_none()), (0.0, true));
            }
            for (step, (again, first)) in flock.run(&mut vector).iter().zip(&first).enumerate() {
                assert_eq!(again, first, "{name} after {speed} m/s, step {step}");
            }
        }
    }
}

#[test]
fn clones_go_on_as_the_original() {
    for name in ["sliding", "pile_gains", "resting"] {
        let flock = Flock::new(name, 3, 24);
        let (before, after) = flock.u.split_at(12);
        let mut vector = flock.stepper();
        before.iter().for_each(|u| vector.step(u, false).unwrap());
        let mut clone = vector.clone();
        let mut cold = vector.clone();
        cold.reset(0, vector.copies()[0].state()).unwrap();
        vector.clone_copy(0, 2).unwrap();
        assert_eq!(vector.copies()[2].theta(), flock.thetas[0]);
        let mut differs = false;
        for u in after {
            let [original, cloned, cold] = [&mut vector, &mut clone, &mut cold].map(|v| step(v, u));
            assert_eq!(original[..2], cloned[..2], "{name}");
            assert_eq!(original[0], original[2], "{name}");
            assert_ne!(original[2], cloned[2], "{name}: a copy that went on from its own state");
            differs |= original[0] != cold[0];
        }
        assert!(differs, "{name}: a warm start does not show, so that a forgotten one would not either");
    }
}

#[test]
fn other_parameters_begin_a_rollout_from_where_the_copy_is() {
    let flock = Flock::new("sliding", 2, 20);
    let (before, after) = flock.u.split_at(10);
    let mut vector = flock.stepper();
    before.iter().for_each(|u| vector.step(u, false).unwrap());
    let start = vector.copies()[0].state().clone();
    let theta = &flock.thetas[1];
    vector.set_theta(0, theta).unwrap();
    after.iter().for_each(|u| vector.step(u, false).unwrap());
    let roll = rollout(&flock.case.model, theta, &start, &flock.case.u[10..], OPTIONS).unwrap();
    assert_eq!(roll.states.last(), Some(vector.copies()[0].state()));
    assert!((vector.copies()[0].time() - 20.0 * flock.case.model.step_length()).abs() < 1e-12);
}

#[test]
fn records_change_no_state_and_are_those_of_the_last_step() {
    let flock = Flock::new("sliding", 2, 6);
    let (mut plain, mut recorded) = (flock.stepper(), flock.stepper());
    for (k, u) in flock.u.iter().enumerate() {
        let before = states(&recorded);
        plain.step(u, false).unwrap();
        recorded.step(u, true).unwrap();
        assert_eq!(states(&plain), states(&recorded));
        for (copy, x) in before.iter().enumerate() {
            let record = recorded.record(copy).unwrap();
            assert_eq!(record.states, [x.clone(), recorded.copies()[copy].state().clone()]);
            assert_eq!((&record.controls[0], &record.theta, record.records.len()), (&flock.case.u[k], &flock.thetas[copy], 1));
            assert!(matches!(plain.record(copy), Err(VectorError::NoRecord { .. })));
        }
    }
    recorded.step(&flock.u[0], false).unwrap();
    assert!(matches!(recorded.record(0), Err(VectorError::NoRecord { copy: 0 })));
}

#[test]
fn a_copy_that_fails_ends_alone_and_keeps_its_last_state() {
    for name in ["sliding", "pile_gains"] {
        let flock = Flock::new(name, 4, 16);
        let (mut sound, mut vector) = (flock.stepper(), flock.stepper());
        let fast = State { v: vec![1e200; flock.case.model.nv()], ..flock.starts[2].clone() };
        for (k, u) in flock.u.iter().enumerate() {
            if k == 5 {
                vector.reset(2, &fast).unwrap();
            }
            sound.step(u, true).unwrap();
            vector.step(u, true).unwrap();
            for copy in [0, 1, 3] {
                assert_eq!(vector.copies()[copy].state(), sound.copies()[copy].state(), "{name}, copy {copy}, step {k}");
            }
            if k >= 5 {
                let failed = &vector.copies()[2];
                assert_eq!((failed.state(), failed.time()), (&fast, 0.0), "{name}, step {k}");
                assert!(failed.failure().unwrap().to_string().starts_with("step 0: "), "{name}");
                assert!(matches!(vector.record(2), Err(VectorError::NoRecord { copy: 2 })), "{name}");
            }
        }
        vector.clone_copy(2, 3).unwrap();
        vector.set_theta(3, &flock.thetas[0]).unwrap();
        assert!(vector.copies()[3].failure().is_some(), "{name}: only a reset ends a failure");
    }
}

/// A stiff sheet whose corner hits a floor in a step in which it falls by a third of its size: after some steps one creates energy.
const HARD_LANDING: &str = r#"
schema_version = 1
[time]
step = 0.025938658099644275
duration = 1.0
integrator = "sdirk2"
[contact]
rest_gap = 3e-10
[[cloth]]
name = "it"
grid = { nodes = [3, 8], size = [0.17037341562932548, 0.067382927914985], diagonal = "alternating" }
u_axis = [1.0, 0.0, 0.0]
v_axis = [0.0, -0.8546627850223685, -0.5191835165890851]
origin = [0.0, 0.0, 0.1899071505727723]
velocity = [1.0492084439816867, -0.6014858787634768, 0.0]
thickness = 4.4e-05
density = 141.6
youngs_modulus = 2.23e9
poisson_ratio = -0.29
bend_stiffness = 5.2e-06
membrane_damping = 2.14e7
[[plane]]
name = "floor"
point = [0.0, 0.0, -0.12243]
normal = [0.16793354117126214, -0.1913734544891322, 1.0]
friction = 0.3
"#;

#[test]
fn a_copy_fails_as_its_rollout_does() {
    let case = Case::new(&parse_scene(HARD_LANDING, "landing.toml").unwrap(), 40);
    let error = rollout(&case.model, &case.theta, &case.x0, &case.u, OPTIONS).unwrap_err();
    let mut vector = VectorStepper::new(&case.model, 2).unwrap();
    case.u.iter().for_each(|_| vector.step(&[], false).unwrap());
    for copy in vector.copies() {
        assert_eq!(copy.failure().unwrap().to_string(), error.to_string());
        let steps = (copy.time() / case.model.step_length()).round() as usize;
        assert!(steps > 0 && error.to_string().starts_with(&format!("step {steps}: ")), "{error}");
        let sound = rollout(&case.model, &case.theta, &case.x0, &case.u[..steps], OPTIONS).unwrap();
        assert_eq!(sound.states.last(), Some(copy.state()));
    }
}

#[test]
fn bad_input_is_refused_before_any_copy_steps() {
    let flock = Flock::new("sliding", 3, 2);
    let (mut vector, x0) = (flock.stepper(), &flock.case.x0);
    let nu = flock.case.model.nu();
    let before = states(&vector);
    assert!(nu == 0 || vector.step(&vec![0.0; nu], false).is_err());
    let error = vector.step(&vec![0.0; 3 * nu + 1], false).unwrap_err().to_string();
    assert!(
        error.contains(&format!("u has {} entries, but 3 copies with {nu} inputs each need {}", 3 * nu + 1, 3 * nu)),
        "{error}"
    );

    let hand = Flock::new("velocity_gripper", 3, 2);
    let mut driven = hand.stepper();
    let (driven_before, nu) = (states(&driven), hand.case.model.nu());
    let mut u = hand.u[0].clone();
    u[2 * nu - 1] = f64::NAN;
    let error = driven.step(&u, false).unwrap_err().to_string();
    assert!(error.starts_with(&format!("u of copy 1 is NaN in component {}, but must be finite", nu - 1)), "{error}");
    assert_eq!(states(&driven), driven_before);

    assert!(matches!(VectorStepper::new(&flock.case.model, 0), Err(VectorError::Empty)));
    let error = VectorStepper::new(&flock.case.model, usize::MAX).unwrap_err().to_string();
    assert!(error.contains("copies take at least"), "{error}");
    let mut lost = x0.clone();
    lost.v[1] = f64::INFINITY;
    let error = vector.reset(2, &lost).unwrap_err().to_string();
    assert!(error.starts_with(&format!("x of copy 2 is inf in component {}", x0.q.len() + 1)), "{error}");
    let short = State { q: x0.q[1..].to_vec(), ..x0.clone() };
    let error = vector.reset(0, &short).unwrap_err().to_string();
    assert!(error.starts_with("copy 0: position vector has"), "{error}");
    let error = vector.set_theta(1, &[1.0]).unwrap_err();
    assert!(matches!(error, VectorError::Copy { copy: 1, source: StepError::Size { got: 1, .. } }), "{error}");
    let mut impossible = flock.case.theta.clone();
    let density = flock.case.model.params().infos().iter().position(|info| info.path.ends_with("linear_density")).unwrap();
    impossible[density] = -1.0;
    assert!(matches!(vector.set_theta(1, &impossible), Err(VectorError::Copy { copy: 1, source: StepError::Parameter { .. } })));
    assert_eq!(vector.copies()[1].theta(), flock.thetas[1]);
    for error in [
        vector.reset(3, x0).unwrap_err(),
        vector.set_theta(3, &flock.case.theta).unwrap_err(),
        vector.clone_copy(0, 3).unwrap_err(),
        vector.clone_copy(3, 0).unwrap_err(),
        vector.record(3).unwrap_err(),
        vector.copy(3).unwrap_err(),
    ] {
        assert_eq!(error.to_string(), "there is no copy 3: there are 3, counted from 0");
    }
    assert_eq!(states(&vector), before);
}
