//! Trajectory optimization: Gauss–Newton steps on the inputs of a rollout (single shooting), accepted by the true cost.
//!
//! ```text
//! loop  roll out u, with records          the simulation itself, hard contact
//!       H, g, C, c about it               one sweep over the kept factorizations
//!       min ½ δᵀ(H + λ diag H)δ + gᵀδ + Σ price max(0, c + Cδ)   s.t. lower ≤ u + δ ≤ upper
//!       roll out u + δ; accept if J + Σ price max(0, c) falls by a part of what was predicted, else raise λ
//! ```
//! The dynamics hold in every iterate. The penalty is exact: where prices are above the multipliers, the constraints hold at the end; what
//! is violated is reported. With [`Annealing`] the derivatives are those of smoothed contact at first, and at last the scene's own. While a gripper that may grasp holds nothing, a surrogate term draws it to what is worth holding
//! ([`approaches`]); [`Plan::surrogate`] says so.

mod constants;
mod holding;
mod model;
mod qp;

pub use holding::{Approach, approaches};
pub use model::QuadraticModel;

use crate::problem::{Problem, Terms};
use crate::qp::{ActiveSet, Constraint, QpError};
use constants::PLAN;
use pliant_adjoint::{AdjointError, surrogate_rollout};
use pliant_engine::grasp::Grasping;
use pliant_engine::model::Model;
use pliant_engine::rollout::{Along, Rollout, RolloutOptions, Smoothing, rollout};
use pliant_engine::step::{StepError, StepOptions};
use pliant_math::State;
use std::sync::Arc;
use std::time::{Duration, Instant};

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
    /// Rollouts that it took.
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

/// Seeks the inputs that minimize the cost of `problem`, from the first guess `controls` (clamped to their bounds).
///
/// # Errors
/// A first guess of another size or whose rollout fails; a cost that is not finite there.
pub fn plan(
    problem: &dyn Problem,
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    options: PlanOptions,
) -> Result<Plan, PlanError> {
    let start = Instant::now();
    let mut search = Search::new(problem, model, theta, x0, controls, options)?;
    let (steps, status) = search.run(options, start)?;
    search.finish(steps, status)
}

/// Warm start of the next search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Warm {
    damping: f64,
    solver: ActiveSet,
}

/// The search for a plan, step by step.
pub struct Search<'a> {
    problem: &'a dyn Problem,
    rollout: Rollout,
    /// Rest gap of the steps that are differentiated, if it is not the scene's.
    rest_gap: Option<f64>,
    model: QuadraticModel,
    lower: Vec<f64>,
    upper: Vec<f64>,
    solver: ActiveSet,
    prices: Vec<ConstraintPrice>,
    damping: f64,
    cost: f64,
    penalty: f64,
    terms: Terms,
}

impl<'a> Search<'a> {
    /// Rolls out the first guess.
    ///
    /// # Errors
    /// As [`plan`].
    pub fn new(
        problem: &'a dyn Problem,
        model: &Arc<Model>,
        theta: &[f64],
        x0: &State,
        controls: &[Vec<f64>],
        options: PlanOptions,
    ) -> Result<Self, PlanError> {
        let nu = model.nu();
        if controls.is_empty() {
            return Err(PlanError::Empty);
        }
        let mut controls = controls.to_vec();
        let (mut lower, mut upper) = (vec![0.0; nu * controls.len()], vec![0.0; nu * controls.len()]);
        for (k, u) in controls.iter_mut().enumerate() {
            if u.len() != nu {
                return Err(PlanError::Inputs { row: k, got: u.len(), expected: nu });
            }
            let (low, high) = (&mut lower[k * nu..(k + 1) * nu], &mut upper[k * nu..(k + 1) * nu]);
            problem.bounds(k, low, high);
            for (input, u) in u.iter_mut().enumerate() {
                if low[input].is_nan() || high[input].is_nan() || low[input] > high[input] {
                    return Err(PlanError::Bounds { input, step: k, lower: low[input], upper: high[input] });
                }
                *u = u.clamp(low[input], high[input]);
            }
        }
        let rest_gap = options.smoothing.map(|annealing| annealing.rest_gap).filter(|gap| *gap > model.rest_gap());
        let rollout = simulate(model, theta, x0, &controls, rest_gap).map_err(|error| match error {
            AdjointError::Step(error) => PlanError::Guess(error),
            other => PlanError::Adjoint(other),
        })?;
        let mut out = Self {
            problem,
            rollout,
            rest_gap,
            model: QuadraticModel::default(),
            lower,
            upper,
            solver: ActiveSet::new(),
            prices: Vec::new(),
            damping: 0.0,
            cost: 0.0,
            penalty: 0.0,
            terms: Terms::default(),
        };
        (out.cost, out.penalty) = judge(problem, &out.rollout, &mut out.terms)?;
        Ok(out)
    }

