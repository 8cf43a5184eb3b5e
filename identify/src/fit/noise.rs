//! The noise model of a fit.

use crate::error::IdentifyError;
use crate::shoot::Plan;
use crate::stats::ar::{ArModel, ArOptions, Order};

/// σ floor of every channel \[m\]: half a quantisation step is seen as its standard deviation, `floor` is declared.
pub fn floors(plan: &Plan, floor: f64) -> Vec<f64> {
    vec![floor.max(1e-9); plan.channels()]
}

/// AR model of the residuals (rows (time, channel)), order by BIC up to 4, `lost` degrees of freedom spent by the fit.
pub fn fit_noise(plan: &Plan, residuals: &[Vec<f64>], floor: f64, lost: usize) -> Result<ArModel, IdentifyError> {
    let slices: Vec<&[f64]> = residuals.iter().map(Vec::as_slice).collect();
    // innovations may be far below the stationary noise; their floor follows once the colour is known
    let options = ArOptions { order: Order::Bic { max: 4 }, sigma_floor: vec![1e-3 * floor], lost_dof: lost };
    Ok(ArModel::fit(&slices, plan.channels(), &options)?)
}
