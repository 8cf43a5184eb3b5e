//! The nominal trajectory and its tube together.

use std::rc::Rc;

use super::constants::TUBE;
use super::error::{Constraint, TubeError};
use super::multipliers::Multipliers;
use super::policy::TubePolicy;
use super::problem::{Disturbance, TubeCost, TubeProblem};
use super::room::Room;
use super::rows::{RowValues, rows_of};
use super::{Tube, TubeSynthesis};
use crate::ocp::{Ocp, OcpSolution, OcpSolver};

/// When the alternation ends, and when a row holds.
#[derive(Clone, Copy, Debug)]
pub struct RobustOptions {
    /// Most iterations, each with one nominal problem and one synthesis. Two serve a controller that runs again at every step.
    pub iterations: usize,
    /// Change of states, inputs (their own units) and tightenings (the rows' units) below which it has converged.
    pub tolerance: f64,
    /// Violation of a tightened row, in the row's unit, up to which it holds: the accuracy of the nominal solver.
    pub feasibility: f64,
}

impl Default for RobustOptions {
    fn default() -> Self {
        Self { iterations: 30, tolerance: 1e-6, feasibility: 1e-6 }
    }
}

/// A row that disturbances can violate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Stage k.
    pub stage: usize,
    /// The row or input.
    pub constraint: Constraint,
    /// By how much at worst: g z + g v + h − limit.
    pub amount: f64,
}

/// A nominal trajectory with the tube about it.
#[derive(Clone, Debug)]
pub struct RobustSolution {
    /// Solution of the problem tightened by the tube's h, through the centres of the disturbances.
    pub nominal: OcpSolution,
    /// The tube.
    pub tube: Tube,
    /// Iterations used.
    pub iterations: usize,
    /// Whether states, inputs and tightenings had settled. The tube and the nominal trajectory belong together in any case.
    pub converged: bool,
    /// Rows that do not hold for all disturbances; soft ones, as hard ones are an error. None: certified.
    pub violations: Vec<Violation>,
}

impl RobustSolution {
    /// Whether all rows and bounds hold for all disturbances of the model.
    pub fn is_certified(&self) -> bool {
        self.violations.is_empty()
    }

    /// Nominal cost plus the cost of responses, where the synthesis computes it.
    pub fn cost(&self) -> f64 {
        self.nominal.cost + self.tube.cost.unwrap_or(0.0)
    }

    /// The policy, to be executed on measured states.
    ///
    /// # Errors
    /// [`TubeError::Size`] if `ocp` is another problem.
    pub fn policy(&self, ocp: &Ocp) -> Result<TubePolicy, TubeError> {
        TubePolicy::new(ocp, &self.nominal.x, &self.nominal.u, self.tube.gains.clone())
    }
}

