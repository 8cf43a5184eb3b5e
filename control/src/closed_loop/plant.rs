//! The interface of a plant, and the engine as one.

use super::controller::Measured;
use crate::mppi::normal;
use crate::robust::free_rows;
use crate::sensing::Sensors;
use pliant_engine::model::Model;
use pliant_engine::step::{StepError, StepOptions, Stepper};
use pliant_math::State;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::VecDeque;
use std::sync::Arc;

/// What is controlled.
pub trait Plant {
    /// Measures the state, or reads the sensors that it declares instead.
    ///
    /// # Errors
    /// There is no measurement, in words.
    fn measure(&mut self) -> Result<Measured, String>;

    /// The state behind readings, where it is known: of a simulation, for a score.
    fn state(&self) -> Option<State> {
        None
    }

    /// Applies inputs for one step, and returns when the step is over.
    ///
    /// # Errors
    /// The inputs were not applied, in words.
    fn apply(&mut self, u: &[f64]) -> Result<(), String>;
}

/// A simulated plant: a model at parameters θ, if wished with a disturbance after every step.
pub struct ModelPlant {
    model: Arc<Model>,
    stepper: Stepper<'static>,
    state: State,
    /// Steps taken.
    steps: usize,
    disturbance: Option<Disturber>,
    reader: Option<Reader>,
}

/// Readings of the last steps, with their noise.
struct Reader {
    sensors: Sensors,
    random: Pcg64,
    /// Those of the last d + 1 steps, and how many have been taken.
    readings: VecDeque<Vec<f64>>,
    taken: usize,
}

struct Disturber {
    radius: f64,
    random: Pcg64,
}

impl ModelPlant {
    /// A plant in the state `x0`.
    ///
    /// # Errors
    /// A θ of another size or out of its bounds.
    pub fn new(model: &Arc<Model>, theta: &[f64], x0: &State) -> Result<Self, StepError> {
        let options = StepOptions { record: false, ..StepOptions::default() };
        let stepper = Stepper::shared(Arc::clone(model), theta.to_vec(), options)?;
        Ok(Self { model: Arc::clone(model), stepper, state: x0.clone(), steps: 0, disturbance: None, reader: None })
    }

    /// The same with its free nodes displaced together, after every step, by a vector drawn uniformly from the ball of `radius` \[m\].
    pub fn disturbed(self, radius: f64, seed: u64) -> Self {
        Self { disturbance: Some(Disturber { radius, random: Pcg64::seed_from_u64(seed) }), ..self }
    }
}

impl ModelPlant {
    /// The same read by sensors, late and with noise of a normal law, instead of its state.
    pub fn read_by(self, sensors: Sensors, seed: u64) -> Self {
        // another sequence than that of the disturbances with the same seed
        let random = Pcg64::seed_from_u64(!seed);
        Self { reader: Some(Reader { sensors, random, readings: VecDeque::new(), taken: 0 }), ..self }
    }
}

impl Reader {
    /// The reading that arrives after so many steps.
    fn read(&mut self, model: &Model, x: &State, steps: usize) -> Option<Vec<f64>> {
        if self.taken <= steps {
            let mut reading = self.sensors.read(model, x);
            for (y, output) in reading.iter_mut().zip(&self.sensors.outputs) {
                *y += output.noise * normal(&mut self.random);
            }
            self.readings.push_back(reading);
            self.taken += 1;
            if self.readings.len() > self.sensors.delay + 1 {
                self.readings.pop_front();
            }
        }
        self.readings.front().filter(|_| steps >= self.sensors.delay).cloned()
    }
}

impl Plant for ModelPlant {
    fn measure(&mut self) -> Result<Measured, String> {
        let Self { model, state, steps, .. } = self;
        Ok(match &mut self.reader {
            None => Measured::State(state.clone()),
            Some(reader) => Measured::Readings(reader.read(model, state, *steps)),
        })
    }

    fn state(&self) -> Option<State> {
        Some(self.state.clone())
    }

    fn apply(&mut self, u: &[f64]) -> Result<(), String> {
        self.stepper.step(&mut self.state, u).map_err(|error| error.at_step(self.steps).to_string())?;
        self.steps += 1;
        if let Some(disturber) = &mut self.disturbance {
            let change = disturber.draw(&self.model);
            self.state = self.model.displaced(&self.state, &change);
        }
        Ok(())
    }
}

impl Disturber {
    /// A change of state: a direction from normal numbers, and of n numbers the length radius · U^(1/n).
    fn draw(&mut self, model: &Model) -> Vec<f64> {
        let mut change = vec![0.0; model.ndx()];
        let free = free_rows(model);
        free.iter().for_each(|&row| change[row] = normal(&mut self.random));
        let length = change.iter().map(|w| w * w).sum::<f64>().sqrt();
        let wanted = self.radius * self.random.random::<f64>().powf(1.0 / free.len().max(1) as f64);
        if length > 0.0 {
            free.iter().for_each(|&row| change[row] *= wanted / length);
        }
        change
    }
}
