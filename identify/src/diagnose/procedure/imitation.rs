//! Causes that may only make up for the simulation's own error.

use super::super::beside::Beside;
use super::super::numerics::{Source, changes, shift, shifts};
use super::super::policy::POLICY;
use super::super::result::NumericsKind;
use super::round::{Rejection, Round};
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::unknown::Unknown;
use nalgebra::DVector;

/// Whether the size of a cause is no more than three times the one that makes up for an error of the simulation, `bias` of everything fitted.
pub(super) fn makes_up(plan: &Plan, fitted: &Fitted, cause: &Cause, bias: &DVector<f64>) -> bool {
    let own = |u: &Unknown| cause.unknowns.iter().any(|o| o.target.same(&u.target));
    let small = |(j, u): (usize, &Unknown)| {
        let [here, scene] = [&fitted.values, &plan.scene_values].map(|values| u.coordinate_of(u.value(values)));
        (here - scene).abs() <= POLICY.beyond_bias * bias[j].abs()
    };
    fitted.unknowns.iter().enumerate().filter(|(_, u)| own(u)).all(small)
}

impl Round<'_> {
    /// Whether the simulation's own error imitates the cause: its size is no more than three times the one that makes up for that error, and
    /// either a finer step is called for, with which it is looked for again, or it does not lead the finer simulation without it, or one that is
    /// part of the way there. That alone would not do where the step can be finer: what is known of its error is an estimate, which a wrong inertia
    /// may be nearer to the data than.
    pub(super) fn imitated(&self, parent: usize, k: usize) -> Result<Option<Rejection>, IdentifyError> {
        let (plan, fitted) = (self.bench.plan, &self.contest.fits[k]);
        let shifts = self.shifts.get_or_init(|| shifts(self.scene, plan, fitted));
        let coarse = self.contest.coarse(self.bench, k)?;
        let beside = Beside::new(&coarse.plan, &coarse.fitted, &changes(shifts))?;
        for (number, of) in shifts.iter().enumerate() {
            let bias = beside.sizes(number);
            let small = makes_up(plan, fitted, self.cause(k), &bias);
            let leads = self.contest.scores[parent] - self.contest.scores[k] - POLICY.lead;
            if small && (of.calls_for_a_finer_step(plan, fitted) || self.taken_by_finer(parent, of.source)? > leads) {
                return Ok(Some(Rejection::Imitated(of.source.kind())));
            }
        }
        Ok(None)
    }

    /// Squares that a finer simulation, or one part of the way to it, takes from a model; inputs are read one way or the other.
    pub(super) fn taken_by_finer(&self, model: usize, source: Source) -> Result<f64, IdentifyError> {
        let coarse = self.contest.coarse(self.bench, model)?;
        let finer = shift(source, self.scene, self.bench.plan, &self.contest.fits[model]);
        let Some(finer) = finer else { return Ok(0.0) };
        let beside = Beside::new(&coarse.plan, &coarse.fitted, &[&finer.change])?;
        Ok(if source.kind() == NumericsKind::Inputs { beside.gain(0) } else { beside.most(0) })
    }
}
