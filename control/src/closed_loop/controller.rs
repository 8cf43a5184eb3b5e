//! The interface of a controller, and the record of its decisions.

use crate::mpc::{Mpc, Update};
use crate::plan::{PlanStatus, PlanStep, Violation};
use crate::problem::Problem;
use crate::robust::{RobustError, RobustMpc, RobustUpdate};
use pliant_math::State;

/// A controller.
pub trait Controller {
    /// Decides the inputs of the step that begins at the measured state `x`.
    ///
    /// # Errors
    /// No decision can be made; [`Controller::hold`] then has inputs.
    fn decide(&mut self, x: &State) -> Result<Decision, RobustError>;

    /// The inputs that the last plan has for this step, for which there was no decision; the plan goes on by a step.
    fn hold(&mut self) -> Vec<f64>;
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

impl<P: Problem> Controller for Mpc<P> {
    fn decide(&mut self, x: &State) -> Result<Decision, RobustError> {
        Ok(self.update(x)?.into())
    }

    fn hold(&mut self) -> Vec<f64> {
        Self::hold(self)
    }
}

impl<P: Problem> Controller for RobustMpc<P> {
    fn decide(&mut self, x: &State) -> Result<Decision, RobustError> {
        let RobustUpdate { update, tube, violations, switches } = self.update(x)?;
        let stages = 0..=update.rollout.controls.len();
        let tightening = stages.flat_map(|k| tube.tightenings.rows(k)).fold(0.0, |most: f64, h| most.max(*h));
        Ok(Decision { reach: Some(Reach { tightening, violations, switches }), ..update.into() })
    }

    fn hold(&mut self) -> Vec<f64> {
        Self::hold(self)
    }
}
