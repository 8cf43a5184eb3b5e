//! Steps 5 and 6: which cause is accepted next, if any may be named.
//!
//! Score tests are linear; a name is given only after nonlinear refits. The best refit j is named if it beats every rival k,
//! ```text
//! (C_k − C_j − (d_j − d_k)) / (2 |W (ŷ_j − ŷ_k)|) > Φ⁻¹(1 − 0.05/m)
//! ```
//! with C the whitened cost under the best refit's noise, d the number of parameters, m the number of rivals (Vuong 1989 for a
//! known noise), or if j and k are each significant on top of the other (then both are present, and k will have its turn).

use super::certainty::Curvature;
use super::constants::DIAGNOSE;
use super::scores::Scores;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted, approach, fit, fit_noise};
use crate::shooting::Plan;
use crate::stats::ar::ArModel;
use crate::stats::dist::{chi2_quantile, chi2_sf, normal_quantile};
use crate::stats::naming::lead;
use crate::unknown::{Target, Unknown, Values};

/// Outcome of a round of selection.
pub(super) enum Round {
    /// Nothing is significant.
    Nothing,
    /// Something is, but every cause was rejected.
    Rejected,
    /// These causes explain it equally well (indices of tested candidates, best first); the fit with the best.
    Ambiguous { set: Vec<usize>, fitted: Box<Fitted> },
    /// This candidate is accepted; `shape` is free beside its own unknowns.
    Accepted { candidate: usize, fitted: Box<Fitted>, shape: Vec<Unknown>, statistic: f64, margin: Option<Margin> },
}

/// Lead of a cause over the nearest of the refitted rivals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Margin {
    pub rival: String,
    /// Left side of the inequality above [-].
    pub lead: f64,
    /// Its right side [-].
    pub needed: f64,
}

struct Refit {
    candidate: usize,
    fitted: Fitted,
    dims: usize,
}

/// Decrease of the deviance by a refit.
fn gain(current: &Fitted, fitted: &Fitted) -> f64 {
    current.deviance - fitted.deviance
}

/// A rough refit followed to its end.
fn finished(plan: &Plan, rough: &Fitted, options: &FitOptions) -> Result<Fitted, IdentifyError> {
    fit(plan, &rough.records, &rough.values, &rough.unknowns, Some(&rough.noise), options)
}

/// One round; `notes` gathers why candidates were rejected.
pub(super) fn round(
    plan: &Plan,
    current: &Fitted,
    tested: &Scores,
    options: &FitOptions,
    notes: &mut Vec<(usize, String)>,
    progress: &mut dyn FnMut(&str),
) -> Result<Round, IdentifyError> {
    let mut significant: Vec<usize> = (0..tested.tested.len())
        .filter(|&j| {
            tested.adjusted[j] <= DIAGNOSE.level && tested.score.candidates[j].rank > 0 && tested.score.candidates[j].admissible
        })
        .collect();
    if significant.is_empty() {
        return Ok(Round::Nothing);
    }
    significant.sort_by(|&a, &b| tested.score.candidates[b].z.total_cmp(&tested.score.candidates[a].z));
    compare(plan, current, tested, &foremost(tested, &significant), options, notes, progress)
}

/// The first few of the candidates, and those whose score comes near the best.
fn foremost(tested: &Scores, sorted: &[usize]) -> Vec<usize> {
    let lm = |j: usize| tested.score.candidates[j].lm;
    let close = |(rank, j): (usize, &usize)| (rank < DIAGNOSE.refits || lm(*j) > DIAGNOSE.close * lm(sorted[0])).then_some(*j);
    sorted.iter().enumerate().filter_map(close).collect()
}