    /// Starts with what an earlier search, of a problem that began a step before, ended with.
    pub(crate) fn warm(self, Warm { damping, solver }: Warm) -> Self {
        Self { damping, solver, ..self }
    }

    /// Warm start of a search of a problem that begins a step later: the damping, and the bounds and constraints that hold.
    pub(crate) fn take_warm(&mut self) -> Warm {
        let (nu, places) = (self.rollout.model.nu(), &self.model.places);
        let mut solver = std::mem::take(&mut self.solver);
        let earlier = |j: usize| j.checked_sub(nu);
        solver.renumber(|constraint| match constraint {
            Constraint::Lower(j) => earlier(j).map(Constraint::Lower),
            Constraint::Upper(j) => earlier(j).map(Constraint::Upper),
            Constraint::Row(row) => {
                let (stage, own) = *places.get(row)?;
                let moved = (stage.checked_sub(1)?, own);
                places.binary_search(&moved).ok().map(Constraint::Row)
            }
        });
        Warm { damping: self.damping, solver }
    }

    /// Multipliers of the last quadratic model, those that are not zero.
    pub(crate) fn prices(&self) -> &[ConstraintPrice] {
        &self.prices
    }

    /// J and Σ price max(0, c) of the best plan so far.
    pub fn value(&self) -> (f64, f64) {
        (self.cost, self.penalty)
    }

    /// Takes steps until one of the options' ends; the time counts from `start`.
    ///
    /// # Errors
    /// As [`Search::step`].
    pub fn run(&mut self, options: PlanOptions, start: Instant) -> Result<(Vec<PlanStep>, PlanStatus), PlanError> {
        self.run_and_tell(options, start, &mut |_, _| ())
    }

    /// As [`Search::run`]; `tell` hears of every step, counted from 1, as soon as it is taken.
    ///
    /// # Errors
    /// As [`Search::step`].
    pub fn run_and_tell(
        &mut self,
        options: PlanOptions,
        start: Instant,
        tell: &mut dyn FnMut(usize, &PlanStep),
    ) -> Result<(Vec<PlanStep>, PlanStatus), PlanError> {
        let mut steps = Vec::new();
        loop {
            if steps.len() == options.iterations {
                return Ok((steps, PlanStatus::Iterations));
            }
            if options.time_limit.is_some_and(|limit| start.elapsed() >= limit) {
                return Ok((steps, PlanStatus::Time));
            }
            let (step, ended) = self.step(options, start)?;
            steps.push(step);
            tell(steps.len(), &step);
            match ended {
                Some(PlanStatus::Converged | PlanStatus::Stalled) if self.rest_gap.is_some() => self.anneal(options)?,
                Some(status) => return Ok((steps, status)),
                None => {}
            }
        }
    }

