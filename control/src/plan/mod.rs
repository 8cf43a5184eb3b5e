//! Trajectory optimization: Gauss–Newton steps on the inputs of a rollout (single shooting), accepted by the true cost.
//!
//! ```text
//! loop  roll out u, with records          the simulation itself, hard contact
//!       H, g, C, c about it               one sweep over the kept factorizations
//!       min ½ δᵀ(H + λ diag H)δ + gᵀδ + Σ price max(0, c + Cδ)   s.t. lower ≤ u + δ ≤ upper
//!       roll out u + δ; accept if J + Σ price max(0, c) falls by a part of what was predicted, else raise λ
//! ```
//! The dynamics hold in every iterate. The penalty is exact: where prices are above the multipliers, the constraints hold at the end; what
//! is violated is reported. With [`Annealing`] the derivatives are those of smoothed contact at first, and at last the scene's own. While a
//! gripper that may grasp holds nothing, a surrogate term draws it to what is worth holding ([`Aim`], [`approaches`]);
//! [`Plan::surrogate`] says so. Costs that are given by value instead of residuals have the BFGS matrix for their part of H.

mod aim;
mod constants;
mod curvature;
mod error;
mod holding;
mod memory;
mod model;
mod options;
mod qp;

pub use aim::Aim;
pub use error::PlanError;
pub use holding::{Approach, approaches};
pub use model::QuadraticModel;
pub use options::{Annealing, ConstraintPrice, Plan, PlanOptions, PlanStatus, PlanStep, Violation};

use crate::problem::{Problem, Terms};
use crate::qp::{ActiveSet, Constraint};
use constants::PLAN;
use curvature::Curvature;
use pliant_adjoint::{AdjointError, surrogate_rollout};
use pliant_engine::grasp::Grasping;
use pliant_engine::model::Model;
use pliant_engine::rollout::{Along, Rollout, RolloutOptions, Smoothing, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::State;
use std::sync::Arc;
use std::time::Instant;

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
    aim: Aim,
}

/// The search for a plan, step by step.
pub struct Search<'a> {
    problem: &'a dyn Problem,
    rollout: Rollout,
    /// Rest gap of the steps that are differentiated, if it is not the scene's.
    rest_gap: Option<f64>,
    model: QuadraticModel,
    curvature: Curvature,
    lower: Vec<f64>,
    upper: Vec<f64>,
    solver: ActiveSet,
    prices: Vec<ConstraintPrice>,
    damping: f64,
    aim: Aim,
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
        memory::check(problem, x0, &controls, model.ndx())?;
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
            curvature: Curvature::default(),
            lower,
            upper,
            solver: ActiveSet::new(),
            prices: Vec::new(),
            damping: 0.0,
            aim: Aim::default(),
            cost: 0.0,
            penalty: 0.0,
            terms: Terms::default(),
        };
        (out.cost, out.penalty) = judge(problem, &out.rollout, &mut out.terms)?;
        Ok(out)
    }

    /// Starts with what an earlier search, of a problem that began a step before, ended with.
    pub(crate) fn warm(self, Warm { damping, solver, aim }: Warm) -> Self {
        Self { damping, solver, aim, ..self }
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
        Warm { damping: self.damping, solver, aim: std::mem::take(&mut self.aim) }
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
        let (approaches, copies) = self.approaches(options, start)?;
        self.model.evaluate(self.problem, &self.rollout, &approaches).map_err(PlanError::Problem)?;
        let merit = self.merit(&approaches);
        let mut step = PlanStep {
            cost: self.cost,
            penalty: self.penalty,
            predicted: 0.0,
            achieved: 0.0,
            damping: self.damping,
            rollouts: copies,
            approaches: approaches.len(),
            rest_gap: self.rest_gap,
        };
        let u: Vec<f64> = self.rollout.controls.concat();
        if !self.model.slopes.is_empty() {
            self.curvature.add(&u, &self.model.slopes, self.cost, &mut self.model.hessian);
        }
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

    /// The pull on empty grippers to the points that are worth most to hold, and the rollouts that these took to find.
    fn approaches(&mut self, options: PlanOptions, start: Instant) -> Result<(Vec<Approach>, usize), PlanError> {
        if !options.holding || self.rollout.model.grasps().is_empty() {
            return Ok((Vec::new(), 0));
        }
        let copies = self.aim.improve(self.problem, &self.rollout, options, start)?;
        Ok((approaches(self.problem, &self.rollout, &self.aim)?, copies))
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
