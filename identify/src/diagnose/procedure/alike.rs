//! Causes that no data of this kind could tell from an accepted one.
//!
//! If another cause imitates an accepted one exactly, whatever its size, then it also does so for a small change of size: at the accepted model,
//! and at the same one with the cause taken back to the scene's value, the two directions of change of the readings are parallel, all else
//! that is fitted projected off: nearly so without the cause, where the model is not that of the data. That needs no refit, which may fail to arrive (an encoder's scale that stands for a floor's friction has
//! to take every starting state with it). One end alone would not do: beside a free gain, an encoder's scale changes the size of a cubic
//! spring that is there, and makes none.

use super::super::policy::POLICY;
use super::super::scores::scores_in;
use super::coarse::Coarse;
use super::hypothesis::{Bench, Hypothesis};
use crate::causes::{Cause, Situation};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::unknown::Unknown;

/// Of every accepted cause the others that move the readings in the same way. `refitted`: models that were held against others, by their
/// keys; a cause that was refitted in place of the accepted one is judged by that.
pub(super) fn alike(
    bench: &Bench,
    best: &Hypothesis,
    fitted: &Fitted,
    refitted: &[Vec<String>],
    seed: u64,
) -> Result<Vec<Vec<Cause>>, IdentifyError> {
    let coarse = Coarse::of(bench, fitted)?;
    let (bench, fitted) = (&coarse.bench(bench), &coarse.fitted);
    let one = |cause: &Cause| -> Result<Vec<Cause>, IdentifyError> {
        let swapped = |other: &Cause| {
            let mut key: Vec<String> = best.key().into_iter().filter(|t| *t != cause.title()).chain([other.title()]).collect();
            key.sort();
            key
        };
        let mut all = parallel(bench, fitted, cause, POLICY.alike, seed)?;
        all.retain(|other| !refitted.contains(&swapped(other)));
        if all.is_empty() {
            return Ok(all);
        }
        let mut back = fitted.clone();
        cause.unknowns.iter().for_each(|u| u.set(&mut back.values, u.value(&bench.plan.scene_values)));
        let there: Vec<String> = parallel(bench, &back, cause, POLICY.alike_before, seed)?.iter().map(Cause::title).collect();
        all.retain(|other| there.contains(&other.title()));
        Ok(all)
    };
    best.causes.iter().map(one).collect()
}

/// The causes whose directions have at least this cosine with that of `cause` at a fit.
fn parallel(bench: &Bench, fitted: &Fitted, cause: &Cause, cosine: f64, seed: u64) -> Result<Vec<Cause>, IdentifyError> {
    let own = |u: &&Unknown| cause.unknowns.iter().any(|o| o.target.same(&u.target));
    let others: Vec<Unknown> = fitted.unknowns.iter().filter(|u| !own(u)).cloned().collect();
    let at = Situation { plan: bench.plan, values: &fitted.values, free: &others, together: true };
    let tested = scores_in(bench.plan, &at, &Fitted { unknowns: others.clone(), ..fitted.clone() }, seed)?;
    let of = |j: usize| &tested.causes[tested.tested[j]];
    let all = 0..tested.tested.len();
    let Some(j) = all.clone().find(|&j| of(j).title() == cause.title()) else { return Ok(Vec::new()) };
    let same = |k: &usize| *k != j && tested.score.candidates[*k].rank > 0 && tested.score.containment[(j, *k)] >= cosine;
    Ok(all.filter(same).map(|k| of(k).clone()).collect())
}
