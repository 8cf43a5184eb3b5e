//! Forward selection: causes are accepted one after the other while something significant is left.

use super::coloured_noise::coloured_noise;
use super::constancy;
use super::constants::DIAGNOSE;
use super::pipeline::DiagnoseOptions;
use super::remainder;
use super::result::*;
use super::scores::{Scores, scores};
use super::search::Found;
use super::select::{Margin, Round, refit, round};
use super::story::Story;
use crate::causes::Cause as Candidate;
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::Plan;
use crate::stats::dist::chi2_sf;
use crate::unknown::Unknown;

/// An accepted cause, and its tests.
pub(super) struct Accepted {
    pub cause: Candidate,
    pub statistic: f64,
    pub rivals: Vec<Rival>,
    pub margin: Option<Margin>,
    pub constancy: Option<f64>,
}

/// Forward selection in progress.
pub(super) struct Selection {
    pub current: Fitted,
    pub accepted: Vec<Accepted>,
    pub ambiguous: Vec<Vec<Name>>,
    /// Fit with the best of the causes that cannot be told apart.
    pub undecided: Option<Box<Fitted>>,
    pub rejected: bool,
    /// (title of a candidate, note on it)
    pub notes: Vec<(String, String)>,
    /// The same fit as `current` with the noise that its intervals are taken from, where causes were found together ([`super::search`]).
    pub spread: Option<Box<Fitted>>,
    /// Causes that took as much as an accepted one and add nothing to it.
    pub tied: Vec<Vec<Name>>,
}

/// Name of a cause, and the gripper it is about.
pub(super) type Name = (String, Option<String>);

impl Selection {
    /// Nothing accepted yet.
    pub(super) fn new(base: &Fitted) -> Self {
        Self {
            current: base.clone(),
            accepted: Vec::new(),
            ambiguous: Vec::new(),
            undecided: None,
            rejected: false,
            notes: Vec::new(),
            spread: None,
            tied: Vec::new(),
        }
    }

    /// Takes over the causes that a search found together.
    pub(super) fn take(&mut self, found: Found, story: &mut Story) -> Result<(), IdentifyError> {
        let mut before = found.base.coloured.rmse;
        for step in found.steps {
            let (fitted, spread) = (step.fitted.coloured, step.fitted.spread);
            // a likelihood ratio as if as many samples were independent as the residual's colour leaves
            let rows: usize = fitted.residuals.iter().map(Vec::len).sum();
            let channels = story.plan.channels().max(1);
            let samples = fitted.noise.effective_samples(rows / channels) * channels as f64;
            let statistic = 2.0 * samples * (before / fitted.rmse).ln();
            before = fitted.rmse;
            story.add(step.cause.name, &spread)?;
            if !step.ties.is_empty() {
                let ties = step.ties.into_iter().map(|(name, object)| (name.to_owned(), object));
                self.tied.push(std::iter::once(name(&step.cause)).chain(ties).collect());
            }
            let title = step.cause.title();
            let gain = format!(
                "accepted: on records it was not fitted to it takes {:.1} % of the squares (p = {:.1e})",
                100.0 * step.gain,
                step.p
            );
            self.notes.push((title, gain));
            self.accepted.push(Accepted { cause: step.cause, statistic, rivals: Vec::new(), margin: None, constancy: None });
            (self.current, self.spread) = (fitted, Some(Box::new(spread)));
        }
        let accepted: Vec<String> = self.accepted.iter().map(|a| a.cause.title()).collect();
        self.notes.extend(found.notes.into_iter().filter(|(title, _)| !accepted.contains(title)));
        Ok(())
    }

