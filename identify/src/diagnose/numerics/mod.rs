//! The simulation's own errors in the units of what is fitted: of its step, of its mesh, of how inputs are read between samples.
//!
//! With Δ the readings of a finer simulation less those of the scene's, whitened, and G the sensitivities of everything fitted (starting
//! states projected off), an estimate is wrong by
//! ```text
//! b = (GᵀG)⁻¹ GᵀΔ
//! ```
//! as if Δ were in the data: the scene's simulation makes up for its own error by it.

mod mesh;
mod step;

use super::policy::POLICY;
use super::result::{Numerics, NumericsKind};
use super::scores::{reduce, reduce_instead};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::number::{number_plain, quantity_plain};
use crate::shooting::{Plan, RecordPlan, ShotWants, shoot};
use crate::stats::reduced::Reduced;
use crate::unknown::Values;
use nalgebra::DVector;
use pliant_scene::Scene;
use rayon::prelude::*;

/// Change of the readings by a finer simulation.
#[derive(Clone, Debug)]
pub(super) struct Shift {
    pub kind: NumericsKind,
    /// Δ of every record, rows (time, channel); NaN-free.
    pub change: Vec<Vec<f64>>,
    /// Order in the step or the edges; 0 where there is no refinement.
    order: i32,
}

/// All of them at a fit. What cannot be simulated is left out. `scene`: that of the plan.
pub(super) fn shifts(scene: &Scene, plan: &Plan, fitted: &Fitted) -> Vec<Shift> {
    let (records, values) = (&fitted.records, &fitted.values);
    let step = step::shift(plan, records, values).ok();
    let step = step.map(|change| Shift { kind: NumericsKind::Step, change, order: step::order(plan) });
    let ropes = !plan.model.ropes().is_empty();
    let mesh = if ropes { mesh::shift(scene, plan, records, values) } else { None };
    let mesh = mesh.map(|(change, order)| Shift { kind: NumericsKind::Mesh, change, order });
    let inputs = inputs(plan, records, values).map(|change| Shift { kind: NumericsKind::Inputs, change, order: 0 });
    let finite = |s: &Shift| s.change.iter().flatten().all(|x| x.is_finite());
    [step, mesh, inputs].into_iter().flatten().filter(finite).map(|shift| shift.beside(fitted)).collect()
}

/// Readings with the inputs read the other way between samples less those as the scene reads them.
fn inputs(plan: &Plan, records: &[RecordPlan], values: &Values) -> Option<Vec<Vec<f64>>> {
    if plan.model.nu() == 0 {
        return None;
    }
    let one = |rec: &RecordPlan| {
        let plain = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let now = shoot(plan, &plain, values, ShotWants::default()).ok()?.predicted;
        let other = shoot(plan, &plan.with_other_inputs(&plain), values, ShotWants::default()).ok()?.predicted;
        Some(now.iter().zip(&other).map(|(a, b)| b - a).collect())
    };
    records.par_iter().map(one).collect()
}

impl Shift {
    /// With the rows of a fit: a last sample at the very end of the last step may be read by one of two simulations alone.
    pub fn beside(&self, fitted: &Fitted) -> Self {
        let mut out = self.clone();
        out.change.iter_mut().zip(&fitted.residuals).for_each(|(change, r)| change.resize(r.len(), 0.0));
        out
    }

    /// b, in the coordinates of everything fitted.
    pub fn sizes(&self, plan: &Plan, fitted: &Fitted) -> Result<DVector<f64>, IdentifyError> {
        let moved = reduce_instead(plan, fitted, &self.change)?;
        Ok(super::procedure::across::solved(&moved.gram(), &moved.score()))
    }

    /// Squares that a simulation without this error would take from a fit, whatever is free refitted (linearized).
    pub fn gain(&self, plan: &Plan, fitted: &Fitted) -> Result<f64, IdentifyError> {
        let left = |r: &Reduced| {
            let score = r.score();
            r.rss() - score.dot(&super::procedure::across::solved(&r.gram(), &score))
        };
        let residuals = fitted.residuals.iter().zip(&self.change);
        let finer: Vec<Vec<f64>> = residuals.map(|(r, d)| r.iter().zip(d).map(|(r, d)| r - d).collect()).collect();
        let now = reduce(plan, fitted, &fitted.unknowns)?;
        Ok(left(&now) - left(&reduce_instead(plan, fitted, &finer)?))
    }

    /// Its entry in a report, at a fit: `gain` from [`Shift::gain`] under the noise of that fit.
    pub fn report(&self, plan: &Plan, fitted: &Fitted, gain: f64) -> Numerics {
        let rms = plan.rms(&self.change);
        let part = rms / fitted.rmse.max(f64::MIN_POSITIVE);
        let refined =
            (self.order > 0 && part > POLICY.tolerated).then(|| (POLICY.tolerated / part).powf(1.0 / f64::from(self.order)));
        let h = plan.model.step_length();
        let needed = match self.kind {
            NumericsKind::Step => refined.map(|factor| h * factor),
            NumericsKind::Mesh => refined.map(f64::recip),
            NumericsKind::Inputs => None,
        };
        let size = format!("{}, {:.0} % of what is left", quantity_plain(rms, plan.unit()), 100.0 * part);
        let note = match (self.kind, needed) {
            (NumericsKind::Step, Some(needed)) => {
                format!("the step of {} s moves the readings by {size}; {} s would do", number_plain(h), number_plain(needed))
            }
            (NumericsKind::Step, None) => format!("the step of {} s moves the readings by {size}", number_plain(h)),
            (NumericsKind::Mesh, Some(needed)) => {
                format!("the length of the ropes' edges moves the readings by {size}; {needed:.1} times the edges would do")
            }
            (NumericsKind::Mesh, None) => format!("the length of the ropes' edges moves the readings by {size}"),
            (NumericsKind::Inputs, _) => format!(
                "inputs read between samples by `interpolation = \"{}\"` move the readings by {size}",
                plan.interpolation.other().name()
            ),
        };
        Numerics { kind: self.kind, rms, unit: plan.unit().to_owned(), part, gain, needed, note }
    }
}
