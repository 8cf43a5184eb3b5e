//! Steps in a row whose records may be of a smoother contact or grasp than the one simulated.

use pliant_engine::grasp::Grasping;
use pliant_engine::model::Model;
use pliant_engine::step::{StepError, StepOptions, StepRecord, StepTrace, Stepper};
use pliant_math::State;

/// Through which states the smoother steps are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// The states of the scene's own contact: the forward simulation stays as it is.
    Hard,
    /// The states of the smoother contact itself.
    Smooth,
}

/// How derivatives are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Rest gap δ_b \[m\] of the steps that are differentiated; κ_b = δ_b m g. Positive; usually larger than the scene's.
    pub rest_gap: f64,
    /// Grasp of the steps that are differentiated.
    pub grasp: Grasping,
    /// Through which states.
    pub along: Along,
}

/// Advances a state, and records what is to be differentiated: that step, or one of smoother contact from the same state.
///
/// The smoother steps have a warm start of their own, so each chain solves what it would solve alone.
pub(crate) struct Chain<'m> {
    forward: Stepper<'m>,
    smooth: Option<Stepper<'m>>,
}

/// Warm starts of a chain: part of a checkpoint.
pub(crate) type Warm = [Option<pliant_engine::step::Warm>; 2];

impl<'m> Chain<'m> {
    pub fn new(
        model: &'m Model,
        theta: &'m [f64],
        options: StepOptions,
        smoothing: Option<Smoothing>,
    ) -> Result<Self, StepError> {
        let Some(Smoothing { rest_gap, grasp, along }) = smoothing else {
            return Ok(Self { forward: Stepper::new(model, theta, options)?, smooth: None });
        };
        let smooth = Stepper::new(model, theta, options)?.with_rest_gap(rest_gap)?.with_grasping(grasp);
        Ok(match along {
            Along::Smooth => Self { forward: smooth, smooth: None },
            Along::Hard => {
                let forward = Stepper::new(model, theta, StepOptions { record: false, ..options })?;
                Self { forward, smooth: Some(smooth) }
            }
        })
    }

    pub fn step(&mut self, state: &mut State, u: &[f64]) -> Result<(StepTrace, Option<StepRecord>), StepError> {
        let Some(smooth) = &mut self.smooth else { return self.forward.step(state, u) };
        let (of_smooth, record) = smooth.step(&mut state.clone(), u)?;
        let (mut trace, _) = self.forward.step(state, u)?;
        trace.work.add(of_smooth.work);
        trace.retries += of_smooth.retries;
        Ok((trace, record))
    }

    pub fn warm(&self) -> Warm {
        [self.forward.warm_start().cloned(), self.smooth.as_ref().and_then(|s| s.warm_start().cloned())]
    }

    pub fn set_warm(&mut self, [forward, smooth]: &Warm) {
        self.forward.set_warm_start(forward.clone());
        if let Some(stepper) = &mut self.smooth {
            stepper.set_warm_start(smooth.clone());
        }
    }
}
