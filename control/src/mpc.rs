//! Model predictive control: one Gauss–Newton step per sample, from the last plan shifted by a step.
//!
//! The measured state is taken as it is. A controller that could not improve its plan in time goes on with the shifted one, and says
//! so: [`Update::status`].

use crate::plan::{ConstraintPrice, Plan, PlanError, PlanOptions, PlanStatus, PlanStep, Search, Violation, Warm};
use crate::problem::Problem;
use pliant_engine::model::Model;
use pliant_engine::rollout::Rollout;
use pliant_math::State;
use std::sync::Arc;

/// A controller.
pub struct Mpc<P> {
    problem: P,
    model: Arc<Model>,
    theta: Vec<f64>,
    options: PlanOptions,
    controls: Vec<Vec<f64>>,
    warm: Warm,
}

/// The decision of an update.
#[derive(Clone, Debug)]
pub struct Update {
    /// The rollout of the new plan from the measured state; its first inputs are to be applied.
    pub rollout: Rollout,
    /// The Gauss–Newton steps that it took.
    pub steps: Vec<PlanStep>,
    /// Why it took no more.
    pub status: PlanStatus,
    /// J of the new plan.
    pub cost: f64,
    /// Σ price max(0, c) of the new plan.
    pub penalty: f64,
    /// Constraints that the new plan violates, largest first.
    pub violations: Vec<Violation>,
    /// Multipliers of the constraints and bounds that hold the plan back.
    pub prices: Vec<ConstraintPrice>,
}

impl<P: Problem> Mpc<P> {
    /// A controller whose first plan is `controls`: one row per step that it looks ahead.
    ///
    /// # Errors
    /// No rows, or rows of another size than the model's inputs.
    pub fn new(
        problem: P,
        model: &Arc<Model>,
        theta: &[f64],
        controls: Vec<Vec<f64>>,
        options: PlanOptions,
    ) -> Result<Self, PlanError> {
        if controls.is_empty() {
            return Err(PlanError::Empty);
        }
        if let Some((row, u)) = controls.iter().enumerate().find(|(_, u)| u.len() != model.nu()) {
            return Err(PlanError::Inputs { row, got: u.len(), expected: model.nu() });
        }
        Ok(Self { problem, model: Arc::clone(model), theta: theta.to_vec(), options, controls, warm: Warm::default() })
    }

    /// The plan that the next update starts from.
    pub fn controls(&self) -> &[Vec<f64>] {
        &self.controls
    }

    /// Its cost and constraints.
    pub fn problem(&self) -> &P {
        &self.problem
    }

    /// Its cost and constraints, to change them before the next update.
    pub fn problem_mut(&mut self) -> &mut P {
        &mut self.problem
    }

    /// The model that it plans with.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Replaces the plan that the next update starts from.
    ///
    /// # Errors
    /// Rows of another number or size.
    pub fn set_controls(&mut self, controls: Vec<Vec<f64>>) -> Result<(), PlanError> {
        if let Some((row, u)) = controls.iter().enumerate().find(|(_, u)| u.len() != self.model.nu()) {
            return Err(PlanError::Inputs { row, got: u.len(), expected: self.model.nu() });
        }
        if controls.is_empty() {
            return Err(PlanError::Empty);
        }
        self.controls = controls;
        Ok(())
    }

    /// The inputs that the last plan has for now, within their bounds, where there was no update; the plan is shifted as by an update.
    pub fn hold(&mut self) -> Vec<f64> {
        let mut now = self.controls[0].clone();
        let (mut lower, mut upper) = (vec![0.0; now.len()], vec![0.0; now.len()]);
        self.problem.bounds(0, &mut lower, &mut upper);
        for (u, (low, high)) in now.iter_mut().zip(lower.iter().zip(&upper)).filter(|(_, (low, high))| low <= high) {
            *u = u.clamp(*low, *high);
        }
        self.shift();
        now
    }

    /// The rows a step on; the last one is repeated.
    fn shift(&mut self) {
        self.controls.rotate_left(1);
        if let [.., before, last] = self.controls.as_mut_slice() {
            last.clone_from(before);
        }
    }

    /// Improves the plan from the measured state `x`, and shifts it for the next update: the last inputs are repeated.
    ///
    /// # Errors
    /// A state from which the shifted plan cannot be simulated; a cost that is not finite.
    pub fn update(&mut self, x: &State) -> Result<Update, PlanError> {
        let start = std::time::Instant::now();
        let mut search = Search::new(&self.problem, &self.model, &self.theta, x, &self.controls, self.options)?
            .warm(std::mem::take(&mut self.warm));
        let (steps, status) = search.run(self.options, start)?;
        self.warm = search.take_warm();
        let ((_, penalty), prices) = (search.value(), search.prices().to_vec());
        let Plan { rollout, cost, violations, steps, status, .. } = search.finish(steps, status)?;
        self.controls.clone_from(&rollout.controls);
        self.shift();
        Ok(Update { rollout, steps, status, cost, penalty, violations, prices })
    }
}
