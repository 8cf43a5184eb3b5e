//! How far a step from a warm start ends from one that knows nothing of the steps before it:
//! `cargo run --release -p pliant-engine --example warm_and_cold -- [scene.toml …]`.

mod scenes;

use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene::Scene;
use scenes::{INTEGRATORS, scene_files};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    for file in &scene_files()? {
        let text = std::fs::read_to_string(file)?;
        let Ok(scene) = pliant_scene::parse_scene(&text, &file.display().to_string()) else { continue };
        for integrator in INTEGRATORS {
            let mut scene: Scene = scene.clone();
            scene.time.integrator = integrator;
            let Ok(builder) = ModelBuilder::new(&scene) else { continue };
            let model = builder.build();
            let steps = ((scene.time.duration / scene.time.step).round() as usize).min(300);
            let controls = pliant_scene::control_rows(&scene, steps)?;
            let theta = model.params().values();
            let options = StepOptions { record: false, ..StepOptions::default() };
            let Ok(mut stepper) = Stepper::new(&model, theta, options) else { continue };
            let mut state = model.initial_state();
            let (mut off, mut worst, mut at, mut refused, mut taken, mut warm_its, mut cold_its) = (0, 0.0_f64, 0, 0, 0, 0, 0);
            for (k, u) in controls.iter().enumerate() {
                let mut cold_state = state.clone();
                let mut cold = Stepper::new(&model, theta, options)?;
                let Ok((trace, _)) = stepper.step(&mut state, u) else { break };
                taken += 1;
                warm_its += trace.work.iterations;
                let Ok((trace, _)) = cold.step(&mut cold_state, u) else {
                    refused += 1;
                    continue;
                };
                cold_its += trace.work.iterations;
                let speed = state.v.iter().fold(1e-3_f64, |a, v| a.max(v.abs()));
                let gap = state.v.iter().zip(&cold_state.v).fold(0.0_f64, |a, (x, y)| a.max((x - y).abs())) / speed;
                off += usize::from(gap > 1e-8);
                if gap > worst {
                    (worst, at) = (gap, k);
                }
            }
            if worst > 1e-10 || refused > 0 {
                let name = file.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                println!(
                    "{name} {integrator:?}: {off} of {taken} off, worst {worst:.1e} at {at}, {refused} refused; {warm_its} / {cold_its}"
                );
            }
        }
    }
    Ok(())
}
