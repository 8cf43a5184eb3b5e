//! Multipliers that the alternation weights rows with.

use std::collections::BTreeMap;

use super::Tube;
use super::constants::TUBE;
use super::rows::RowValues;
use crate::ocp::{Ocp, OcpSolution};

/// A running mean of the nominal problems' multipliers.
///
/// The multipliers of the tightened problem rise with the tightenings, and tightenings fall with the multipliers they are weighted by: the
/// one after the other is a falling map, which a shorter step makes contract. Where the tightened problem is about to become infeasible its
/// multipliers jump, for soft rows to their prices; the optimum is then at a mean of the values on both sides.
#[derive(Default)]
pub(super) struct Multipliers {
    mean: Option<RowValues>,
    step: f64,
    last_distance: f64,
    /// Raised ones, by stage and place.
    pub raised: BTreeMap<(usize, usize), f64>,
}

impl Multipliers {
    /// Moves the mean towards the multipliers of a nominal problem tightened by a tube; returns the step.
    ///
    /// Steps are 1, and 1, ½, ⅓ … from where the distance does not shrink. Towards multipliers of a problem that violates soft rows the
    /// step is at most that which raises the worst row's by (h / h')², where h' is the tightening that it could have: responses shrink
    /// about as the root of weights grows.
    pub fn update(&mut self, ocp: &Ocp, nominal: &OcpSolution, tube: &Tube, feasibility: f64) -> f64 {
        let target = multipliers_of(ocp, nominal, &tube.sizes, nominal.cost.abs() + tube.cost.unwrap_or(0.0));
        let Some(mean) = &mut self.mean else {
            (self.mean, self.step, self.last_distance) = (Some(target), 1.0, f64::INFINITY);
            return 1.0;
        };
        let distance = target.weighted_distance(mean, &tube.sizes);
        if distance > TUBE.stalled * self.last_distance * (1.0 - 0.5 * self.step) {
            self.step /= 1.0 + self.step;
        }
        self.last_distance = distance;
        let mut shortened: Option<f64> = None;
        for (k, violations) in nominal.violations.iter().enumerate() {
            for (i, violation) in violations.iter().enumerate().filter(|(_, violation)| **violation > feasibility) {
                let h = tube.tightenings.rows(k)[i];
                let (from, to) = (mean.rows(k)[i], target.rows(k)[i]);
                let ratio = if *violation < h { (h / (h - violation)).min(TUBE.escalation) } else { TUBE.escalation };
                let part = if from > 0.0 && to > from { from * (ratio * ratio - 1.0) / (to - from) } else { 1.0 };
                shortened = Some(shortened.unwrap_or(0.0).max(part));
            }
        }
        let step = shortened.map_or(self.step, |part| part.min(self.step));
        mean.approach(&target, step);
        step
    }

    /// The mean.
    pub fn mean(&self, tube: &Tube) -> RowValues {
        self.mean.clone().unwrap_or_else(|| tube.tightenings.zeros_like())
    }
}

/// Multipliers of rows and inputs, without those that are rounding of the solver: multiplier times tightening is the part of the cost that
/// a row's tightening decides, and the one without weights is its size.
fn multipliers_of(ocp: &Ocp, nominal: &OcpSolution, sizes: &RowValues, scale: f64) -> RowValues {
    let mut multipliers = RowValues::multipliers(ocp, nominal);
    for k in 0..sizes.len() {
        for (mu, size) in multipliers.stage_mut(k).iter_mut().zip(sizes.stage(k)) {
            if *mu * size <= TUBE.negligible_multiplier * scale {
                *mu = 0.0;
            }
        }
    }
    multipliers
}