/// Refits the chosen candidates and compares the best with the others.
#[allow(clippy::too_many_arguments)] // the parts of a round
pub(super) fn compare(
    plan: &Plan,
    current: &Fitted,
    tested: &Scores,
    chosen: &[usize],
    options: &FitOptions,
    notes: &mut Vec<(usize, String)>,
    progress: &mut dyn FnMut(&str),
) -> Result<Round, IdentifyError> {
    let rough = FitOptions { tolerance: DIAGNOSE.rough, ..*options };
    let mut refits = Vec::new();
    for &candidate in chosen {
        let cause = &tested.causes[tested.tested[candidate]];
        progress(&format!("refitting with {}", cause.title()));
        let least = refits.iter().map(|r: &Refit| r.fitted.rmse).fold(f64::INFINITY, f64::min);
        let start = opened(current, cause, tested, candidate);
        match refit_with(plan, &start, &cause.unknowns, current, DIAGNOSE.far_behind * least, &rough) {
            Ok(fitted) => refits.push(Refit { candidate, dims: cause.unknowns.len(), fitted }),
            Err(e) => notes.push((candidate, format!("its refit failed: {e}"))),
        }
    }
    let most = refits.iter().map(|r| gain(current, &r.fitted)).fold(0.0, f64::max);
    let mut kept = Vec::new();
    for mut refit in refits {
        let cause = &tested.causes[tested.tested[refit.candidate]];
        let own = gain(current, &refit.fitted);
        if own > DIAGNOSE.followed * most || most - own < DIAGNOSE.reach {
            progress(&format!("finishing the refit with {}", cause.title()));
            match finished(plan, &refit.fitted, options) {
                Ok(fitted) => refit.fitted = fitted,
                Err(e) => {
                    notes.push((refit.candidate, format!("its refit failed: {e}")));
                    continue;
                }
            }
        }
        match rejection(current, &refit.fitted, cause) {
            Some(reason) => notes.push((refit.candidate, reason)),
            None => kept.push(refit),
        }
    }
    let mut refits = kept;
    let rows: f64 = current.residuals.iter().map(|r| r.len() as f64).sum();
    let bic = |r: &Refit| r.fitted.deviance + r.dims as f64 * rows.ln();
    let Some(best) = (0..refits.len()).min_by(|&a, &b| bic(&refits[a]).total_cmp(&bic(&refits[b]))) else {
        return Ok(Round::Rejected);
    };
    let best = refits.swap_remove(best);
    let (rivals, margin) = unbeaten(plan, current, tested, &best, &refits, options)?;
    if rivals.is_empty() {
        let statistic = current.deviance - best.fitted.deviance;
        let cause = &tested.causes[tested.tested[best.candidate]];
        let (fitted, shape) = shaped(plan, best.fitted, cause, options)?;
        return Ok(Round::Accepted { candidate: best.candidate, fitted: Box::new(fitted), shape, statistic, margin });
    }
    let set = [best.candidate].into_iter().chain(rivals).collect();
    Ok(Round::Ambiguous { set, fitted: Box::new(best.fitted) })
}

/// The current fit at the cause's point of its nuisance grid, with its size at half of its one-step estimate where its law is silent at
/// zero: a joint that friction holds still carries no information on the size.
fn opened(current: &Fitted, cause: &Cause, tested: &Scores, candidate: usize) -> Fitted {
    let mut out = current.clone();
    if let [grid_point] = cause.nuisance_grid.as_slice() {
        grid_point.iter().for_each(|&(entry, value)| out.values.theta[entry] = value);
    }
    for (u, step) in cause.unknowns.iter().zip(&tested.score.candidates[candidate].theta) {
        if let Some(probe) = u.silent(&current.values) {
            let start = DIAGNOSE.start_part * step * u.slope(0.0);
            u.set(&mut out.values, if start > probe.small { start } else { probe.start });
        }
    }
    out
}

