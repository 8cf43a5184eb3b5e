//! How a plan is sought, and what is told of it.

use super::constants::PLAN;
use pliant_engine::rollout::Rollout;
use std::time::Duration;

/// How a plan is sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanOptions {
    /// Largest number of Gauss–Newton steps.
    pub iterations: usize,
    /// The plan is done when a step would lower the cost by less than this part of it [-].
    pub tolerance: f64,
    /// Time after which no further step is begun; the best plan so far is returned.
    pub time_limit: Option<Duration>,
    /// Whether empty grippers are drawn to what is worth holding.
    pub holding: bool,
    /// Contact whose derivatives are taken first, while the states stay those of hard contact; `None`: the scene's own.
    pub smoothing: Option<Annealing>,
}

/// Surrogate derivatives of smoothed contact, annealed: where no step helps any more the rest gap is lowered, until it is the scene's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annealing {
    /// First rest gap \[m\] of the steps that are differentiated: about the distance at which contact is to be felt.
    pub rest_gap: f64,
    /// Factor of the rest gap from one stage to the next [-], between 0 and 1.
    pub factor: f64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { iterations: 50, tolerance: 1e-6, time_limit: None, holding: true, smoothing: None }
    }
}

/// Why the search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanStatus {
    /// No step would lower the cost by more than the tolerance.
    Converged,
    /// The largest number of steps was taken.
    Iterations,
    /// The time was over.
    Time,
    /// No step that was tried, however damped, lowers the cost by more than the tolerance: the rollout is not smooth here.
    Stalled,
}

impl Annealing {
    /// From that rest gap \[m\], a tenth of the last one from stage to stage.
    pub fn from_gap(rest_gap: f64) -> Self {
        Self { rest_gap, factor: PLAN.anneal }
    }
}

/// One step of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanStep {
    /// J before it.
    pub cost: f64,
    /// Σ price max(0, c) before it.
    pub penalty: f64,
    /// Decrease of both that the model predicted.
    pub predicted: f64,
    /// Decrease of both that it brought; surrogate terms count in both.
    pub achieved: f64,
    /// λ it was taken with.
    pub damping: f64,
    /// Rollouts that it took; those of copies in which empty grippers hold something, and their sweeps of derivatives, counted as one each.
    pub rollouts: usize,
    /// Grippers that were drawn to something.
    pub approaches: usize,
    /// Rest gap of the contact that was differentiated \[m\], if it is not the scene's.
    pub rest_gap: Option<f64>,
}

impl PlanStatus {
    /// Its word in outputs: `converged`, `iterations`, `time` or `stalled`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Iterations => "iterations",
            Self::Time => "time",
            Self::Stalled => "stalled",
        }
    }
}

/// A constraint that a plan violates.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Its words.
    pub constraint: String,
    /// By how much.
    pub by: f64,
}

/// A plan.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Its rollout, with records: the inputs are `rollout.controls`.
    pub rollout: Rollout,
    /// J.
    pub cost: f64,
    /// Constraints that are violated, largest first.
    pub violations: Vec<Violation>,
    /// The steps of the search.
    pub steps: Vec<PlanStep>,
    /// Why it ended.
    pub status: PlanStatus,
    /// Whether the last step was taken with surrogate terms or derivatives, so that the plan need not be a minimum of J.
    pub surrogate: bool,
}

/// Price of a constraint or a bound in a plan: the multiplier of its quadratic model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintPrice {
    /// Stage.
    pub stage: usize,
    /// Row of the stage's constraints, or with `input` the number of the input.
    pub row: usize,
    /// Whether it is a bound of an input.
    pub input: bool,
    /// Decrease of the cost per unit by which it is loosened.
    pub multiplier: f64,
}
