//! Is the size of an accepted cause the same everywhere? A law that only imitates another needs another size in every part.
//!
//! With u the whitened sensitivity to one of the cause's parameters, everything else that is fitted projected off, a stretch b of
//! a record has the score S_b = u_bᵀr_b and the information I_b = |u_b|². If the law is right, S_b/I_b scatters about zero with
//! variance 1/I_b. Two tests, Bonferroni over them and over the parameters:
//! - *by part*: Σ S_b²/I_b − (Σ S_b)²/Σ I_b against χ² of one less than the number of parts;
//! - *by amplitude*: does the size trend with the effect's own amplitude a_b = √(I_b/rows)? z = Σ (a_b − ā) S_b / √Σ (a_b − ā)² I_b.
//!   Dry friction in place of viscous damping, hardening in place of stiffness show here.
//!
//! A law whose size is not constant may stand in for another; where that takes a fiftieth of what the law takes, it is no name.

use super::policy::POLICY;
use super::result::RemainderForm;
use crate::causes::Cause;
use crate::fit::Fitted;
use crate::stats::dist::{chi2_sf, normal_cdf};
use crate::stats::reduced::{Block, Reduced};
use crate::unknown::Unknown;
use nalgebra::{DMatrix, DVector};

/// How far the size of a cause is from being the same everywhere.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// Of the likelier test: how much more likely own sizes are than the common one, in units of −2 log.
    taken: f64,
    /// Numbers that it has for that.
    numbers: usize,
    p: f64,
}

const NONE: Change = Change { taken: 0.0, numbers: 0, p: 1.0 };

/// Smallest p over the parameters of a cause; 1 where there are too few parts to compare. `reduced`: of the fit, cut into [`POLICY`]`.constancy_blocks`.
pub(super) fn p_value(reduced: &Reduced, fitted: &Fitted, own: &[Unknown]) -> f64 {
    of_cause(reduced, fitted, own).p
}

/// What is left looks as if these causes had another size in other parts of the records: those of which that is significant.
pub(super) fn forms(reduced: &Reduced, fitted: &Fitted, causes: &[&Cause]) -> Vec<RemainderForm> {
    let one = |cause: &&Cause| {
        let Change { taken, numbers, p } = of_cause(reduced, fitted, &cause.unknowns);
        RemainderForm {
            object: cause.object.clone().unwrap_or_else(|| cause.name.to_owned()),
            what: format!("another size of {} in other parts of the records", cause.title()),
            taken,
            numbers,
            p,
            ..RemainderForm::default()
        }
    };
    causes.iter().map(one).filter(|form| form.p * (causes.len() as f64) < POLICY.form_level).collect()
}

fn of_cause(reduced: &Reduced, fitted: &Fitted, own: &[Unknown]) -> Change {
    let columns: Vec<usize> =
        (0..fitted.unknowns.len()).filter(|&j| own.iter().any(|o| o.target.same(&fitted.unknowns[j].target))).collect();
    let all = columns.iter().map(|&c| of_column(reduced, c));
    let least = all.fold(NONE, |best, change| if change.p < best.p { change } else { best });
    Change { p: (least.p * columns.len() as f64).min(1.0), ..least }
}

fn of_column(reduced: &Reduced, column: usize) -> Change {
    let direction = free_direction(&reduced.gram(), column);
    let parts: Vec<Part> = reduced.blocks().iter().map(|b| Part::new(b, &direction)).collect();
    let [by_part, by_amplitude] = [by_part(&parts), by_amplitude(&parts)];
    let least = if by_part.p < by_amplitude.p { by_part } else { by_amplitude };
    Change { p: (2.0 * least.p).min(1.0), ..least }
}

/// Coefficients of the columns in u: 1 for its own, those of the projection for the others.
fn free_direction(gram: &DMatrix<f64>, column: usize) -> DVector<f64> {
    let n = gram.nrows();
    let others: Vec<usize> = (0..n).filter(|&j| j != column).collect();
    let mut direction = DVector::zeros(n);
    direction[column] = 1.0;
    if others.is_empty() {
        return direction;
    }
    let inner = DMatrix::from_fn(others.len(), others.len(), |i, j| gram[(others[i], others[j])]);
    let against = DVector::from_fn(others.len(), |i, _| gram[(others[i], column)]);
    if let Ok(weights) = inner.svd(true, true).solve(&against, POLICY.singular) {
        others.iter().zip(weights.iter()).for_each(|(&j, w)| direction[j] = -w);
    }
    direction
}

/// A stretch of a record.
struct Part {
    score: f64,
    information: f64,
    amplitude: f64,
}

impl Part {
    fn new(block: &Block, direction: &DVector<f64>) -> Self {
        let information = direction.dot(&(&block.gram * direction)).max(0.0);
        Self { score: direction.dot(&block.score), information, amplitude: (information / block.rows.max(1) as f64).sqrt() }
    }
}