/// The refit with the parameters of the cause's nuisance grid freed too, now that its size is not zero: all of them if the data determine
/// them (standard errors of their logarithms below 1), else none.
fn shaped(plan: &Plan, fitted: Fitted, cause: &Cause, options: &FitOptions) -> Result<(Fitted, Vec<Unknown>), IdentifyError> {
    let own = |entry: usize| cause.unknowns.iter().any(|u| u.target.entries().iter().any(|(k, _)| *k == entry));
    let brought = cause.nuisance_grid.iter().flatten().filter(|(entry, _)| !own(*entry));
    let free = |&(entry, _): &(usize, f64)| {
        Some(Unknown::of_theta(&plan.model, &plan.model.params().info(entry).path, 1.0)?.logarithmic())
    };
    let shape: Vec<Unknown> = brought.filter_map(free).collect();
    if shape.is_empty() {
        return Ok((fitted, shape));
    }
    let Ok(freed) = refit(plan, &fitted, &shape, options) else { return Ok((fitted, Vec::new())) };
    let errors = Curvature::new(plan, &freed)?.std_errors();
    let known = errors.iter().rev().take(shape.len()).all(|error| *error < DIAGNOSE.shape_error);
    Ok(if known && freed.converged && freed.deviance <= fitted.deviance { (freed, shape) } else { (fitted, Vec::new()) })
}

/// Fit with further unknowns, from the current optimum.
pub(super) fn refit(plan: &Plan, current: &Fitted, more: &[Unknown], options: &FitOptions) -> Result<Fitted, IdentifyError> {
    refit_with(plan, current, more, current, f64::INFINITY, options)
}

/// The same from `start`, which is not the optimum itself; an error above `useless` is of no interest.
fn refit_with(
    plan: &Plan,
    start: &Fitted,
    more: &[Unknown],
    current: &Fitted,
    useless: f64,
    options: &FitOptions,
) -> Result<Fitted, IdentifyError> {
    let unknowns = plan.tied(current.unknowns.iter().chain(more).cloned().collect());
    let mut values = start.values.clone();
    plan.followers.iter().for_each(|&(leader, follower)| {
        if unknowns.iter().any(|u| u.target == Target::Theta(vec![leader, follower])) {
            values.theta[follower] = values.theta[leader];
        }
    });
    let fitted = fit(plan, &current.records, &values, &unknowns, Some(&current.noise), options);
    let gained = fitted.as_ref().is_ok_and(|f| gain(current, f) > chi2_quantile(1.0 - DIAGNOSE.level, more.len().max(1) as f64));
    if more.is_empty() {
        return fitted;
    }
    if let (true, Ok(fitted)) = (gained, &fitted) {
        return nearer(plan, fitted, current, &values, useless, options);
    }
    // stuck on the old trajectory although the score is significant: start again from the data
    let (values, records) = approach(plan, &current.records, &values, &unknowns, options)?;
    fit(plan, &records, &values, &unknowns, None, options)
}

/// A refit, or the one that least squares leads to if that comes much nearer to the data.
///
/// Whitened by the colour of a large residual, a fit gives slow errors little weight and may stop on the way: the friction of a floor once
/// ended half-way so, though the right value leaves nothing but noise. A refit that takes most of the error needs no second try.
fn nearer(
    plan: &Plan,
    fitted: &Fitted,
    current: &Fitted,
    start: &Values,
    useless: f64,
    options: &FitOptions,
) -> Result<Fitted, IdentifyError> {
    if fitted.rmse < DIAGNOSE.half_way * current.rmse {
        return Ok(fitted.clone());
    }
    let Ok(plain) = fit(plan, &current.records, start, &fitted.unknowns, None, &DIAGNOSE.second_try) else {
        return Ok(fitted.clone());
    };
    if plain.rmse > (DIAGNOSE.nearer * fitted.rmse).min(useless) {
        return Ok(fitted.clone());
    }
    let lost = fitted.unknowns.len() + plain.records.iter().map(|r| r.start.z.len()).sum::<usize>();
    let noise = fit_noise(plan, &plain.residuals, lost)?;
    let other = fit(plan, &plain.records, &plain.values, &fitted.unknowns, Some(&noise), options)?;
    Ok(if other.deviance < fitted.deviance { other } else { fitted.clone() })
}

