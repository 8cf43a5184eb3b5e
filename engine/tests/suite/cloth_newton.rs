//! Newton's method takes few iterations on sheets, also where they are compressed in their plane and buckle.

use pliant_engine::Work;
use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene as scene;
use pliant_scene::Scene;
use std::fmt::Write;

const H: f64 = 1.0 / 60.0;

/// A square of 10 × 10 nodes without damping, steps of 1/60 s.
fn sheet(young: f64, rest: &str) -> String {
    format!(
        "schema_version = 1\n[time]\nstep = {H}\nduration = 0.5\nintegrator = \"euler\"\n[[cloth]]\nname = \"sheet\"\n\
         grid = {{ nodes = [10, 10], size = [0.4, 0.4] }}\nthickness = 1e-3\narea_density = 0.2\nyoungs_modulus = {young}\n{rest}"
    )
}

fn gripper(name: &str, nodes: &[usize], motion: &str) -> String {
    format!("[[gripper]]\nname = \"{name}\"\ncloth = \"sheet\"\nnodes = {nodes:?}\nmotion = {motion}\n")
}

fn held_at_two_corners() -> String {
    gripper("left", &[0], "{ kind = \"hold\" }") + &gripper("right", &[9], "{ kind = \"hold\" }")
}

/// Squeezed by up to a tenth, waved, and let go.
fn crumpled() -> String {
    let mut text = "points = [".to_owned();
    for (x, y) in (0..10).flat_map(|i| (0..10).map(move |j| (i as f64 / 9.0, j as f64 / 9.0))) {
        let z = 0.01 * (9.0 * x + 2.0 * y).sin() + 0.004 * (17.0 * y - 5.0 * x).cos();
        write!(text, "[{}, {}, {z}],", 0.36 * x, 0.38 * y).unwrap();
    }
    text + "]\n"
}

/// Two edges of a flat sheet, pushed towards each other at 0.2 m/s from the first step on.
fn pushed_together() -> String {
    let (first, last): (Vec<usize>, Vec<usize>) = ((0..10).collect(), (90..100).collect());
    gripper("left", &first, "{ kind = \"line\", velocity = [0.1, 0, 0] }")
        + &gripper("right", &last, "{ kind = \"line\", velocity = [-0.1, 0, 0] }")
}

/// The work of each step.
fn work(text: &str) -> Vec<Work> {
    let scene: Scene = scene::parse_scene(text, "sheet.toml").unwrap();
    let model = ModelBuilder::new(&scene).unwrap().build();
    let controls = scene::control_rows(&scene, scene.time.n_steps()).unwrap();
    let options = StepOptions { record: false, ..StepOptions::default() };
    let mut stepper = Stepper::new(&model, model.params().values(), options).unwrap();
    let mut state = model.initial_state();
    controls.iter().map(|u| stepper.step(&mut state, u).unwrap().0.work).collect()
}

fn mean(work: &[Work], of: impl Fn(&Work) -> usize) -> f64 {
    work.iter().map(of).sum::<usize>() as f64 / work.len() as f64
}

#[test]
fn few_iterations_a_step_from_soft_to_stiff() {
    let scenes = [("held", held_at_two_corners()), ("crumpled", crumpled()), ("pushed together", pushed_together())];
    for (name, rest) in &scenes {
        for young in [1e3, 1e4, 1e5, 1e6, 1e7] {
            let work = work(&sheet(young, rest));
            let (mean, most) = (mean(&work, |w| w.iterations), work.iter().map(|w| w.iterations).max().unwrap_or(0));
            assert!(mean <= 6.0, "{name}, {young:e} Pa: {mean} iterations a step");
            assert!(most <= 80, "{name}, {young:e} Pa: {most} iterations in one step");
        }
    }
}

/// The benchmark's sheet, held at one corner. By corrections not made better by those before them it takes 2.2 matrices and 11.7 corrections a step.
#[test]
fn one_matrix_serves_for_many_corrections() {
    let text = "schema_version = 1\n[time]\nstep = 0.016666666666666666\nduration = 1.0\nintegrator = \"euler\"\n[[cloth]]\nname = \"sheet\"\n\
                grid = { nodes = [10, 10], size = [0.5, 0.5], diagonal = \"up\" }\nthickness = 1e-3\narea_density = 0.2\nyoungs_modulus = 5e4\n\
                poisson_ratio = 0.3\n";
    let work = work(&(text.to_owned() + &gripper("hand", &[0], "{ kind = \"hold\" }")));
    let (matrices, corrections) = (mean(&work, |w| w.factorizations), mean(&work, |w| w.evaluations));
    assert!(matrices < 2.2 && corrections < 10.5, "{matrices} matrices and {corrections} corrections a step");
}