    /// Goes on with derivatives of a harder contact, at last the scene's own.
    fn anneal(&mut self, options: PlanOptions) -> Result<(), PlanError> {
        let scene = self.rollout.model.rest_gap();
        let lower = self.rest_gap.zip(options.smoothing).map(|(gap, annealing)| gap * annealing.factor);
        self.rest_gap = lower.filter(|gap| *gap > scene);
        self.damping = 0.0;
        let Rollout { model, theta, states, controls, .. } = &self.rollout;
        self.rollout = simulate(model, theta, &states[0], controls, self.rest_gap)?;
        Ok(())
    }

    /// Takes a Gauss–Newton step, damped until the cost falls; says why there is none to be taken. The time counts from `start`.
    ///
    /// # Errors
    /// A problem that cannot be evaluated, or a derivative that cannot be taken.
    pub fn step(&mut self, options: PlanOptions, start: Instant) -> Result<(PlanStep, Option<PlanStatus>), PlanError> {
        let approaches = if options.holding { approaches(self.problem, &self.rollout)? } else { Vec::new() };
        self.model.evaluate(self.problem, &self.rollout, &approaches).map_err(PlanError::Problem)?;
        let merit = self.merit(&approaches);
        let mut step = PlanStep {
            cost: self.cost,
            penalty: self.penalty,
            predicted: 0.0,
            achieved: 0.0,
            damping: self.damping,
            rollouts: 0,
            approaches: approaches.len(),
            rest_gap: self.rest_gap,
        };
        let u: Vec<f64> = self.rollout.controls.concat();
        let (nu, first) = (self.rollout.model.nu(), self.damping);
        loop {
            let lower: Vec<f64> = self.lower.iter().zip(&u).map(|(l, u)| l - u).collect();
            let upper: Vec<f64> = self.upper.iter().zip(&u).map(|(h, u)| h - u).collect();
            let (delta, predicted, prices) = qp::solve(&mut self.model, &mut self.solver, self.damping, [&lower, &upper])?;
            (step.predicted, step.damping) = (predicted, self.damping);
            self.prices = prices;
            if predicted <= options.tolerance * merit.abs() {
                // a damped step promises little of what an undamped one may: the next search begins with less damping
                let converged = self.damping == 0.0;
                self.damping = lowered(first);
                return Ok((step, Some(if converged { PlanStatus::Converged } else { PlanStatus::Stalled })));
            }
            let next: Vec<f64> = u.iter().zip(&delta).map(|(u, d)| u + d).collect();
            let next: Vec<f64> = next.iter().zip(self.lower.iter().zip(&self.upper)).map(|(u, (l, h))| u.clamp(*l, *h)).collect();
            let controls: Vec<Vec<f64>> = next.chunks_exact(nu).map(<[f64]>::to_vec).collect();
            step.rollouts += 1;
            if let Ok(tried) =
                simulate(&self.rollout.model, &self.rollout.theta, &self.rollout.states[0], &controls, self.rest_gap)
                && let Ok((cost, penalty)) = judge(self.problem, &tried, &mut self.terms)
            {
                let drawn: f64 = approaches.iter().map(|approach| approach.cost(&tried)).sum();
                let achieved = merit - (cost + penalty + drawn);
                if achieved >= PLAN.sufficient * predicted {
                    (self.rollout, self.cost, self.penalty) = (tried, cost, penalty);
                    self.damping = lowered(self.damping);
                    step.achieved = achieved;
                    return Ok((step, None));
                }
            }
            self.damping = (self.damping * PLAN.damping_factor).max(PLAN.first_damping);
            if options.time_limit.is_some_and(|limit| start.elapsed() >= limit) {
                return Ok((step, Some(PlanStatus::Time)));
            }
            if self.damping > PLAN.most_damping {
                self.damping = lowered(first);
                return Ok((step, Some(PlanStatus::Stalled)));
            }
        }
    }

    fn merit(&self, approaches: &[Approach]) -> f64 {
        self.cost + self.penalty + approaches.iter().map(|approach| approach.cost(&self.rollout)).sum::<f64>()
    }

