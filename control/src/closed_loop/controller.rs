//! The interface of a controller, and the record of its decisions.

use crate::mpc::{Mpc, Update};
use crate::output::{OutputMpc, Planned};
use crate::plan::{PlanStatus, PlanStep, Violation};
use crate::problem::Problem;
use crate::robust::{RobustError, RobustMpc, RobustUpdate};
use crate::sensing::SensingError;
use pliant_math::State;

/// A plant's measurement at a step.
#[derive(Clone, Debug, PartialEq)]
pub enum Measured {
    /// Its state.
    State(State),
    /// The readings of its sensors, of as many steps ago as their delay; `None`: there are none yet, or they were lost.
    Readings(Option<Vec<f64>>),
}

impl Measured {
    fn state(&self) -> Result<&State, SensingError> {
        match self {
            Self::State(x) => Ok(x),
            Self::Readings(_) => Err(SensingError::Kind {
                needed: "the state",
                given: "readings",
                fix: "give the controller sensors, which estimate it",
            }),
        }
    }

    fn readings(&self) -> Result<Option<&[f64]>, SensingError> {
        match self {
            Self::Readings(readings) => Ok(readings.as_deref()),
            Self::State(_) => {
                Err(SensingError::Kind { needed: "readings", given: "its state", fix: "give the plant the same sensors" })
            }
        }
    }
}

/// A controller.
pub trait Controller {
    /// Decides the inputs of the step that begins now.
    ///
    /// # Errors
    /// No decision can be made; [`Controller::hold`] then has inputs.
    fn decide(&mut self, measured: &Measured) -> Result<Decision, RobustError>;

    /// The inputs that the last plan has for this step, for which there was no decision; the plan goes on by a step.
    fn hold(&mut self) -> Vec<f64>;

    /// Hears which inputs the plant got for this step, whether decided or held.
    ///
    /// # Errors
    /// Inputs of another number.
    fn sent(&mut self, _u: &[f64]) -> Result<(), RobustError> {
        Ok(())
    }
}

/// A decision, without the rollout that it comes from.
#[derive(Clone, Debug)]
pub struct Decision {
    /// The inputs of this step.
    pub inputs: Vec<f64>,
    /// J of the plan.
    pub cost: f64,
    /// Σ price max(0, c) of the plan.
    pub penalty: f64,
    /// Why the update took no more steps.
    pub status: PlanStatus,
    /// The update's Gauss–Newton steps.
    pub steps: Vec<PlanStep>,
    /// Constraints that the plan violates, largest first.
    pub violations: Vec<Violation>,
    /// What its tube says, if there is one.
    pub reach: Option<Reach>,
}

/// Result of a tube about a plan.
#[derive(Clone, Debug)]
pub struct Reach {
    /// Largest tightening of a constraint.
    pub tightening: f64,
    /// Constraints that the tube reaches beyond, largest first.
    pub violations: Vec<Violation>,
    /// Steps of the plan in which a gripper seizes or lets go, through which the tube is not valid.
    pub switches: Vec<usize>,
}

impl From<Update> for Decision {
    fn from(Update { mut rollout, steps, status, cost, penalty, violations, .. }: Update) -> Self {
        Self { inputs: rollout.controls.swap_remove(0), cost, penalty, status, steps, violations, reach: None }
    }
}

impl From<RobustUpdate> for Decision {
    fn from(robust: RobustUpdate) -> Self {
        let tightening = robust.tightening();
        let RobustUpdate { update, violations, switches, .. } = robust;
        Self { reach: Some(Reach { tightening, violations, switches }), ..update.into() }
    }
}

impl<P: Problem> Controller for Mpc<P> {
    fn decide(&mut self, measured: &Measured) -> Result<Decision, RobustError> {
        Ok(self.update(measured.state()?)?.into())
    }

    fn hold(&mut self) -> Vec<f64> {
        Self::hold(self)
    }
}

impl<P: Problem> Controller for RobustMpc<P> {
    fn decide(&mut self, measured: &Measured) -> Result<Decision, RobustError> {
        Ok(self.update(measured.state()?)?.into())
    }

    fn hold(&mut self) -> Vec<f64> {
        Self::hold(self)
    }
}

impl<P: Problem> Controller for OutputMpc<P> {
    fn decide(&mut self, measured: &Measured) -> Result<Decision, RobustError> {
        Ok(match self.update(measured.readings()?)?.planned {
            Planned::Nominal(update) => (*update).into(),
            Planned::Tubes(robust) => (*robust).into(),
        })
    }

    fn hold(&mut self) -> Vec<f64> {
        Self::hold(self)
    }

    fn sent(&mut self, u: &[f64]) -> Result<(), RobustError> {
        Self::sent(self, u)
    }
}
