//! Score of a closed loop.

use crate::plan::{PlanError, finite};
use crate::problem::{Problem, Terms};
use pliant_math::State;

/// Costs and violated constraints of states and inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Cost of every stage, the last one that of the end; their sum is J.
    pub stage_costs: Vec<f64>,
    /// Violated constraints, largest first.
    pub violations: Vec<StageViolation>,
}

/// A constraint that was violated.
#[derive(Clone, Debug, PartialEq)]
pub struct StageViolation {
    /// The stage: the number of steps before it.
    pub stage: usize,
    /// Its words.
    pub constraint: String,
    /// By how much.
    pub by: f64,
}

/// Costs and violated constraints along the states x₀ … x_N under the inputs u₀ … u_{N−1}.
///
/// # Errors
/// A problem that cannot be evaluated, or a cost that is not finite.
pub fn score(problem: &dyn Problem, states: &[State], controls: &[Vec<f64>]) -> Result<Score, PlanError> {
    let (mut stage_costs, mut violations, mut terms) = (Vec::new(), Vec::new(), Terms::default());
    let n = controls.len();
    for (stage, x) in states.iter().enumerate() {
        terms.clear();
        problem.evaluate(stage, n, x, controls.get(stage).map(Vec::as_slice), &mut terms).map_err(PlanError::Problem)?;
        stage_costs.push(finite(&terms, stage)?[0]);
        let broken = terms.constraints.values.iter().enumerate().filter(|(_, c)| **c > 0.0);
        violations.extend(broken.map(|(row, c)| StageViolation { stage, constraint: problem.constraint(stage, n, row), by: *c }));
    }
    violations.sort_by(|a, b| b.by.total_cmp(&a.by));
    Ok(Score { stage_costs, violations })
}
