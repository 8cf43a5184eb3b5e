//! From pieces to whole records.
//!
//! Records that a model does not follow to noise are cut into pieces, each with a beginning of its own ([`crate::fit::cut`]). Pieces find what is far
//! off, and say little of the rest: what acts for a moment is taken up by the beginning of the next piece, and slow effects by all of them. With
//! what was found on pieces, whole records may be followed. There the models that were found compete again, and the search goes on.

use super::super::policy::POLICY;
use super::apart::carried;
use super::hypothesis::{Bench, Hypothesis};
use super::search::{Entrants, Found, search};
use crate::error::IdentifyError;
use crate::fit::{Cut, FIT, Fitted, cut};
use crate::shooting::Plan;
use pliant_scene::Scene;

/// The plan with whole records in place of their pieces, where what was found leaves noise in these and the motion is not too sensitive to be followed
/// for so long.
pub(in super::super) fn rejoined(bench: &Bench, found: &Found) -> Result<Option<Plan>, IdentifyError> {
    if !bench.plan.in_pieces() || found.no_noise {
        return Ok(None);
    }
    let mut plan = Plan { fitted: bench.plan.wholes.clone(), ..bench.plan.clone() };
    let cut = cut(&mut plan, &found.fitted.values, None, FIT.growth_followed)?;
    Ok(matches!(cut, Cut::Joined(_)).then_some(plan))
}

/// The search over whole records, from what was found on pieces of them; none where the best model of them leaves more than noise, which says less
/// than the pieces do, or cannot be simulated.
pub(in super::super) fn searched_on(
    bench: &Bench,
    scene: &Scene,
    pieces: &Found,
    most: usize,
    seed: u64,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<Found>, IdentifyError> {
    progress("following whole records with what was found on pieces of them");
    let Ok(base) = bench.whole(&pieces.base.fitted) else { return Ok(None) };
    let found = match pieces.best.causes.len().checked_sub(1) {
        None => search(bench, scene, base, None, most, seed, progress)?,
        Some(last) => {
            let Ok(best) = bench.joined(&pieces.best) else { return Ok(None) };
            if bench.no_noise(&best.fitted) {
                return Ok(None);
            }
            let parent = if last == 0 { Hypothesis::baseline(base.clone()) } else { bench.without(&best, last)? };
            let tied = pieces.tied.iter().filter_map(|model| bench.joined(model).ok());
            let models = std::iter::once(best).chain(tied).collect();
            search(bench, scene, base, Some(Entrants { parent, models }), most, seed, progress)?
        }
    };
    Ok((!found.no_noise).then_some(found))
}

impl Bench<'_> {
    /// A fit of pieces on whole records.
    fn whole(&self, fitted: &Fitted) -> Result<Fitted, IdentifyError> {
        let records = carried(fitted, &self.plan.fitted);
        self.first(&records, &fitted.values, &fitted.unknowns, &POLICY.rough.options)
    }

    /// A model of pieces on whole records; those on the way to it keep their values, as they were found.
    fn joined(&self, model: &Hypothesis) -> Result<Hypothesis, IdentifyError> {
        let rough = self.whole(&model.fitted)?;
        let fitted = self.finished(&rough, &rough.records)?;
        let starts = |before: &Fitted| -> Result<Fitted, IdentifyError> {
            let there = self.whole(&Fitted { unknowns: Vec::new(), ..before.clone() })?;
            Ok(Fitted { unknowns: before.unknowns.clone(), ..there })
        };
        let mut trail: Vec<Fitted> = model.trail.iter().rev().skip(1).rev().map(starts).collect::<Result<_, _>>()?;
        trail.push(fitted.clone());
        Ok(Hypothesis { fitted, trail, ..model.clone() })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::super::baseline::Prepared;
    use super::*;
    use crate::fit::FitOptions;
    use crate::log::Setup;
    use crate::shooting::{RecordPlan, ShotWants, shoot};
    use crate::stats::testing::gaussians;
    use pliant_scene::Source;
    use std::path::PathBuf;

    /// Swings from near the top of a pendulum with this damping [N·m·s/rad], of which the scene knows nothing, as they are begun: in pieces where it
    /// is large.
    fn begun(damping: f64) -> (Plan, Prepared, Fitted) {
        let text = pendulum("measured");
        let setup = Setup::from_source(Source::new("scene.toml", text.clone()), PathBuf::new()).unwrap();
        let starts = [2.9, 3.0, 3.1, 2.8, 2.7].map(|angle| vec![angle; 40]);
        let truth = experiment(&text, &starts).0;
        let mut values = truth.scene_values.clone();
        values.theta[truth.model.params().find("pivot.damping").unwrap()] = damping;
        let read = |(k, rec): (usize, &RecordPlan)| -> Vec<f64> {
            let seen = shoot(&truth, rec, &values, ShotWants::default()).unwrap().predicted;
            seen.iter().zip(gaussians(40, k as u64)).map(|(x, e)| x + 1e-4 * e).collect()
        };
        let readings: Vec<Vec<f64>> = truth.fitted.iter().chain(&truth.held_out).enumerate().map(read).collect();
        let mut plan = experiment(&text, &readings).0;
        let (prepared, plain) = Prepared::begun(&setup, &mut plan, &FitOptions::default(), &[0.0]).unwrap();
        (plan, prepared, plain)
    }

    #[test]
    fn what_pieces_find_is_followed_over_whole_records() {
        let (plan, prepared, plain) = begun(2.0);
        assert!(plan.in_pieces() && plan.fitted.len() > plan.wholes.len());
        let bench = prepared.seen(&plan, &plain, &[0.0]).unwrap();
        let scene = pliant_scene::Scene::default();
        let base = bench.finished(&plain, &plain.records).unwrap();
        let pieces = search(&bench, &scene, base, None, 2, 0, &mut |_| ()).unwrap();
        let whole = rejoined(&bench, &pieces).unwrap().unwrap();
        assert!(!whole.in_pieces() && whole.fitted.len() == plan.wholes.len());
        let found = searched_on(&bench.on(&whole), &scene, &pieces, 2, 0, &mut |_| ()).unwrap().unwrap();
        let names = |found: &Found| found.best.causes.iter().map(|cause| cause.name).collect::<Vec<_>>();
        // in pieces with beginnings of their own a damper looks like an inertia
        assert_eq!((names(&pieces), names(&found)), (vec!["link_inertia"], vec!["viscous_friction"]));
        assert_eq!((found.fitted.records.len(), found.base.fitted.records.len()), (4, 4));
        // of a model that leaves more than noise pieces are not joined
        assert!(rejoined(&bench, &Found { no_noise: true, ..pieces }).unwrap().is_none());
    }
}
