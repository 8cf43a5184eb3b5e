//! Model predictive control of a state that is estimated from readings.
//!
//! ```text
//! update(y)   x̂ of the present from the readings so far and the inputs sent         (crate::sensing)
//!             plan from x̂, as of a measured state                                    (crate::mpc)
//!             with tubes: constraints c + h ≤ 0, h of the estimate's error and of what will be read   (crate::robust, crate::observer)
//! ```
//! The error of x̂ at the time of the last reading is taken as the ellipsoid of the filter's Σ: E_0 E_0ᵀ = Σ, |w_0|₂ ≤ 1. For noise of a
//! normal law and disturbances that are independent of each other it is three standard deviations wide; against disturbances that conspire
//! over many past steps it is no bound. From the last reading on, disturbances and noises are covered at their worst.

use crate::mpc::{Mpc, Update};
use crate::plan::{PlanError, PlanOptions};
use crate::problem::Problem;
use crate::robust::{RobustError, RobustMpc, RobustUpdate, TubeOptions, check_rows};
use crate::sensing::{Estimator, Sensors};
use pliant_engine::model::Model;
use pliant_math::State;
use std::sync::Arc;

/// How a state is estimated, and whether constraints are tightened for it.
#[derive(Clone, Debug)]
pub struct OutputOptions {
    /// Sensors.
    pub sensors: Sensors,
    /// Disturbances, the uncertainty of the first state, gains.
    pub tubes: TubeOptions,
    /// Whether constraints are tightened; else the plan is nominal, and the disturbances are those of the filter alone.
    pub tighten: bool,
}

/// A controller.
pub struct OutputMpc<P> {
    estimator: Estimator,
    planner: Planner<P>,
    /// Whether the estimator has inputs for the step that begins now.
    decided: bool,
}

enum Planner<P> {
    Nominal(Box<Mpc<P>>),
    Tubes(Box<RobustMpc<P>>),
}

/// The plan of an update.
#[derive(Clone, Debug)]
pub enum Planned {
    /// Without tubes.
    Nominal(Box<Update>),
    /// With a tube about it.
    Tubes(Box<RobustUpdate>),
}

/// The decision of an update.
#[derive(Clone, Debug)]
pub struct OutputUpdate {
    /// The estimate of the present that the plan begins with.
    pub estimate: State,
    /// The plan; its first inputs are to be sent.
    pub planned: Planned,
}

impl Planned {
    /// The plan without its tube.
    pub fn update(&self) -> &Update {
        match self {
            Self::Nominal(update) => update,
            Self::Tubes(robust) => &robust.update,
        }
    }
}

impl<P: Problem> OutputMpc<P> {
    /// A controller whose first plan is `controls`, of a plant that begins at `x0` or, by `options.tubes.initial`, near it.
    ///
    /// # Errors
    /// As [`RobustMpc::new`]; sensors that are not the model's.
    pub fn new(
        problem: P,
        model: &Arc<Model>,
        theta: &[f64],
        x0: &State,
        controls: Vec<Vec<f64>>,
        plan: PlanOptions,
        options: OutputOptions,
    ) -> Result<Self, RobustError> {
        let OutputOptions { sensors, tubes, tighten } = options;
        check_rows(model, &tubes)?;
        let estimator = Estimator::new(model, theta, sensors.clone(), &tubes.disturbance, &tubes.initial, x0)?;
        let planner = if tighten {
            Planner::Tubes(Box::new(RobustMpc::new(problem, model, theta, controls, plan, tubes)?.with_sensors(sensors)))
        } else {
            Planner::Nominal(Box::new(Mpc::new(problem, model, theta, controls, plan)?))
        };
        Ok(Self { estimator, planner, decided: false })
    }

    /// Its sensors.
    pub fn sensors(&self) -> &Sensors {
        self.estimator.sensors()
    }

    /// Improves the plan from the readings of d steps ago, `None` where there are none: before d steps, or because they were lost. The
    /// plan's first inputs count as sent until [`OutputMpc::sent`] says what was.
    ///
    /// # Errors
    /// As [`RobustMpc::update`]; a reading of another size, or too early. Inputs are then those of [`OutputMpc::hold`].
    pub fn update(&mut self, reading: Option<&[f64]>) -> Result<OutputUpdate, RobustError> {
        self.decided = false;
        let estimate = self.estimator.estimate(reading)?;
        let planned = match &mut self.planner {
            Planner::Nominal(mpc) => Planned::Nominal(Box::new(mpc.update(&estimate.x)?)),
            Planner::Tubes(robust) => Planned::Tubes(Box::new(robust.update_from(&estimate)?)),
        };
        self.estimator.send(&planned.update().rollout.controls[0]);
        self.decided = true;
        Ok(OutputUpdate { estimate: estimate.x, planned })
    }

    /// The inputs that the last plan has for now, where there was no update; they count as sent.
    pub fn hold(&mut self) -> Vec<f64> {
        let inputs = match &mut self.planner {
            Planner::Nominal(mpc) => mpc.hold(),
            Planner::Tubes(robust) => robust.hold(),
        };
        self.estimator.send(&inputs);
        self.decided = true;
        inputs
    }

    /// The inputs that were sent instead of those of the last [`OutputMpc::update`] or [`OutputMpc::hold`], or after an update that failed.
    ///
    /// # Errors
    /// Inputs of another number than the model's.
    pub fn sent(&mut self, u: &[f64]) -> Result<(), RobustError> {
        let expected = self.estimator.inputs_of_a_step();
        if u.len() != expected {
            return Err(PlanError::Inputs { row: 0, got: u.len(), expected }.into());
        }
        if std::mem::replace(&mut self.decided, true) {
            self.estimator.resend(u);
        } else {
            self.estimator.send(u);
        }
        Ok(())
    }
}
