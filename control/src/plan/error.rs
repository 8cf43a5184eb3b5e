//! Why there is no plan.

use crate::qp::QpError;
use pliant_adjoint::AdjointError;
use pliant_engine::step::StepError;

/// Why there is no plan.
#[derive(Clone, Debug, thiserror::Error)]
pub enum PlanError {
    /// Inputs of another number than the model's, or none.
    #[error("the first guess has {got} inputs in row {row}, but the model has {expected}: give one row of inputs per step")]
    Inputs {
        /// Row.
        row: usize,
        /// Entries given.
        got: usize,
        /// Entries needed.
        expected: usize,
    },
    /// No steps.
    #[error("a plan of 0 steps decides nothing: give at least one row of inputs")]
    Empty,
    /// The quadratic model of so many steps does not fit into memory.
    #[error(
        "the quadratic model of a plan of {steps} steps takes {:.1} GB, but {:.1} GB are free: {fit} steps would fit; plan fewer steps, or \
         let a controller look as many steps ahead and plan again at each (`mpc`)",
        bytes / 1e9, available / 1e9
    )]
    Memory {
        /// Steps of the plan.
        steps: usize,
        /// Bytes it takes at least.
        bytes: f64,
        /// Bytes that are free.
        available: f64,
        /// Steps that would fit.
        fit: usize,
    },
    /// The rollout of the first guess fails.
    #[error("the rollout of the first guess fails: {0}")]
    Guess(StepError),
    /// The rollout in which a gripper holds at a distance, for the worth of holding, fails.
    #[error(
        "the rollout in which gripper `{gripper}` holds the nearest point at a distance, for what that would be worth, fails: {source}; begin \
         nearer to what it is to seize, or plan without the value of holding"
    )]
    Hold {
        /// Gripper.
        gripper: String,
        /// Why.
        source: Box<StepError>,
    },
    /// A derivative failed.
    #[error(transparent)]
    Adjoint(#[from] AdjointError),
    /// A cost or a constraint is not a finite number.
    #[error("{what} is {value} at stage {stage}: check what the cost computes there")]
    NotFinite {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Stage.
        stage: usize,
    },
    /// The quadratic model of the cost has no minimum: it is not finite.
    #[error("the step of the plan cannot be computed: {0}")]
    Step(#[from] QpError),
    /// The problem says that it cannot be evaluated.
    #[error("the problem cannot be evaluated: {0}")]
    Problem(String),
    /// Bounds that cross.
    #[error("input {input} has the lower bound {lower} above the upper bound {upper} in step {step}")]
    Bounds {
        /// Input.
        input: usize,
        /// Step.
        step: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}
