//! The noise model of a fit.

use crate::error::IdentifyError;
use crate::shoot::Plan;
use crate::stats::ar::{ArModel, ArOptions, Order};

/// σ floor of every channel, so many times the declared ones.
pub fn floors(plan: &Plan, times: f64) -> Vec<f64> {
    plan.floors().into_iter().map(|floor| times * floor.max(1e-9)).collect()
}

/// AR model of the residuals (rows (time, channel)), order by BIC up to 4, `lost` degrees of freedom spent by the fit.
pub fn fit_noise(plan: &Plan, residuals: &[Vec<f64>], lost: usize) -> Result<ArModel, IdentifyError> {
    let slices: Vec<&[f64]> = residuals.iter().map(Vec::as_slice).collect();
    // innovations may be far below the stationary noise; their floor follows once the colour is known
    let options = ArOptions { order: Order::Bic { max: 4 }, sigma_floor: floors(plan, 1e-3), lost_dof: lost };
    Ok(ArModel::fit(&slices, plan.channels(), &options)?)
}
