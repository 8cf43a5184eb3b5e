//! Lists of a selection: the accepted causes with their estimates, all candidates with their statistics.

use super::certainty::{Curvature, by_curvature, by_record, profile};
use super::result::*;
use super::scores::Scores;
use super::selection::{Accepted, Selection};
use crate::error::IdentifyError;
use crate::shooting::Plan;
use crate::unknown::{Coordinate, Unknown};

impl Selection {
    pub(super) fn causes(&self, plan: &Plan) -> Result<Vec<Cause>, IdentifyError> {
        if self.accepted.is_empty() {
            return Ok(Vec::new());
        }
        let spread = self.spread.as_deref();
        let errors = match spread {
            Some(spread) => by_record(plan, spread)?,
            None => Curvature::new(plan, &self.current)?.std_errors(),
        };
        let one = |a: &Accepted| -> Result<Cause, IdentifyError> {
            let mut parameters = Vec::new();
            for own in &a.cause.unknowns {
                let Some(j) = self.current.unknowns.iter().position(|u| u.target.same(&own.target)) else { continue };
                let u = &self.current.unknowns[j];
                let interval = match spread {
                    // found together: by how records differ, for no noise model is true
                    Some(spread) => by_curvature(u, &spread.values, errors[j]),
                    None => profile(plan, &self.current, j, errors[j])?,
                };
                parameters.push(Estimate {
                    path: u.path.clone(),
                    estimate: u.value(&self.current.values),
                    unit: u.unit.clone(),
                    interval: Some(interval),
                    scene_value: u.value(&plan.scene_values),
                });
            }
            let own: Vec<usize> = a.cause.unknowns.iter().flat_map(|u| u.target.entries()).map(|(k, _)| k).collect();
            for &(entry, value) in a.cause.nuisance_grid.iter().flatten().filter(|(entry, _)| !own.contains(entry)) {
                let info = plan.model.params().info(entry);
                parameters.push(Estimate {
                    path: info.path.clone(),
                    estimate: value,
                    unit: info.unit.to_owned(),
                    interval: None,
                    scene_value: plan.scene_values.theta[entry],
                });
            }
            Ok(Cause {
                name: a.cause.name.to_owned(),
                object: a.cause.object.clone(),
                meaning: a.cause.meaning.to_owned(),
                parameters,
                statistic: a.statistic,
                constancy_p: a.constancy,
                rivals: a.rivals.clone(),
            })
        };
        self.accepted.iter().map(one).collect()
    }

    pub(super) fn candidates(&self, first: &Scores) -> Vec<CandidateReport> {
        let report = |c: usize| {
            let cause = &first.causes[c];
            let unit = cause.unknowns.first().map_or(String::new(), |u| u.unit.clone());
            let base = CandidateReport {
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
            let Some(j) = first.tested.iter().position(|&t| t == c) else { return base };
            let s = &first.score.candidates[j];
            let absorbed = s.absorbed.iter().copied().fold(f64::NAN, f64::min);
            let change = |k: usize, t: f64| self.change(&cause.unknowns[k], t);
            let reasons: Vec<&str> =
                self.notes.iter().filter(|(n, _)| *n == cause.title()).map(|(_, why)| why.as_str()).collect();
            CandidateReport {
                status: if s.rank == 0 { Status::Absorbed } else { Status::Tested },
                statistic: (s.rank > 0).then_some(s.lm),
                p_value: (s.rank > 0).then_some(first.adjusted[j]),
                absorbed_fraction: Some(absorbed).filter(|a| a.is_finite()),
                smallest_detectable: s.detectable.first().map(|d| change(0, *d)).filter(|d| d.is_finite()),
                one_step: s.theta.iter().enumerate().map(|(k, t)| change(k, *t)).collect(),
                reason: if s.rank == 0 { "what can be fitted anyway hides it".to_owned() } else { reasons.join("; ") },
                ..base
            }
        };
        (0..first.causes.len()).map(report).collect()
    }

    /// Change of a cause's value by a step of its coordinate; where the value starts at infinity, the value after the step.
    fn change(&self, u: &Unknown, step: f64) -> f64 {
        match u.coordinate {
            Coordinate::Linear => u.slope(0.0) * step,
            Coordinate::Log => u.slope(u.value(&self.current.values)) * step,
            Coordinate::Inverse => u.far(u.value(&self.current.values), step),
        }
    }
}
