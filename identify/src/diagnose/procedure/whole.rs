//! From pieces to whole records.
//!
//! Records that a model does not follow to noise are cut into pieces, each with a beginning of its own ([`crate::fit::cut`]). Pieces find what is far
//! off, and say little of the rest: what acts for a moment is taken up by the beginning of the next piece, and slow effects by all of them. With
//! what was found on pieces, whole records may be followed. There the models that were found compete again, and the search goes on.

use super::super::policy::POLICY;
use super::apart::carried;
use super::hypothesis::{Bench, Hypothesis};
use super::search::{Entrants, Found, search};
use crate::causes::{Situation, library};
use crate::error::IdentifyError;
use crate::fit::{Cut, FIT, Fitted, cut};
use crate::shooting::Plan;
use pliant_scene::Scene;

/// The plan with whole records in place of their pieces, where what was found leaves noise in these and the motion is not too sensitive to be followed
/// for so long.
pub(in super::super) fn rejoined(bench: &Bench, found: &Found) -> Option<Plan> {
    if !bench.plan.in_pieces() || found.no_noise {
        return None;
    }
    let mut plan = Plan { fitted: bench.plan.wholes.to_vec(), ..bench.plan.clone() };
    let cut = cut(&mut plan, &found.fitted.values, None, FIT.growth_followed).ok()?;
    matches!(cut, Cut::Joined(_)).then_some(plan)
}

/// The search over whole records, from what was found on pieces of them. None where the best model of them leaves more than noise, which says less
/// than the pieces do, or where one of the models cannot be simulated for so long: then what the pieces say stands.
pub(in super::super) fn searched_on(
    bench: &Bench,
    scene: &Scene,
    pieces: &Found,
    most: usize,
    seed: u64,
    progress: &mut dyn FnMut(&str),
) -> Option<Found> {
    progress("following whole records with what was found on pieces of them");
    let mut follow = || -> Result<Option<Found>, IdentifyError> {
        if let Some(found) = Found::reached(bench) {
            return Ok(Some(found));
        }
        let base = bench.whole(&pieces.base.fitted)?;
        bench.plan.journal.baseline(base.rmse, bench.plan.unit);
        let Some(last) = pieces.best.causes.len().checked_sub(1) else {
            return search(bench, scene, base, None, most, seed, &mut *progress).map(Some);
        };
        let best = bench.joined(&pieces.best)?;
        if bench.no_noise(&best.fitted) {
            return Ok(None);
        }
        let parent = if last == 0 { Hypothesis::baseline(base.clone()) } else { bench.without(&best, last)? };
        let tied = pieces.tied.iter().map(|model| bench.joined(model));
        let models = std::iter::once(Ok(best)).chain(tied);
        let at = Situation { plan: bench.plan, values: &base.values, free: &base.unknowns, together: true };
        let tests = library(&at).iter().filter(|cause| cause.untestable.is_none()).count();
        let entrants = Entrants { parent, models: models.collect::<Result<_, _>>()?, tests };
        search(bench, scene, base, Some(entrants), most, seed, &mut *progress).map(Some)
    };
    match follow() {
        Ok(found) => found.filter(|found| !found.no_noise),
        Err(e) => {
            progress(&format!("whole records are not followed: {e}"));
            None
        }
    }
}

impl Bench<'_> {
    /// A fit of pieces on whole records.
    fn whole(&self, fitted: &Fitted) -> Result<Fitted, IdentifyError> {
        let records = carried(fitted, &self.plan.fitted);
        let rough = self.first(&records, &fitted.values, &fitted.unknowns, &POLICY.rough.options)?;
        self.finished(&rough, &rough.records)
    }

    /// A model of pieces on whole records.
    fn joined(&self, model: &Hypothesis) -> Result<Hypothesis, IdentifyError> {
        model.fitted_as(self.whole(&model.fitted)?, |before| self.whole(before))
    }
}

