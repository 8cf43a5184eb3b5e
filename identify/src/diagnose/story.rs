//! The errors after each accepted cause.

use super::certainty::estimates;
use super::gain;
use super::procedure::{Bench, Found};
use super::result::*;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::Plan;

/// The baseline, and the model after each of the accepted causes; the last is the one that is reported, with its half widths.
pub(super) fn story(bench: &Bench, found: &Found, half: &[f64], options: &FitOptions) -> Result<Vec<Stage>, IdentifyError> {
    let plan = bench.plan;
    let mut out = vec![stage(plan, "baseline", &found.base.fitted, None, options)?];
    let last = found.best.causes.len();
    for (k, (cause, fitted)) in found.best.causes.iter().zip(&found.best.trail).enumerate() {
        let (fitted, half) = if k + 1 == last { (&found.fitted, Some(half)) } else { (fitted, None) };
        out.push(stage(plan, cause.name, fitted, half, options)?);
    }
    Ok(out)
}

fn stage(plan: &Plan, name: &str, fitted: &Fitted, half: Option<&[f64]>, options: &FitOptions) -> Result<Stage, IdentifyError> {
    let judged = gain::judged(plan, fitted, options)?;
    let whole = judged.last().map_or(&[][..], |whole| &whole.residuals);
    Ok(Stage {
        name: name.to_owned(),
        rmse_fit: fitted.rmse,
        rmse_held_out: plan.rms(whole),
        mean_abs_held_out: plan.mean_abs(whole),
        held_out: gain::horizon_errors(plan, &judged),
        parameters: estimates(plan, fitted, half),
    })
}
