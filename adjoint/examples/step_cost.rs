//! Cost of a step of a scene, to count its instructions or to time it:
//! `cargo run --release -p pliant-adjoint --example step_cost -- scene.toml step|record|linearize|vjp 60 20`, rollouts of 60 steps, 20 of
//! them. Prints the work of the solver, and the shortest of the times of a step, each the mean of a rollout.

use pliant_adjoint::{Linearizer, rollout_vjp};
use pliant_engine::Work;
use pliant_engine::model::ModelBuilder;
use pliant_engine::rollout::rollout;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene as scene;
use pliant_scene::Scene;
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let [_, file, kind, steps, rounds] = words.as_slice() else { return Err("scene, kind, steps, rounds".into()) };
    let (steps, rounds): (usize, usize) = (steps.parse()?, rounds.parse()?);
    let scene: Scene = scene::parse_scene(&std::fs::read_to_string(file)?, file)?;
    let model = Arc::new(ModelBuilder::new(&scene)?.build());
    let controls = scene::control_rows(&scene, steps)?;
    let theta = model.params().values();
    let options = StepOptions { record: kind != "step", ..StepOptions::default() };
    let mut linearizer = (kind == "linearize").then(|| Linearizer::new(&model, theta, false));
    let x_bar = vec![vec![1.0; model.ndx()]; steps + 1];
    let (mut shortest, mut work) = (f64::INFINITY, Work::default());
    for _ in 0..rounds {
        let begin = Instant::now();
        work = Work::default();
        let mut state = model.initial_state();
        if kind == "vjp" {
            let run = rollout(&model, theta, &state, &controls, options)?;
            black_box(rollout_vjp(&run, &x_bar)?);
        } else {
            let mut stepper = Stepper::new(&model, theta, options)?;
            for u in &controls {
                let (trace, record) = stepper.step(&mut state, u)?;
                work.add(trace.work);
                if let (Some(record), Some(linearizer)) = (record, &mut linearizer) {
                    black_box(linearizer.linearize(&record));
                }
            }
            black_box(state);
        }
        shortest = shortest.min(begin.elapsed().as_secs_f64() / steps as f64);
    }
    let [i, f, e] = [work.iterations, work.factorizations, work.evaluations].map(|w| w as f64 / steps as f64);
    println!("{kind}: {:.2} µs a step; {i:.2} iterations, {f:.2} factorizations, {e:.2} evaluations", 1e6 * shortest);
    Ok(())
}
