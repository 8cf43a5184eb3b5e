//! The step of a plan: the minimum of its quadratic model within the bounds.

use super::ConstraintPrice;
use super::constants::PLAN;
use super::model::QuadraticModel;
use crate::qp::{ActiveSet, Qp, QpError};
use faer::MatRef;

/// The step δ, the decrease of cost and penalty that the damped model predicts, and the multipliers that are not zero.
///
/// # Errors
/// A model that is not finite.
pub(super) fn solve(
    model: &mut QuadraticModel,
    solver: &mut ActiveSet,
    damping: f64,
    [lower, upper]: [&[f64]; 2],
) -> Result<(Vec<f64>, f64, Vec<ConstraintPrice>), QpError> {
    let n = model.n;
    let diagonal: Vec<f64> = (0..n).map(|k| model.hessian[(k, k)]).collect();
    // inputs that change nothing have a zero row, and stay where they are
    let floor = PLAN.least_curvature * diagonal.iter().fold(0.0, |a: f64, b| a.max(*b)).max(f64::MIN_POSITIVE);
    for (k, d) in diagonal.iter().enumerate() {
        model.hessian[(k, k)] = d + damping * d + floor;
    }
    let limits: Vec<f64> = model.values.iter().map(|c| -c).collect();
    let solved = solver.solve(&Qp {
        hessian: model.hessian.as_ref(),
        gradient: &model.gradient,
        lower,
        upper,
        rows: MatRef::from_row_major_slice(&model.rows, limits.len(), n),
        limits: &limits,
        weights: &model.prices,
    });
    for (k, d) in diagonal.into_iter().enumerate() {
        model.hessian[(k, k)] = d;
    }
    let solution = solved?;
    let nu = n / model.steps.max(1);
    let rows = model.places.iter().zip(&solution.multipliers);
    let rows = rows.map(|(&(stage, row), &multiplier)| ConstraintPrice { stage, row, input: false, multiplier });
    let bounds = solution.bounds.iter().enumerate();
    let bounds = bounds.map(|(k, mu)| ConstraintPrice { stage: k / nu, row: k % nu, input: true, multiplier: mu.abs() });
    let prices = rows.chain(bounds).filter(|price| price.multiplier != 0.0).collect();
    Ok((solution.z, model.penalty - solution.cost, prices))
}