    #[allow(clippy::too_many_arguments)] // the parts of the selection
    pub(super) fn grow(
        &mut self,
        plan: &Plan,
        first: &Scores,
        sensor_sigma: f64,
        options: &DiagnoseOptions,
        fit_options: &FitOptions,
        story: &mut Story,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), IdentifyError> {
        let mut tested = first.clone();
        while self.accepted.len() < options.max_causes {
            let mut notes = Vec::new();
            let mut outcome = round(plan, &self.current, &tested, fit_options, &mut notes, progress)?;
            if matches!(outcome, Round::Nothing) {
                let seed = options.seed;
                let again = coloured_noise(plan, &self.current, sensor_sigma, fit_options, seed, &mut notes, progress)?;
                if let Some(found) = again {
                    (outcome, tested) = found;
                }
            }
            self.notes.extend(notes.into_iter().map(|(j, why)| (candidate(&tested, j).title(), why)));
            match outcome {
                Round::Nothing => return Ok(()),
                Round::Rejected => {
                    self.rejected = true;
                    return Ok(());
                }
                Round::Ambiguous { set, fitted } => {
                    self.undecided = Some(fitted);
                    self.ambiguous.push(set.iter().map(|&j| name(candidate(&tested, j))).collect());
                    return Ok(());
                }
                Round::Accepted { candidate, fitted, shape, statistic, margin } => {
                    let mut cause = self::candidate(&tested, candidate).clone();
                    if !shape.is_empty() {
                        cause.nuisance_grid.clear();
                        cause.unknowns.extend(shape);
                    }
                    progress(&format!("accepted {}", cause.title()));
                    let rivals = rivals(&tested, candidate);
                    self.accepted.push(Accepted { rivals, cause, statistic, margin, constancy: None });
                    self.current = *fitted;
                    let name = self.accepted.last().map_or("", |a| a.cause.name);
                    story.add(name, &self.current)?;
                    tested = scores(plan, &self.current, options.seed)?;
                }
            }
        }
        Ok(())
    }

    /// Takes out accepted causes that the later ones have made superfluous; `declared` was free before any of them.
    pub(super) fn prune(
        &mut self,
        plan: &Plan,
        declared: &[Unknown],
        options: &FitOptions,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), IdentifyError> {
        if self.accepted.len() < 2 {
            return Ok(());
        }
        for k in (0..self.accepted.len() - 1).rev() {
            let own = self.accepted[k].cause.unknowns.clone();
            progress(&format!("checking that {} is still needed", self.accepted[k].cause.title()));
            let mut without = self.current.clone();
            without.unknowns = plan.taken_out(declared, &self.current.unknowns, &own, &mut without.values);
            let fitted = refit(plan, &without, &[], options)?;
            let drop = fitted.deviance - self.current.deviance;
            self.accepted[k].statistic = drop;
            if chi2_sf(drop.max(0.0), own.len() as f64) > DIAGNOSE.level {
                self.notes
                    .push((self.accepted[k].cause.title(), "accepted first, superfluous beside the later causes".to_owned()));
                self.accepted.remove(k);
                self.current = fitted;
            }
        }
        Ok(())
    }

    /// Tests of every accepted cause whether its size differs between parts of the records; returns [`Selection::varying`].
    pub(super) fn test_constancy(&mut self, plan: &Plan) -> Result<Option<(String, f64)>, IdentifyError> {
        for accepted in &mut self.accepted {
            accepted.constancy = Some(constancy::p_value(plan, &self.current, &accepted.cause.unknowns)?);
        }
        Ok(self.varying())
    }

