//! A controller and a plant in a closed loop.
//!
//! ```text
//! y ← plant.measure()        u ← controller.decide(y)        plant.apply(u), which lasts one step        N times
//! ```
//! - If the controller fails, the inputs that its last plan has for this step are applied; after [`LoopOptions::failures`] failures in a
//!   row the loop ends with an error.
//! - If the plant does not answer, the last inputs are applied again; after more than [`LoopOptions::silence`] such steps in a row the
//!   loop ends with an error. The plan goes on by one step at each of them, so that it stays in time with the plant.
//!
//! A plant measures its state, or gives readings of sensors (late, noisy) from which a controller with the same sensors estimates it.
//! It is anything that takes inputs: a robot, another simulator, or the engine itself ([`ModelPlant`]).

mod controller;
mod plant;
mod score;
#[cfg(test)]
mod tests;

pub use controller::{Controller, Decision, Measured, Reach};
pub use plant::{ModelPlant, Plant};
pub use score::{Score, StageViolation, score};

use crate::robust::RobustError;
use pliant_math::State;
use std::time::{Duration, Instant};

/// When a loop ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopOptions {
    /// Steps.
    pub steps: usize,
    /// Steps in a row without an answer of the plant that are bridged by holding the last inputs.
    pub silence: usize,
    /// Failures of the controller in a row that end the loop, at least 1.
    pub failures: usize,
}

/// One step of a loop.
#[derive(Clone, Debug)]
pub struct LoopStep {
    /// The state that it begins with, as measured or, behind readings, as the plant knows it; `None`: it gave none.
    pub state: Option<State>,
    /// The inputs that were sent.
    pub inputs: Vec<f64>,
    /// The controller's decision; `None`: there is none, and inputs were held.
    pub decision: Option<Decision>,
    /// Why the controller failed, if it did.
    pub failure: Option<RobustError>,
    /// Why the plant gave no state or took no inputs, if so.
    pub silence: Option<String>,
    /// Time that the controller took.
    pub time: Duration,
}

/// A loop that ran to its end.
#[derive(Clone, Debug)]
pub struct LoopRun {
    /// Its steps.
    pub steps: Vec<LoopStep>,
    /// The state after the last step, likewise.
    pub end: Option<State>,
}

/// Why a loop ended early. Steps count from 0.
#[derive(Clone, Debug, thiserror::Error)]
pub enum LoopError {
    /// Nothing was ever applied, so there is nothing to hold.
    #[error("the plant gave no state before the first step: {message}")]
    Start {
        /// The plant's message.
        message: String,
    },
    /// The plant does not answer any more.
    #[error("the plant has not answered for {silent} step(s) in a row, the last of them step {step}: {message}")]
    Plant {
        /// The last step without an answer.
        step: usize,
        /// Steps in a row without an answer.
        silent: usize,
        /// The plant's last message.
        message: String,
    },
    /// The controller fails again and again.
    #[error("the controller failed {failures} time(s) in a row, the last time at step {step}: {source}")]
    Controller {
        /// Step of the last failure.
        step: usize,
        /// Failures in a row.
        failures: usize,
        /// The last failure.
        source: RobustError,
    },
}

/// Runs a loop; `tell` hears of every step, counted from 0, as soon as it is over.
///
/// # Errors
/// A plant that does not answer, or a controller that fails, longer than the options allow.
pub fn run_loop(
    controller: &mut dyn Controller,
    plant: &mut dyn Plant,
    options: LoopOptions,
    tell: &mut dyn FnMut(usize, &LoopStep),
) -> Result<LoopRun, LoopError> {
    let mut steps: Vec<LoopStep> = Vec::new();
    let (mut failures, mut silent) = (0, 0);
    for k in 0..options.steps {
        let mut step = match plant.measure() {
            Ok(measured) => decide(controller, &measured, state_of(plant, &measured)),
            Err(message) => unmeasured(controller, steps.last(), message)?,
        };
        if step.decision.is_some() {
            failures = 0;
        } else if let Some(source) = &step.failure {
            failures += 1;
            if failures >= options.failures {
                return Err(LoopError::Controller { step: k, failures, source: source.clone() });
            }
        }
        if let Err(message) = plant.apply(&step.inputs) {
            step.silence = Some(message);
        }
        controller.sent(&step.inputs).map_err(|source| LoopError::Controller { step: k, failures: 1, source })?;
        match &step.silence {
            None => silent = 0,
            Some(message) => {
                silent += 1;
                if silent > options.silence {
                    return Err(LoopError::Plant { step: k, silent, message: message.clone() });
                }
            }
        }
        tell(k, &step);
        steps.push(step);
    }
    let end = plant.measure().ok().and_then(|measured| state_of(plant, &measured));
    Ok(LoopRun { steps, end })
}

/// The state itself, where it is measured or known.
fn state_of(plant: &dyn Plant, measured: &Measured) -> Option<State> {
    match measured {
        Measured::State(x) => Some(x.clone()),
        Measured::Readings(_) => plant.state(),
    }
}

/// Inputs from what was measured, or those of the last plan if the controller fails.
fn decide(controller: &mut dyn Controller, measured: &Measured, state: Option<State>) -> LoopStep {
    let begin = Instant::now();
    let decided = controller.decide(measured);
    let time = begin.elapsed();
    let (inputs, decision, failure) = match decided {
        Ok(decision) => (decision.inputs.clone(), Some(decision), None),
        Err(error) => (controller.hold(), None, Some(error)),
    };
    LoopStep { state, inputs, decision, failure, silence: None, time }
}

/// The last inputs again, because there is no measured state.
fn unmeasured(controller: &mut dyn Controller, last: Option<&LoopStep>, message: String) -> Result<LoopStep, LoopError> {
    let Some(last) = last else { return Err(LoopError::Start { message }) };
    // the plan stays in time; its own inputs are not used, for nobody has seen what they would do
    controller.hold();
    let inputs = last.inputs.clone();
    Ok(LoopStep { state: None, inputs, decision: None, failure: None, silence: Some(message), time: Duration::ZERO })
}
