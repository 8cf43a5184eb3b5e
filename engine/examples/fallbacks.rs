//! Counts how often each start of Newton's method solved a stage, and why steps were halved: the table of docs/theory/step.md.
//!
//! `cargo run --release -p pliant-engine --example fallbacks -- [scene.toml …]` steps through every scene with each integrator (without
//! files, those of `tests/scenes` and `examples`) and prints a line per scene with a fallback, then the sums as a table.

mod scenes;

use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{Retry, StepOptions, StepTrace, Stepper};
use pliant_engine::{Attempt, Work};
use pliant_scene::Scene;
use scenes::{INTEGRATORS, scene_files};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let files = scene_files()?;
    let (mut all, mut steps, mut failed) = (StepTrace::default(), 0, 0);
    for file in &files {
        let text = std::fs::read_to_string(file)?;
        // files of other kinds lie beside scenes
        let Ok(scene) = pliant_scene::parse_scene(&text, &file.display().to_string()) else { continue };
        for integrator in INTEGRATORS {
            let mut scene = scene.clone();
            scene.time.integrator = integrator;
            let Ok((trace, taken, error)) = run(&scene) else { continue };
            steps += taken;
            failed += usize::from(error.is_some());
            let fallbacks: usize = trace.work.solved_by[1..].iter().sum();
            if fallbacks + trace.retries > 0 || error.is_some() {
                println!(
                    "{} {integrator:?}: {:?} {:?} {}",
                    name(file),
                    trace.work.solved_by,
                    trace.retried_for,
                    error.unwrap_or_default()
                );
            }
            add(&mut all, trace);
        }
    }
    println!(
        "\n{steps} steps of {} files, {failed} rollouts ended by an error\n\n| start | stages solved |\n|---|---:|",
        files.len()
    );
    Attempt::ALL.iter().zip(all.work.solved_by).for_each(|(attempt, count)| println!("| {} | {count} |", attempt.name()));
    println!("\n| reason of a retry | retries |\n|---|---:|");
    Retry::ALL.iter().zip(all.retried_for).for_each(|(reason, count)| println!("| {} | {count} |", reason.name()));
    Ok(())
}

fn add(sum: &mut StepTrace, trace: StepTrace) {
    sum.work.add(trace.work);
    sum.retries += trace.retries;
    sum.retried_for.iter_mut().zip(trace.retried_for).for_each(|(sum, count)| *sum += count);
}

/// All steps of the scene, how many were taken, and the error that ended them.
fn run(scene: &Scene) -> Result<(StepTrace, usize, Option<String>), Box<dyn Error>> {
    let model = ModelBuilder::new(scene)?.build();
    let steps = (scene.time.duration / scene.time.step).round() as usize;
    let controls = pliant_scene::control_rows(scene, steps)?;
    let (mut all, mut state) = (StepTrace { work: Work::default(), ..StepTrace::default() }, model.initial_state());
    let options = StepOptions { record: false, ..StepOptions::default() };
    let mut stepper = Stepper::new(&model, model.params().values(), options)?;
    for (k, u) in controls.iter().enumerate() {
        match stepper.step(&mut state, u) {
            Ok((trace, _)) => add(&mut all, trace),
            Err(error) => return Ok((all, k, Some(format!("step {k}: {error}")))),
        }
    }
    Ok((all, steps, None))
}

fn name(file: &Path) -> String {
    file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}
