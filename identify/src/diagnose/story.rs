//! The errors after each accepted cause.

use super::certainty::{Curvature, by_record, estimates};
use super::gain;
use super::result::*;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::{Plan, RecordPlan};

/// Errors after each accepted cause.
pub(super) struct Story<'a> {
    pub plan: &'a Plan,
    pub judged: &'a [RecordPlan],
    pub base: &'a Fitted,
    pub options: &'a FitOptions,
    /// Intervals are taken from how records differ, not from a noise model.
    pub by_record: bool,
    pub stages: Vec<Stage>,
}

impl Story<'_> {
    pub(super) fn add(&mut self, name: &str, fitted: &Fitted) -> Result<(), IdentifyError> {
        let records = gain::reread(self.plan, self.judged, self.base, fitted, self.options)?;
        let residuals = gain::residuals(self.plan, &records, &fitted.values)?;
        let rows: f64 = fitted.residuals.iter().map(|r| r.len() as f64).sum();
        let errors = if self.by_record { by_record(self.plan, fitted)? } else { Curvature::new(self.plan, fitted)?.std_errors() };
        self.stages.push(Stage {
            name: name.to_owned(),
            rmse_fit: fitted.rmse,
            rmse_held_out: self.plan.rms(&residuals),
            mean_abs_held_out: self.plan.mean_abs(&residuals),
            held_out: gain::horizon_errors(self.plan, &records, &residuals),
            bic: fitted.deviance + fitted.unknowns.len() as f64 * rows.ln(),
            parameters: estimates(self.plan, fitted, &errors),
        });
        Ok(())
    }
}