    /// The plan that was found.
    ///
    /// # Errors
    /// A problem that cannot be evaluated any more.
    pub fn finish(self, steps: Vec<PlanStep>, status: PlanStatus) -> Result<Plan, PlanError> {
        // what was evaluated before can be evaluated again
        let violations =
            evaluate(self.problem, &self.rollout.states, &self.rollout.controls).map_or(Vec::new(), |(_, broken)| broken);
        let surrogate = steps.last().is_some_and(|step: &PlanStep| step.approaches > 0 || step.rest_gap.is_some());
        let rollout = if self.rest_gap.is_none() {
            self.rollout
        } else {
            // the plan's derivatives are the scene's own
            let Rollout { model, theta, states, controls, .. } = &self.rollout;
            simulate(model, theta, &states[0], controls, None)?
        };
        Ok(Plan { rollout, cost: self.cost, violations, steps, status, surrogate })
    }
}

/// A decade less damping; none below the least.
fn lowered(damping: f64) -> f64 {
    let less = damping / PLAN.damping_factor;
    if less < PLAN.first_damping / PLAN.damping_factor { 0.0 } else { less }
}

/// The scene's own rollout; its records are those of steps of another rest gap from the same states, if one is given.
fn simulate(
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    controls: &[Vec<f64>],
    rest_gap: Option<f64>,
) -> Result<Rollout, AdjointError> {
    let options = RolloutOptions::from(StepOptions::default());
    let Some(rest_gap) = rest_gap else { return Ok(rollout(model, theta, x0, controls, options)?) };
    let smoothing = Smoothing { rest_gap, grasp: Grasping::Hard, along: Along::Hard };
    Ok(surrogate_rollout(model, theta, x0, controls, options, smoothing)?.into_unmarked())
}

/// J and Σ price max(0, c) of a rollout.
fn judge(problem: &dyn Problem, rollout: &Rollout, terms: &mut Terms) -> Result<(f64, f64), PlanError> {
    let (mut cost, mut penalty) = (0.0, 0.0);
    let n = rollout.controls.len();
    for (k, x) in rollout.states.iter().enumerate() {
        terms.clear();
        problem.evaluate(k, n, x, rollout.controls.get(k).map(Vec::as_slice), terms).map_err(PlanError::Problem)?;
        let [own, price] = finite(terms, k)?;
        cost += own;
        penalty += price;
    }
    Ok((cost, penalty))
}

/// J of a trajectory, and the constraints that it violates, largest first.
///
/// # Errors
/// A problem that cannot be evaluated, or a cost that is not finite.
pub fn evaluate(problem: &dyn Problem, states: &[State], controls: &[Vec<f64>]) -> Result<(f64, Vec<Violation>), PlanError> {
    let (mut cost, mut out, mut terms) = (0.0, Vec::new(), Terms::default());
    let n = controls.len();
    for (k, x) in states.iter().enumerate() {
        terms.clear();
        problem.evaluate(k, n, x, controls.get(k).map(Vec::as_slice), &mut terms).map_err(PlanError::Problem)?;
        cost += finite(&terms, k)?[0];
        let broken = terms.constraints.values.iter().enumerate().filter(|(_, c)| **c > 0.0);
        out.extend(broken.map(|(row, c)| Violation { constraint: problem.constraint(k, n, row), by: *c }));
    }
    out.sort_by(|a, b| b.by.total_cmp(&a.by));
    Ok((cost, out))
}

/// Cost and penalty of a stage.
pub(crate) fn finite(terms: &Terms, stage: usize) -> Result<[f64; 2], PlanError> {
    let both = [("the cost", terms.cost()), ("the penalty of the constraints", terms.penalty())];
    match both.iter().find(|(_, value)| !value.is_finite()) {
        Some(&(what, value)) => Err(PlanError::NotFinite { what, value, stage }),
        None => Ok(both.map(|(_, value)| value)),
    }
}
