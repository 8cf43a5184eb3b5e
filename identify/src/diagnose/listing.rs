//! Lists of a diagnosis: the accepted causes with their estimates, all candidates with their statistics.

use super::certainty::estimates;
use super::constancy;
use super::policy::POLICY;
use super::procedure::{Found, Hypothesis};
use super::result::*;
use super::scores::Scores;
use crate::causes::Cause as Candidate;
use crate::fit::Fitted;
use crate::shooting::{Plan, RecordPlan, pieces_by_record};
use crate::stats::reduced::Reduced;
use crate::unknown::{Coordinate, Unknown, Values};
use std::ops::Range;

/// The accepted causes. `parts`: what the final model's constancy is told from; `half`: half widths of the intervals of everything fitted; `first`: the tests against the baseline.
pub(super) fn causes(plan: &Plan, found: &Found, parts: &Reduced, half: &[f64], first: &Scores) -> Vec<Cause> {
    let fitted = &found.fitted;
    let all = estimates(plan, fitted, Some(half));
    let one = |(cause, evidence): (&Candidate, &super::procedure::Evidence)| {
        let place = |own: &Unknown| fitted.unknowns.iter().position(|u| u.target.same(&own.target));
        let mut parameters: Vec<Estimate> = cause.unknowns.iter().filter_map(place).map(|j| all[j].clone()).collect();
        let own: Vec<usize> = cause.unknowns.iter().flat_map(|u| u.target.entries()).map(|(k, _)| k).collect();
        for &(entry, value) in cause.nuisance_grid.iter().flatten().filter(|(entry, _)| !own.contains(entry)) {
            let info = plan.model.params().info(entry);
            let (path, unit, scene_value) = (info.path.clone(), info.unit.to_owned(), plan.scene_values.theta[entry]);
            parameters.push(Estimate { path, estimate: value, unit, interval: None, scene_value });
        }
        Cause {
            name: cause.name.to_owned(),
            object: cause.object.clone(),
            meaning: cause.meaning.to_owned(),
            statistic: evidence.statistic,
            foretold: evidence.foretold,
            constancy_p: Some(constancy::p_value(parts, fitted, &cause.unknowns)),
            sizes: sizes(fitted, cause),
            rivals: rivals(first, cause),
            parameters,
        }
    };
    found.best.causes.iter().zip(&found.evidence).map(one).collect()
}

/// Of the best model and every one that cannot be told from it the causes among these, with their numbers in it.
pub(super) fn refitted(plan: &Plan, found: &Found, among: &[String]) -> Vec<(Vec<String>, Vec<Estimate>)> {
    let one = |model: &Hypothesis| {
        let own: Vec<&Candidate> = model.causes.iter().filter(|cause| among.contains(&cause.title())).collect();
        let is_own = |u: &Unknown| own.iter().any(|cause| cause.unknowns.iter().any(|own| own.target.same(&u.target)));
        let all = estimates(plan, &model.fitted, None).into_iter().zip(&model.fitted.unknowns);
        let numbers = all.filter(|(_, u)| is_own(u)).map(|(e, _)| e).collect();
        (own.iter().map(|cause| cause.title()).collect(), numbers)
    };
    std::iter::once(&found.best).chain(&found.tied).map(one).collect()
}

/// The size of a cause's first number that varies, in every record; none where none does.
fn sizes(fitted: &Fitted, cause: &Candidate) -> Vec<RecordSize> {
    let own = |u: &Unknown, rec: &RecordPlan| rec.sizes.iter().find_map(|own| own.value(u, &fitted.values));
    let varies = |u: &&Unknown| fitted.records.iter().any(|rec| own(u, rec).is_some());
    let Some(first) = cause.unknowns.iter().find(varies) else { return Vec::new() };
    let one = |pieces: Range<usize>| {
        let rec = &fitted.records[pieces.start];
        // of a piece the name says where it begins
        let name = rec.record.name.rsplit_once(" from ").filter(|(_, at)| at.ends_with(" s")).map(|(name, _)| name);
        Some(RecordSize { record: name.unwrap_or(&rec.record.name).to_owned(), size: own(first, rec)? })
    };
    let mut out: Vec<RecordSize> = pieces_by_record(&fitted.records).into_iter().filter_map(one).collect();
    // a size at its bound of 0 is there to rounding
    let rounding = 8.0 * f64::EPSILON * out.iter().map(|of| of.size.abs()).fold(0.0, f64::max);
    out.iter_mut().filter(|of| of.size.abs() <= rounding).for_each(|of| of.size = 0.0);
    out
}

/// The causes most similar to one on these data, among those tested against the baseline.
fn rivals(tested: &Scores, cause: &Candidate) -> Vec<Rival> {
    let of = |j: usize| &tested.causes[tested.tested[j]];
    let Some(j) = (0..tested.tested.len()).find(|&j| of(j).title() == cause.title()) else { return Vec::new() };
    let others = (0..tested.tested.len()).filter(|&k| k != j && tested.score.candidates[k].rank > 0);
    let one =
        |k: usize| Rival { name: of(k).name.to_owned(), object: of(k).object.clone(), cosine: tested.score.cosines[(j, k)] };
    let mut out: Vec<Rival> = others.map(one).collect();
    out.sort_by(|a, b| b.cosine.abs().total_cmp(&a.cosine.abs()));
    out.truncate(POLICY.listed_rivals);
    out
}

/// Every candidate against the baseline, with what became of it.
pub(super) fn candidates(first: &Scores, base: &Values, notes: &[(String, String)]) -> Vec<CandidateReport> {
    let report = |c: usize| {
        let cause = &first.causes[c];
        let unit = cause.unknowns.first().map_or(String::new(), |u| u.unit.clone());
        let untested = CandidateReport {
            name: cause.name.to_owned(),
            object: cause.object.clone(),
            status: Status::Untestable,
            statistic: None,
            dof: cause.unknowns.len(),
            p_value: None,
            absorbed_fraction: None,
            smallest_detectable: None,
            one_step: Vec::new(),
            unit,
            reason: cause.untestable.clone().unwrap_or_default(),
        };
        let Some(j) = first.tested.iter().position(|&t| t == c) else { return untested };
        let s = &first.score.candidates[j];
        let absorbed = s.absorbed.iter().copied().fold(f64::NAN, f64::min);
        let change = |k: usize, t: f64| change(&cause.unknowns[k], base, t);
        let reason = notes.iter().rev().find(|(title, _)| *title == cause.title()).map_or("", |(_, why)| why.as_str());
        CandidateReport {
            status: if s.rank == 0 { Status::Absorbed } else { Status::Tested },
            statistic: (s.rank > 0).then_some(s.lm),
            p_value: (s.rank > 0).then_some(first.adjusted[j]),
            absorbed_fraction: Some(absorbed).filter(|a| a.is_finite()),
            smallest_detectable: s.detectable.first().map(|d| change(0, *d)).filter(|d| d.is_finite()),
            one_step: s.theta.iter().enumerate().map(|(k, t)| change(k, *t)).collect(),
            reason: if s.rank == 0 { "what can be fitted anyway hides it".to_owned() } else { reason.to_owned() },
            ..untested
        }
    };
    (0..first.causes.len()).map(report).collect()
}

/// Change of a cause's value by a step of its coordinate; where the value starts at infinity, the value after the step.
fn change(u: &Unknown, at: &Values, step: f64) -> f64 {
    match u.coordinate {
        Coordinate::Linear => u.slope(0.0) * step,
        Coordinate::Log => u.slope(u.value(at)) * step,
        Coordinate::Inverse => u.far(u.value(at), step),
    }
}
