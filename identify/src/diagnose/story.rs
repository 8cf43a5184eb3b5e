//! The errors after each accepted cause.

use super::certainty::estimates;
use super::gain::{Judged, horizon_errors, judged};
use super::procedure::Found;
use super::result::*;
use crate::error::IdentifyError;
use crate::fit::FitOptions;
use crate::shooting::Plan;

/// How the baseline follows the records held out, and the model after each of the accepted causes; the last is the one that is reported.
pub(super) fn story<'a>(plan: &Plan, found: &'a Found, options: &FitOptions) -> Result<Vec<Judged<'a>>, IdentifyError> {
    let on_the_way = found.best.trail.split_last().map_or(&[][..], |(_, others)| others);
    let reported = (!found.best.causes.is_empty()).then_some(&found.fitted);
    let models = std::iter::once(&found.base.fitted).chain(on_the_way).chain(reported);
    models.map(|fitted| judged(plan, fitted, options)).collect()
}

/// The story as it is reported; `half`: half widths of the parameters of the last model, if it has causes.
pub(super) fn stages(plan: &Plan, found: &Found, story: &[Judged], half: &[f64]) -> Vec<Stage> {
    let names = std::iter::once("baseline").chain(found.best.causes.iter().map(|cause| cause.name));
    let last = found.best.causes.len();
    let stage = |(k, (name, judged)): (usize, (&str, &Judged))| Stage {
        name: name.to_owned(),
        rmse_fit: judged.by.rmse,
        rmse_held_out: plan.rms(judged.residuals()),
        mean_abs_held_out: plan.mean_abs(judged.residuals()),
        held_out: horizon_errors(plan, judged),
        parameters: estimates(plan, judged.by, (k > 0 && k == last).then_some(half)),
    };
    names.zip(story).enumerate().map(stage).collect()
}