#[cfg(test)]
pub(in super::super) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::super::baseline::Prepared;
    use super::*;
    use crate::fit::FitOptions;
    use crate::journal::{Journal, Partial};
    use crate::log::Setup;
    use crate::shooting::{RecordPlan, ShotWants, shoot};
    use crate::stats::testing::gaussians;
    use pliant_scene::Source;
    use std::path::PathBuf;
    use std::sync::Arc;

    /// Swings from near the top of a pendulum with this damping [N·m·s/rad], of which the scene knows nothing, as they are begun: in pieces where it
    /// is large.
    pub fn begun(damping: f64) -> (Plan, Prepared, Fitted) {
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
        let scene = Scene::default();
        let base = bench.finished(&plain, &plain.records).unwrap();
        let pieces = search(&bench, &scene, base, None, 2, 0, &mut |_| ()).unwrap();
        let whole = rejoined(&bench, &pieces).unwrap();
        assert!(!whole.in_pieces() && whole.fitted.len() == plan.wholes.len());
        let found = searched_on(&bench.on(&whole), &scene, &pieces, 2, 0, &mut |_| ()).unwrap();
        let names = |found: &Found| found.best.causes.iter().map(|cause| cause.name).collect::<Vec<_>>();
        // in pieces with beginnings of their own a damper looks like an inertia
        assert_eq!((names(&pieces), names(&found)), (vec!["link_inertia"], vec!["viscous_friction"]));
        assert_eq!((found.fitted.records.len(), found.base.fitted.records.len()), (4, 4));
        // of a model that leaves more than noise pieces are not joined
        assert!(rejoined(&bench, &Found { no_noise: true, ..pieces }).is_none());
    }

    /// What a search over pieces has reached is not taken for that of whole records, and is still there.
    #[test]
    fn both_searches_are_kept() {
        let (mut plan, prepared, plain) = begun(2.0);
        let journal = Journal::new(Partial::default(), Box::new(|_| ()));
        plan.journal = Arc::clone(&journal);
        let bench = prepared.seen(&plan, &plain, &[0.0]).unwrap();
        let base = bench.finished(&plain, &plain.records).unwrap();
        let scene = Scene::default();
        let run = || {
            let pieces = search(&bench, &scene, base.clone(), None, 1, 0, &mut |_| ()).unwrap();
            let whole = rejoined(&bench, &pieces).unwrap();
            let found = searched_on(&bench.on(&whole), &scene, &pieces, 1, 0, &mut |_| ()).unwrap();
            [pieces, found].map(|found| (found.best.key(), found.fitted.values, found.fitted.residuals))
        };
        let first = run();
        let names: Vec<String> = journal.so_far().states.into_keys().collect();
        assert!(["search", "search in pieces"].iter().all(|name| names.iter().any(|n| n == name)), "{names:?}");
        assert_eq!(run(), first);
        assert!(Found::reached(&bench).is_some_and(|found| found.best.key() == first[0].0));
    }

    /// Causes that stand no more where the records are whole leave nothing behind: the search goes on from the baseline.
    #[test]
    fn the_search_begins_anew_where_nothing_stands() {
        let (plan, prepared, plain) = begun(0.02);
        assert!(!plan.in_pieces());
        let bench = prepared.seen(&plan, &plain, &[0.0]).unwrap();
        let base = bench.finished(&plain, &plain.records).unwrap();
        let at = Situation { plan: &plan, values: &base.values, free: &base.unknowns, together: true };
        let with = |model: &Hypothesis, name: &str| {
            let cause = library(&at).into_iter().find(|cause| cause.name == name).unwrap();
            let (fitted, cause) = bench.with(&model.fitted, &cause, &[f64::NAN], &[]).unwrap();
            model.and(cause, fitted)
        };
        let parent = with(&Hypothesis::baseline(base.clone()), "encoder_bias");
        let entrants = Entrants { models: vec![with(&parent, "sensor_delay")], parent, tests: 15 };
        let found = search(&bench, &Scene::default(), base, Some(entrants), 3, 0, &mut |_| ()).unwrap();
        assert_eq!(found.best.causes.iter().map(|cause| cause.name).collect::<Vec<_>>(), ["viscous_friction"]);
    }
}