/// Minimizes nominal cost plus cost of responses, subject to rows and bounds tightened by the responses.
///
/// ```text
/// 1. nominal problem with limits − h                 → z, v, multipliers μ
/// 2. weights η_{k,j,i} = μ_{k,i} / (2 a_{k,j,i})      derivative of Σ_j μ √(a_j²) by a_j²
/// 3. responses of least cost under these weights      → a, h = Σ_j a_j
/// ```
/// At a fixed point z, v and Φ meet the optimality conditions of the joint second-order cone problem, which is convex. Weights are made
/// of a running mean of the multipliers, whose step shortens where the alternation does not contract. It converges linearly where the
/// optimum's multipliers are the tightened problem's only ones, and slowly where the optimum leaves that problem barely feasible.
///
/// Each nominal problem is solved with exactly the tightenings of a tube, and the pair of least cost is returned: what it says of rows
/// holds whether or not the iteration has converged. (A synthesis that computes no cost is compared by the nominal one.)
///
/// Where the tightenings of opposed hard rows, or of an input between its bounds, exceed the room between them, the nominal problem gets
/// what keeps its interior, and the multipliers of these rows rise until the responses fit.
///
/// # Errors
/// [`TubeError::Impossible`] where they never fit; sizes; [`TubeError::Nominal`] where other hard rows leave no nominal trajectory.
///
/// Reference: Leeman et al. (2024), arXiv 2401.13762.
pub fn robust(
    ocp: &Ocp,
    disturbance: &Disturbance,
    cost: &TubeCost,
    solver: &mut impl OcpSolver,
    synthesis: &(impl TubeSynthesis + ?Sized),
    options: &RobustOptions,
) -> Result<RobustSolution, TubeError> {
    TubeProblem::new(ocp, disturbance, cost)?; // sizes, before shifts are added
    let centred = disturbance.recentre(ocp);
    let problem = TubeProblem::new(&centred, disturbance, cost)?;
    let room = Room::new(&problem);
    room.check_any_policy(&problem)?;

    let mut tightened = centred.clone();
    let mut multipliers = Multipliers::default();
    let mut tube = Rc::new(synthesis.synthesize(&problem, &RowValues::zeros(ocp), None)?);
    let mut is_unweighted = true;
    let mut best: Option<(OcpSolution, Rc<Tube>)> = None;
    let mut last: Option<OcpSolution> = None;
    let (mut iterations, mut converged) = (0, false);
    let value = |nominal: &OcpSolution, tube: &Tube| nominal.cost + tube.cost.unwrap_or(0.0);
    while iterations < options.iterations && !converged {
        iterations += 1;
        let mut tightenings = if iterations == 1 { RowValues::zeros(ocp) } else { tube.tightenings.clone() };
        let is_whole = iterations > 1 && !room.cut(&mut tightenings);
        tighten(&mut tightened, &centred, &tightenings);
        let nominal = solver.solve(&tightened).map_err(|source| TubeError::Nominal { iteration: iterations, source })?;
        let step = multipliers.update(ocp, &nominal, &tube, options.feasibility);
        let weights = room.raise(&tube, &mut multipliers, nominal.cost.abs() + tube.cost.unwrap_or(0.0));
        // weights that stay zero leave the tube as it is
        let next = match is_unweighted && weights.is_zero() {
            true => tube.clone(),
            false => Rc::new(synthesis.synthesize(&problem, &weights, Some(&tube))?),
        };
        is_unweighted = weights.is_zero();
        let change = next.tightenings.distance(&tightenings);
        let moved = last.as_ref().map_or(f64::INFINITY, |last| moved(last, &nominal));
        converged = change.max(moved) <= options.tolerance * step;
        if is_whole && best.as_ref().is_none_or(|(of_best, tube_of_best)| value(&nominal, &tube) < value(of_best, tube_of_best)) {
            best = Some((nominal.clone(), tube));
        }
        (tube, last) = (next, Some(nominal));
    }

    let (nominal, tube) = match best {
        Some((nominal, tube)) => (nominal, Rc::unwrap_or_clone(tube)),
        None => {
            let mut tube = Rc::unwrap_or_clone(tube);
            // no tube fitted yet: with the multipliers held, responses give way until one does
            for _ in 0..TUBE.fitting {
                if room.check(&tube.tightenings).is_ok() {
                    break;
                }
                let weights = room.raise(&tube, &mut multipliers, tube.cost.unwrap_or(0.0));
                tube = synthesis.synthesize(&problem, &weights, Some(&tube))?;
            }
            room.check(&tube.tightenings)?;
            tighten(&mut tightened, &centred, &tube.tightenings);
            let nominal = solver.solve(&tightened).map_err(|source| TubeError::Nominal { iteration: iterations + 1, source })?;
            (nominal, tube)
        }
    };
    let violations = violations_of(&problem, &tube.tightenings, &nominal, options.feasibility);
    Ok(RobustSolution { nominal, tube, iterations, converged, violations })
}

/// Limits and bounds of `original`, tightened.
fn tighten(tightened: &mut Ocp, original: &Ocp, tightenings: &RowValues) {
    let horizon = original.stages.len();
    for k in 0..=horizon {
        let limits = if k < horizon { &mut tightened.stages[k].rows.limits } else { &mut tightened.rows_final.limits };
        for ((limit, &original), h) in limits.iter_mut().zip(&rows_of(original, k).limits).zip(tightenings.rows(k)) {
            *limit = original - h;
        }
    }
    for (k, (stage, original)) in tightened.stages.iter_mut().zip(&original.stages).enumerate() {
        for (i, h) in tightenings.inputs(k).iter().enumerate() {
            stage.lower[i] = original.lower[i] + h;
            stage.upper[i] = original.upper[i] - h;
        }
    }
}

/// Largest change of states and inputs.
fn moved(last: &OcpSolution, now: &OcpSolution) -> f64 {
    let pairs = last.x.iter().zip(&now.x).chain(last.u.iter().zip(&now.u));
    pairs.flat_map(|(a, b)| a.iter().zip(b)).fold(0.0, |largest, (a, b)| f64::max(largest, (a - b).abs()))
}

fn violations_of(problem: &TubeProblem<'_>, tightenings: &RowValues, nominal: &OcpSolution, tolerance: f64) -> Vec<Violation> {
    let mut violations = Vec::new();
    for (k, x) in nominal.x.iter().enumerate() {
        let u = nominal.u.get(k).map_or(&[][..], Vec::as_slice);
        let values = problem.rows[k].apply(x, u);
        let limits = &rows_of(problem.ocp, k).limits;
        for (i, (value, limit)) in values.iter().zip(limits).enumerate() {
            let amount = value + tightenings.rows(k)[i] - limit;
            if amount.is_nan() || amount > tolerance {
                violations.push(Violation { stage: k, constraint: Constraint::Row(i), amount });
            }
        }
        for (i, (u, h)) in u.iter().zip(tightenings.inputs(k)).enumerate() {
            let stage = &problem.ocp.stages[k];
            let amount = (u + h - stage.upper[i]).max(stage.lower[i] - u + h);
            if amount.is_nan() || amount > tolerance {
                violations.push(Violation { stage: k, constraint: Constraint::Input(i), amount });
            }
        }
    }
    violations
}
