//! Scenes ready to run, for the tests of this crate and of `adjoint`.
#![allow(dead_code)] // the tests of each crate use a part

pub mod shapes;
pub mod sheets;

use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::State;
use pliant_scene::{Integrator, Nothing, Scene, control_rows, parse_scene, read_scene};
use std::sync::Arc;

/// Steps of the rollouts that are checked.
pub const STEPS: usize = 50;

pub struct Case {
    pub model: Arc<Model>,
    pub theta: Vec<f64>,
    pub x0: State,
    pub u: Vec<Vec<f64>>,
}

impl Case {
    pub fn new(scene: &Scene, steps: usize) -> Self {
        let model = Arc::new(ModelBuilder::new(scene).unwrap().build());
        Self { theta: model.params().values().to_vec(), x0: model.initial_state(), u: control_rows(scene, steps).unwrap(), model }
    }

    pub fn run(&self, options: StepOptions) -> Rollout {
        rollout(&self.model, &self.theta, &self.x0, &self.u, options).unwrap()
    }

    /// Weights of all states, the same every time.
    pub fn x_bar(&self) -> Vec<Vec<f64>> {
        let weight = |k: usize, i: usize| ((k * 37 + i * 11) as f64 * 0.61).sin();
        (0..=self.u.len()).map(|k| (0..self.model.ndx()).map(|i| weight(k, i)).collect()).collect()
    }
}

/// Refuses this good scene with one text replaced, at this place, with a cause, a fix and each of these parts in the message.
#[track_caller]
pub fn refused(good: &str, (old, new): (&str, &str), place: &str, parts: &[&str]) {
    assert!(good.contains(old), "{old}");
    let error = parse_scene::<Nothing>(&good.replacen(old, new, 1), "scene.toml").unwrap_err().to_string();
    assert!(error.starts_with(&format!("scene.toml:{place}: ")), "{error}");
    assert!(error.contains("\n  likely cause: ") && error.contains("\n  fix: "), "{error}");
    for part in parts {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
}

pub fn scene(name: &str) -> Scene {
    read_scene::<Nothing>(format!("{}/../tests/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

pub fn with(name: &str, integrator: Integrator) -> Scene {
    let mut scene = scene(name);
    scene.time.integrator = integrator;
    scene
}