fn by_part(parts: &[Part]) -> Change {
    let mean = parts.iter().map(|p| p.information).sum::<f64>() / parts.len().max(1) as f64;
    let telling: Vec<&Part> = parts.iter().filter(|p| p.information > POLICY.feeble_part * mean).collect();
    if telling.len() < 2 {
        return NONE;
    }
    let (score, information) = telling.iter().fold((0.0, 0.0), |s, p| (s.0 + p.score, s.1 + p.information));
    let spread: f64 = telling.iter().map(|p| p.score * p.score / p.information).sum();
    let (taken, numbers) = ((spread - score * score / information).max(0.0), telling.len() - 1);
    Change { taken, numbers, p: chi2_sf(taken, numbers as f64) }
}

fn by_amplitude(parts: &[Part]) -> Change {
    let information: f64 = parts.iter().map(|p| p.information).sum();
    let mean = parts.iter().map(|p| p.amplitude * p.information).sum::<f64>() / information;
    let variance: f64 = parts.iter().map(|p| (p.amplitude - mean).powi(2) * p.information).sum();
    let trend: f64 = parts.iter().map(|p| (p.amplitude - mean) * p.score).sum();
    let z = trend / variance.sqrt();
    if z.is_finite() { Change { taken: z * z, numbers: 1, p: 2.0 * normal_cdf(-z.abs()) } } else { NONE }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::scores::reduce;
    use super::*;
    use crate::causes::{Situation, library};
    use crate::fit::fit;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;

    fn parts(size: impl Fn(f64) -> f64) -> Vec<Part> {
        let noise = [0.4, -1.1, 0.3, 0.9, -0.6, 0.2, -0.3, 0.5];
        let one = |(k, noise): (usize, &f64)| {
            let amplitude = 0.5 + 0.25 * k as f64;
            let information = 100.0 * amplitude * amplitude;
            Part { score: information * size(amplitude) + noise * information.sqrt(), information, amplitude }
        };
        noise.iter().enumerate().map(one).collect()
    }

    #[test]
    fn a_constant_size_is_constant() {
        // at an optimum the scores sum to zero, so a constant size is zero
        let parts = parts(|_| 0.0);
        assert!(by_part(&parts).p > 0.1 && by_amplitude(&parts).p > 0.1);
    }

    #[test]
    fn a_size_that_falls_with_amplitude_is_seen() {
        let parts = parts(|a| 0.6 * (1.0 / a - 0.8));
        assert!(by_amplitude(&parts).p < 1e-3, "{:?}", by_amplitude(&parts));
        let own = by_part(&parts);
        assert!(own.p < 0.01 && own.numbers == 7 && own.taken > 18.0, "{own:?}");
    }

    #[test]
    fn other_parameters_are_projected_off() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 3.0]);
        let direction = free_direction(&gram, 1);
        assert!(((&gram * direction)[0]).abs() < 1e-12);
    }

    /// A damper that grows during every record is no damper; one that is the same everywhere is.
    #[test]
    fn a_size_that_grows_with_the_time_is_no_size() {
        let swings: Vec<Vec<f64>> = [0.3, 0.9, -0.5, 1.4].map(|angle| vec![angle; 40]).to_vec();
        let mut plan = experiment(&pendulum("measured"), &swings).0;
        let damping = plan.model.params().find("pivot.damping").unwrap();
        let at = Situation { plan: &plan, values: &plan.scene_values, free: &[], together: false };
        let cause = library(&at).into_iter().find(|cause| cause.name == "viscous_friction").unwrap();
        let mut of = |growth: f64| {
            for (k, rec) in plan.fitted.clone().iter().enumerate() {
                let seen = |damper: f64| {
                    let mut values = plan.scene_values.clone();
                    values.theta[damping] = damper;
                    shoot(&plan, rec, &values, ShotWants::default()).unwrap().predicted
                };
                // early with little damping, late with more
                let [little, much, noise] = [seen(0.02), seen(0.02 * (1.0 + growth)), gaussians(40, k as u64)];
                let reading = |t: usize| {
                    let late = t as f64 / 39.0;
                    vec![(1.0 - late) * little[t] + late * much[t] + 1e-4 * noise[t]]
                };
                plan.fitted[k].record.joints = (0..40).map(reading).collect();
            }
            let white = ArModel::white(vec![1e-4]).unwrap();
            let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &cause.unknowns, Some(&white), &POLICY.fine).unwrap();
            forms(&reduce(&plan, &fitted, &fitted.unknowns).unwrap(), &fitted, &[&cause])
        };
        assert_eq!(of(0.0), []);
        let said = of(0.5);
        assert!(said.len() == 1 && said[0].taken > 40.0, "{said:?}");
        assert_eq!(
            (said[0].object.as_str(), said[0].what.as_str()),
            ("pivot", "another size of viscous_friction (pivot) in other parts of the records")
        );
    }
}