/// Why physics or likelihood rejects a refit.
fn rejection(current: &Fitted, fitted: &Fitted, cause: &Cause) -> Option<String> {
    let drop = gain(current, fitted);
    let p = chi2_sf(drop.max(0.0), cause.unknowns.len() as f64);
    if p > DIAGNOSE.level {
        return Some(format!("after the refit it is not significant (likelihood ratio {drop:.1})"));
    }
    if let [one] = cause.unknowns.as_slice() {
        let value = one.value(&fitted.values);
        if value <= one.bounds.0 || value >= one.bounds.1 {
            return Some(format!("its refit ends at the physical bound {} = {value}", one.path));
        }
    }
    None
}

/// Candidates that the best refit does not beat, and how far it is ahead of the nearest that it beats.
fn unbeaten(
    plan: &Plan,
    current: &Fitted,
    tested: &Scores,
    best: &Refit,
    others: &[Refit],
    options: &FitOptions,
) -> Result<(Vec<usize>, Option<Margin>), IdentifyError> {
    let in_play: Vec<usize> = (0..tested.tested.len())
        .filter(|&k| k != best.candidate && tested.score.candidates[k].rank > 0 && tested.score.candidates[k].admissible)
        .collect();
    let m = in_play.len().max(1) as f64;
    let bar = normal_quantile(1.0 - DIAGNOSE.level / m);
    let mut out = Vec::new();
    let mut nearest: Option<Margin> = None;
    for k in in_play {
        let Some(rival) = others.iter().find(|r| r.candidate == k) else {
            // not refitted: the linear rule, unless it was tried and rejected
            let significant = tested.adjusted[k] <= DIAGNOSE.level;
            if !significant
                && tested.score.candidates[best.candidate].lm < DIAGNOSE.close.recip() * tested.score.candidates[k].lm
                && lead(&tested.score, best.candidate, k) <= bar
            {
                out.push(k);
            }
            continue;
        };
        let cause = &tested.causes[tested.tested[k]];
        let ahead = comparison(plan, best, rival, &best.fitted.noise)?;
        let ahead = tested.score.candidates[best.candidate].credible(ahead);
        if ahead > bar {
            if nearest.as_ref().is_none_or(|n| ahead < n.lead) {
                nearest = Some(Margin { rival: cause.title(), lead: ahead, needed: bar });
            }
            continue;
        }
        let start = opened(&best.fitted, cause, tested, k);
        let both = refit_with(plan, &start, &cause.unknowns, &best.fitted, f64::INFINITY, options)?;
        let alpha = 0.5 * DIAGNOSE.level / m;
        let adds = |without: &Fitted, dims: usize| chi2_sf((without.deviance - both.deviance).max(0.0), dims as f64) < alpha;
        if !(adds(&best.fitted, rival.dims) && adds(&rival.fitted, best.dims)) || symmetric(tested, best.candidate, k) {
            out.push(k);
        }
    }
    let _ = current;
    out.sort_by(|&a, &b| tested.score.candidates[b].z.total_cmp(&tested.score.candidates[a].z));
    Ok((out, nearest))
}

fn symmetric(tested: &Scores, j: usize, k: usize) -> bool {
    tested.score.containment[(j, k)] >= DIAGNOSE.contained
}

/// Vuong's statistic of two refits under one noise model.
fn comparison(plan: &Plan, best: &Refit, rival: &Refit, noise: &ArModel) -> Result<f64, IdentifyError> {
    let (mut difference, mut distance) = (0.0, 0.0);
    for (j, k) in best.fitted.residuals.iter().zip(&rival.fitted.residuals) {
        let (mut j, mut k) = (j.clone(), k.clone());
        noise.whiten(&mut j, plan.channels())?;
        noise.whiten(&mut k, plan.channels())?;
        for (a, b) in j.iter().zip(&k) {
            difference += b * b - a * a;
            distance += (a - b) * (a - b);
        }
    }
    Ok((difference - (best.dims as f64 - rival.dims as f64)) / (2.0 * distance.sqrt().max(DIAGNOSE.indistinct)))
}
