//! The noise model of a fit.

use super::constants::FIT;
use crate::error::IdentifyError;
use crate::shooting::Plan;
use crate::stats::ar::{ArModel, ArOptions, Order};

/// σ floor of every channel, so many times the declared ones.
pub fn floors(plan: &Plan, times: f64) -> Vec<f64> {
    plan.floors().into_iter().map(|floor| times * floor.max(FIT.least_floor)).collect()
}

/// White noise that a fit without a noise model begins with.
pub fn first_noise(plan: &Plan) -> Result<ArModel, IdentifyError> {
    Ok(ArModel::white(floors(plan, FIT.start_floors))?)
}

/// AR model of the residuals (rows (time, channel)), order by BIC up to 4, `lost` degrees of freedom spent by the fit.
///
/// Its stationary σ is nowhere below the declared floors: a reading that a record's own state can follow exactly (a body that is read
/// once) would else get unlimited weight, and hold every further fit in place.
pub fn fit_noise(plan: &Plan, residuals: &[Vec<f64>], lost: usize) -> Result<ArModel, IdentifyError> {
    let slices: Vec<&[f64]> = residuals.iter().map(Vec::as_slice).collect();
    // innovations may be far below the stationary noise; their floor follows once the colour is known
    let options =
        ArOptions { order: Order::Bic { max: FIT.noise_order }, sigma_floor: floors(plan, FIT.innovation_floor), lost_dof: lost };
    let model = ArModel::fit(&slices, plan.channels(), &options)?;
    let ratio = model.stationary_ratio();
    let sigma = model.sigma().iter().zip(floors(plan, 1.0)).map(|(sigma, floor)| sigma.max(floor / ratio)).collect();
    Ok(ArModel::from_reflection(model.reflection(), sigma)?)
}