    /// The accepted cause whose size differs most between parts of the records, if any was found to, and its p.
    pub(super) fn varying(&self) -> Option<(String, f64)> {
        let all = self.accepted.len() as f64;
        let found = self.accepted.iter().filter_map(|a| Some((a.cause.title(), a.constancy?)));
        found.filter(|(_, p)| p * all < DIAGNOSE.constancy_level).min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    pub(super) fn remainder(
        &self,
        plan: &Plan,
        base: &Fitted,
        sensor_sigma: f64,
        p_input: f64,
        untested: bool,
        varying: Option<(String, f64)>,
    ) -> Remainder {
        let by_input = remainder::is_significant(p_input);
        let (before, after) = (base.rmse * base.rmse, self.current.rmse * self.current.rmse);
        let explainable = before - sensor_sigma * sensor_sigma;
        let note = match (by_input, untested) {
            (false, _) if let Some((name, p)) = &varying => format!(
                "{name} would need different sizes in different parts of the records (p = {p:.1e}), as a law that imitates another does"
            ),
            (true, _) => format!(
                "the residual still depends on the inputs (p = {p_input:.1e}): dynamics are missing that no accepted cause explains"
            ),
            (false, true) => "candidates remain significant, but none may be named".to_owned(),
            (false, false) => "what is left does not differ from coloured noise".to_owned(),
        };
        Remainder {
            significant: by_input || untested || varying.is_some(),
            by_input,
            rmse: self.current.rmse,
            unit: plan.unit().to_owned(),
            explained_fraction: if explainable > 0.0 { (before - after) / explainable } else { 0.0 },
            note,
        }
    }

    /// The part of the explainable error that the best of several equal causes takes, if the rest still depends on the inputs, is far more
    /// than noise, or the cause's size differs between parts of the records: they imitate something outside the library.
    pub(super) fn imitated(&self, plan: &Plan, base: &Fitted, sensor_sigma: f64) -> Result<Option<f64>, IdentifyError> {
        let Some(fitted) = &self.undecided else { return Ok(None) };
        let known = |u: &&Unknown| !self.current.unknowns.iter().any(|k| k.target.same(&u.target));
        let own: Vec<Unknown> = fitted.unknowns.iter().filter(known).cloned().collect();
        let by_input = remainder::is_significant(remainder::depends_on_input(plan, fitted)?);
        let large = sensor_sigma > 0.0 && fitted.rmse > DIAGNOSE.no_noise * sensor_sigma;
        if !by_input && !large && (own.is_empty() || constancy::p_value(plan, fitted, &own)? >= DIAGNOSE.constancy_level) {
            return Ok(None);
        }
        let square = |f: &Fitted| f.rmse * f.rmse;
        let taken = (square(base) - square(fitted)) / (square(base) - sensor_sigma * sensor_sigma).max(f64::MIN_POSITIVE);
        Ok(is_imitation(taken, by_input).then_some(taken))
    }

    /// The sets of causes that cannot be told apart: by the data, or by any data of this kind.
    pub(super) fn alternatives(&self) -> Vec<Vec<Name>> {
        let alike = self.accepted.iter().filter(|a| !a.cause.equivalents.is_empty()).map(|a| with_equivalents(&a.cause));
        self.ambiguous.iter().chain(&self.tied).cloned().chain(alike).collect()
    }

    /// The set, and why, if nothing is accepted but a cause with equivalents.
    pub(super) fn only_equivalents(&self) -> Option<(Vec<Name>, String)> {
        let [one] = self.accepted.as_slice() else { return None };
        let equivalents = one.cause.equivalents.join(", ");
        let reason = format!(
            "{} explains the data, and no log of these sensors can tell it from {equivalents}: both move the readings in the same way",
            one.cause.title()
        );
        (!equivalents.is_empty()).then(|| (with_equivalents(&one.cause), reason))
    }
}

/// Whether equal causes of which the best takes this part of the explainable error only imitate: the rest depends on the inputs, or else
/// is far more than noise, or their size varies. (Of real systems more than noise is left beside the right cause, too.)
fn is_imitation(taken: f64, by_input: bool) -> bool {
    taken < if by_input { DIAGNOSE.enough } else { DIAGNOSE.imitation }
}

/// A tested candidate.
fn candidate(tested: &Scores, j: usize) -> &Candidate {
    &tested.causes[tested.tested[j]]
}

pub(super) fn name(cause: &Candidate) -> Name {
    (cause.name.to_owned(), cause.object.clone())
}

fn with_equivalents(cause: &Candidate) -> Vec<Name> {
    let equivalents = cause.equivalents.iter().map(|other| ((*other).to_owned(), cause.object.clone()));
    std::iter::once(name(cause)).chain(equivalents).collect()
}

fn rivals(tested: &Scores, j: usize) -> Vec<Rival> {
    let mut out: Vec<Rival> = (0..tested.tested.len())
        .filter(|&k| k != j && tested.score.candidates[k].rank > 0)
        .map(|k| {
            let (name, object) = name(candidate(tested, k));
            Rival { name, object, cosine: tested.score.cosines[(j, k)] }
        })
        .collect();
    out.sort_by(|a, b| b.cosine.abs().total_cmp(&a.cosine.abs()));
    out.truncate(DIAGNOSE.listed_rivals);
    out
}

#[cfg(test)]
mod tests {
    use super::is_imitation;

    #[test]
    fn equal_causes_imitate_where_they_take_little() {
        // a size that varies alone says less than a rest that depends on the inputs
        assert!(is_imitation(0.4, false) && is_imitation(0.4, true) && is_imitation(0.8, true));
        assert!(!is_imitation(0.8, false) && !is_imitation(0.95, true));
    }
}
