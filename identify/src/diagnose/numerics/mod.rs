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
    pub source: Source,
    /// Δ of every record, rows (time, channel); NaN-free.
    pub change: Vec<Vec<f64>>,
    /// Order in the step or the edges; 0 where there is no refinement.
    order: i32,
}

impl Shift {
    /// That of some of its records.
    pub fn of_some(&self, keep: &[bool]) -> Self {
        let kept = self.change.iter().zip(keep).filter(|(_, keep)| **keep);
        Self { change: kept.map(|(change, _)| change.clone()).collect(), ..self.clone() }
    }
}

/// What a finer simulation has finer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Step,
    Mesh,
    /// Inputs read in this of the plan's other ways.
    Inputs(usize),
}

impl Source {
    pub fn kind(self) -> NumericsKind {
        match self {
            Self::Step => NumericsKind::Step,
            Self::Mesh => NumericsKind::Mesh,
            Self::Inputs(_) => NumericsKind::Inputs,
        }
    }
}

/// All of them at a fit. What cannot be simulated is left out. `scene`: that of the plan.
pub(super) fn shifts(scene: &Scene, plan: &Plan, fitted: &Fitted) -> Vec<Shift> {
    let mut out: Vec<Shift> = Vec::new();
    for source in [Source::Step, Source::Mesh, Source::Inputs(0), Source::Inputs(1)] {
        // of grippers alone two ways of reading are the same
        out.extend(shift(source, scene, plan, fitted).filter(|new| out.iter().all(|known| known.change != new.change)));
    }
    out
}

/// One of them, as [`shifts`].
pub(super) fn shift(source: Source, scene: &Scene, plan: &Plan, fitted: &Fitted) -> Option<Shift> {
    let (records, values) = (&fitted.records, &fitted.values);
    let (change, order) = match source {
        Source::Step => (step::shift(plan, records, values).ok()?, step::order(plan)),
        Source::Mesh if plan.model.n_nodes() == 0 => return None,
        Source::Mesh => mesh::shift(scene, plan, records, values)?,
        Source::Inputs(way) => (inputs(plan, records, values, way)?, 0),
    };
    let moves = change.iter().flatten().any(|x| *x != 0.0) || source.kind() != NumericsKind::Inputs;
    let finite = change.iter().flatten().all(|x| x.is_finite());
    (finite && moves).then_some(Shift { source, change, order })
}

/// Their changes, for [`super::beside::Beside`].
pub(super) fn changes(shifts: &[Shift]) -> Vec<&[Vec<f64>]> {
    shifts.iter().map(|shift| shift.change.as_slice()).collect()
}

/// Readings with the inputs read in this of the other ways between samples less those as the scene reads them.
fn inputs(plan: &Plan, records: &[RecordPlan], values: &Values, way: usize) -> Option<Vec<Vec<f64>>> {
    if plan.model.nu() == 0 {
        return None;
    }
    let one = |rec: &RecordPlan| {
        let plain = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let now = shoot(plan, &plain, values, ShotWants::default()).ok()?.predicted;
        let other = shoot(plan, &plain.with_other_inputs(way), values, ShotWants::default()).ok()?.predicted;
        Some(now.iter().zip(&other).map(|(a, b)| b - a).collect())
    };
    records.par_iter().map(one).collect()
}

impl Shift {
    /// Whether it is of a step that is too long for what a fit leaves.
    pub fn calls_for_a_finer_step(&self, plan: &Plan, fitted: &Fitted) -> bool {
        self.source == Source::Step && self.needed(plan, self.part(plan, fitted)).is_some()
    }

    /// Root mean square of it over what a fit leaves \[-\].
    fn part(&self, plan: &Plan, fitted: &Fitted) -> f64 {
        plan.rms(&self.change) / fitted.rmse.max(f64::MIN_POSITIVE)
    }

    /// Refinement that would bring that part to what is tolerated: the step \[s\], or the factor on the number of edges.
    fn needed(&self, plan: &Plan, part: f64) -> Option<f64> {
        let refined =
            (self.order > 0 && part > POLICY.tolerated).then(|| (POLICY.tolerated / part).powf(1.0 / f64::from(self.order)));
        match self.source {
            Source::Step => refined.map(|factor| plan.model.step_length() * factor),
            Source::Mesh => refined.map(f64::recip),
            Source::Inputs(_) => None,
        }
    }

    /// Its entry in a report, at a fit: `gain` from [`super::beside::Beside::gain`] under the noise of that fit, `beyond` from
    /// [`super::beside::Beside::over_left`].
    pub fn report(&self, plan: &Plan, fitted: &Fitted, gain: f64, beyond: f64) -> Numerics {
        let (rms, part, h) = (plan.rms(&self.change), self.part(plan, fitted), plan.model.step_length());
        let needed = self.needed(plan, part);
        let interpolation = match self.source {
            Source::Inputs(way) => Some(plan.interpolation.others()[way]),
            Source::Step | Source::Mesh => None,
        };
        let made_up = if part > POLICY.tolerated && beyond < part {
            format!(" ({:.0} % beyond what starts and fitted numbers make up for)", 100.0 * beyond)
        } else {
            String::new()
        };
        let size = format!("{}, {:.0} % of what is left{made_up}", quantity_plain(rms, plan.unit), 100.0 * part);
        let note = match self.source.kind() {
            NumericsKind::Step => format!("the step of {} s moves the readings by {size}", number_plain(h)),
            NumericsKind::Mesh => format!("the length of the edges moves the readings by {size}"),
            NumericsKind::Inputs => format!(
                "inputs read between samples by `interpolation = \"{}\"` move the readings by {size}",
                interpolation.map_or("", |way| way.name())
            ),
        };
        let unit = plan.unit.to_owned();
        Numerics { kind: self.source.kind(), interpolation, rms, unit, part, beyond, gain, needed, note }
    }
}
