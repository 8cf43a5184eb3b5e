//! The simulation's own errors: of its step, of its mesh, of how inputs are read between samples.
//!
//! Each is a change Δ of the readings, those of a finer simulation less those of the scene's. Estimates are wrong by as much as Δ in the data
//! would move them ([`super::beside`]): the scene's simulation makes up for its own error by it.

mod mesh;
mod step;

use super::policy::POLICY;
use super::result::{Numerics, NumericsKind};
use crate::fit::Fitted;
use crate::number::{number_plain, quantity_plain};
use crate::shooting::{Plan, RecordPlan, ShotWants, shoot};
use crate::unknown::Values;
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
    [NumericsKind::Step, NumericsKind::Mesh, NumericsKind::Inputs]
        .into_iter()
        .filter_map(|kind| shift(kind, scene, plan, fitted))
        .collect()
}

/// One of them, as [`shifts`].
pub(super) fn shift(kind: NumericsKind, scene: &Scene, plan: &Plan, fitted: &Fitted) -> Option<Shift> {
    let (records, values) = (&fitted.records, &fitted.values);
    let (change, order) = match kind {
        NumericsKind::Step => (step::shift(plan, records, values).ok()?, step::order(plan)),
        NumericsKind::Mesh if plan.model.ropes().is_empty() => return None,
        NumericsKind::Mesh => mesh::shift(scene, plan, records, values)?,
        NumericsKind::Inputs => (inputs(plan, records, values)?, 0),
    };
    let finite = change.iter().flatten().all(|x| x.is_finite());
    finite.then_some(Shift { kind, change, order })
}

/// Their changes, for [`super::beside::Beside`].
pub(super) fn changes(shifts: &[Shift]) -> Vec<&[Vec<f64>]> {
    shifts.iter().map(|shift| shift.change.as_slice()).collect()
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
    /// Its entry in a report, at a fit: `gain` from [`super::beside::Beside::gain`] under the noise of that fit.
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
