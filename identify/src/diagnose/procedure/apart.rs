//! Fits in which a cause has another size in every record: opening, carrying and taking back its own sizes.

use super::super::policy::POLICY;
use super::coarse::Coarse;
use super::hypothesis::Bench;
use super::spread::{Apart, Direction, Spread, is_of};
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::{OwnSize, RecordPlan};
use crate::unknown::{Coordinate, Unknown};

/// A fit whose records have the common sizes of some numbers.
pub(super) fn with_common(fitted: &Fitted, numbers: &[Unknown]) -> Fitted {
    let mut out = fitted.clone();
    out.records.iter_mut().for_each(|rec| rec.sizes.retain(|own| !own.is_of(numbers)));
    out
}

/// From the scene's values to those of a fit, in the numbers of a cause; none where there is no way to go. A number that shapes a law (its
/// coordinate is a logarithm) is part of a size only where there is nothing else.
pub(super) fn direction(bench: &Bench, fitted: &Fitted, numbers: &[Unknown]) -> Option<Direction> {
    let shapes = |u: &&Unknown| u.coordinate == Coordinate::Log;
    let all = numbers.iter().all(|u| shapes(&u));
    let way = |u: &Unknown| u.coordinate_of(u.value(&fitted.values)) - u.coordinate_of(u.value(&bench.plan.scene_values));
    let known = |u: &Unknown| fitted.unknowns.iter().find(|k| k.target.same(&u.target)).unwrap_or(u).clone();
    let out: Direction = numbers.iter().filter(|u| all || !shapes(u)).map(|u| (known(u), way(u))).collect();
    out.iter().any(|(_, weight)| *weight != 0.0 && weight.is_finite()).then_some(out)
}

impl Bench<'_> {
    /// A fit with own sizes of the cause with these numbers, if they are worth a fit.
    pub(super) fn apart(&self, fitted: &Fitted, numbers: &[Unknown]) -> Result<Option<Fitted>, IdentifyError> {
        let Some((cause, spread)) = self.promise_apart(fitted, numbers)? else { return Ok(None) };
        let opened = opened(fitted, &[cause], &spread.of_each);
        let mut own = self.finished(&opened, &opened.records)?;
        // of several numbers the way from the scene's values to the common ones turns where these move
        for _ in 1..numbers.len().min(POLICY.turns) {
            let Some(turned) = self.turned(&own, numbers) else { break };
            own = self.finished(&turned, &turned.records)?;
        }
        Ok(Some(own))
    }

    /// A fit whose own sizes of these numbers lie along the way from the scene's values to its common ones, each as far as it was.
    fn turned(&self, own: &Fitted, numbers: &[Unknown]) -> Option<Fitted> {
        let way = direction(self, own, numbers)?;
        let length = |of: &Direction| of.iter().map(|(_, weight)| weight * weight).sum::<f64>().sqrt();
        let mut out = own.clone();
        for own in out.records.iter_mut().flat_map(|rec| &mut rec.sizes).filter(|own| own.is_of(numbers)) {
            let longer = length(&own.of) / length(&way);
            own.beyond *= longer;
            own.spread = own.spread.map(|spread| spread * longer);
            own.of.clone_from(&way);
        }
        Some(out)
    }

    /// What own sizes of the cause with these numbers would leave of a fit, linearized, if they are worth a fit.
    pub(super) fn promise_apart(
        &self,
        fitted: &Fitted,
        numbers: &[Unknown],
    ) -> Result<Option<(Direction, Spread)>, IdentifyError> {
        if self.plan.fitted_records() < POLICY.varied_records {
            return Ok(None);
        }
        let Some(cause) = direction(self, fitted, numbers) else { return Ok(None) };
        let coarse = Coarse::of(self, fitted)?;
        let white = Fitted { noise: self.white.clone(), ..coarse.fitted.clone() };
        let apart = Apart::new(&coarse.bench(self), &white, std::slice::from_ref(&cause))?;
        let spread = apart.spread();
        Ok(apart.promises(&spread).then_some((cause, spread)))
    }

    /// A fit with the spreads that are likeliest under its noise, of the causes that have own sizes in it.
    pub(super) fn spread_anew(&self, fitted: &Fitted) -> Result<Fitted, IdentifyError> {
        let causes = causes_apart(fitted);
        if causes.is_empty() {
            return Ok(fitted.clone());
        }
        let coarse = Coarse::of(self, fitted)?;
        let apart = Apart::new(&coarse.bench(self), &coarse.fitted, &causes)?;
        let spreads = apart.spread().of_each;
        Ok(opened(fitted, &causes, &spreads))
    }
}

/// A fit in which some causes have own sizes of these spreads, 0: none. Deviations that it has stay (along another direction, too, −1
/// is a record without the effect), and new ones begin at 0: those that a linearization foretells may be too large to be simulated.
fn opened(fitted: &Fitted, causes: &[Direction], spreads: &[f64]) -> Fitted {
    let mut out = fitted.clone();
    for rec in &mut out.records {
        let before = std::mem::take(&mut rec.sizes);
        let (known, others): (Vec<_>, Vec<_>) = before.into_iter().partition(|own| causes.iter().any(|cause| is_of(own, cause)));
        rec.sizes = others;
        for (cause, spread) in causes.iter().zip(spreads).filter(|(_, spread)| **spread > 0.0) {
            let beyond = known.iter().find(|own| is_of(own, cause)).map_or(0.0, |own| own.beyond);
            rec.sizes.push(OwnSize { of: cause.clone(), beyond, spread: Some(*spread) });
        }
    }
    out
}

/// The causes that have own sizes in a fit.
pub(super) fn causes_apart(fitted: &Fitted) -> Vec<Direction> {
    let free = |own: &&OwnSize| own.spread.is_some();
    fitted.records.first().map_or(Vec::new(), |rec| rec.sizes.iter().filter(free).map(|own| own.of.clone()).collect())
}

/// Price of the deviations' uncertainty in a fit: Σ ln det(1 + T^½ F_r T^½).
pub(super) fn uncertain(bench: &Bench, fitted: &Fitted) -> Result<f64, IdentifyError> {
    let causes = causes_apart(fitted);
    if causes.is_empty() {
        return Ok(0.0);
    }
    let coarse = Coarse::of(bench, fitted)?;
    Ok(Apart::new(&coarse.bench(bench), &coarse.fitted, &causes)?.at(&spreads(fitted)).1)
}

/// The spreads in a fit.
fn spreads(fitted: &Fitted) -> Vec<f64> {
    fitted.records.first().map_or(Vec::new(), |rec| rec.sizes.iter().filter_map(|own| own.spread).collect())
}

/// Spread of the cause with these numbers in a fit; 0: none.
pub(super) fn spread_of(fitted: &Fitted, numbers: &[Unknown]) -> f64 {
    let own = || fitted.records.first()?.sizes.iter().find(|own| own.is_of(numbers))?.spread;
    own().unwrap_or(0.0)
}

/// Records with room for the own sizes that a fit has in its records: the deviations are known where they were estimated, and 0 elsewhere.
pub(in super::super) fn carried(fitted: &Fitted, records: &[RecordPlan]) -> Vec<RecordPlan> {
    let Some(first) = fitted.records.first() else { return records.to_vec() };
    let one = |rec: &RecordPlan| {
        let same = |known: &&RecordPlan| known.parent == rec.parent && known.record.role == rec.record.role;
        let unknown = || first.sizes.iter().map(|own| OwnSize { beyond: 0.0, ..own.clone() }).collect();
        let sizes = fitted.records.iter().find(same).map_or_else(unknown, |known| known.sizes.clone());
        RecordPlan { sizes, ..rec.clone() }
    };
    records.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::super::policy::POLICY;
    use super::super::contest::Contest;
    use super::super::hypothesis::Hypothesis;
    use super::*;
    use crate::causes::{Situation, library};
    use crate::fit::fit;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;

    /// Records begun anew have room for own sizes, known where they were estimated: a held-out record of the same number is another one.
    #[test]
    fn own_sizes_are_carried_to_records_begun_anew() {
        let plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40], vec![0.4; 40]]).0;
        let number = Unknown::of_theta(&plan.model, "pivot.damping", 0.1).unwrap();
        let plain = fit(&plan, &plan.fitted, &plan.scene_values, &[], None, &POLICY.fine).unwrap();
        let mut fitted = opened(&plain, &[vec![(number.clone(), 1.0)]], &[0.4]);
        fitted.records.iter_mut().zip([0.5, -0.5]).for_each(|(rec, beyond)| rec.sizes[0].beyond = beyond);
        let seen = |records: &[RecordPlan]| -> Vec<(f64, Option<f64>)> {
            carried(&fitted, records).iter().map(|rec| (rec.sizes[0].beyond, rec.sizes[0].spread)).collect()
        };
        assert_eq!(seen(&plan.fitted), [(0.5, Some(0.4)), (-0.5, Some(0.4))]);
        assert_eq!(plan.held_out[0].parent, plan.fitted[0].parent);
        assert_eq!(seen(&plan.held_out), [(0.0, Some(0.4))]);
        assert!(causes_apart(&with_common(&fitted, &[number])).is_empty() && causes_apart(&fitted).len() == 1);
    }

    /// A size varies along the numbers that are sizes, from the scene's values to those of the fit.
    #[test]
    fn a_shape_is_no_size() {
        let plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40], vec![0.4; 40]]).0;
        let white = ArModel::white(vec![2e-4]).unwrap();
        let mut fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white };
        let damping = Unknown::of_theta(&plan.model, "pivot.damping", 0.1).unwrap();
        let mass = Unknown::of_theta(&plan.model, "link.mass", 0.1).unwrap().logarithmic();
        damping.set(&mut fitted.values, 0.02);
        mass.set(&mut fitted.values, 0.6);
        let way = |numbers: &[Unknown]| -> Vec<f64> {
            direction(&bench, &fitted, numbers).unwrap_or_default().iter().map(|(_, weight)| *weight).collect()
        };
        let both = way(&[damping.clone(), mass.clone()]);
        assert!(both.len() == 1 && (both[0] - 0.2).abs() < 1e-12, "{both:?}");
        assert!((way(std::slice::from_ref(&mass))[0] - 1.2f64.ln()).abs() < 1e-12);
        fitted.values = plan.scene_values.clone();
        assert!(direction(&bench, &fitted, &[damping]).is_none());
    }

    /// A pendulum with these dampings in its three fitted records, and whether a contest says that they vary: the deviations by record.
    fn contested(damping: [f64; 3]) -> (bool, Vec<f64>) {
        let mut plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40], vec![0.4; 40], vec![0.2; 40]]).0;
        let cause = {
            let at = Situation { plan: &plan, values: &plan.scene_values, free: &[], together: true };
            library(&at).into_iter().find(|cause| cause.name == "viscous_friction").unwrap()
        };
        let number = cause.unknowns[0].clone();
        for (k, damping) in damping.into_iter().enumerate() {
            let mut values = plan.scene_values.clone();
            number.set(&mut values, damping);
            let clean = shoot(&plan, &plan.fitted[k], &values, ShotWants::default()).unwrap().predicted;
            let noise = gaussians(40, 3 + k as u64);
            plan.fitted[k].record.joints = clean.iter().zip(noise).map(|(x, e)| vec![x + 2e-4 * e]).collect();
        }
        let white = ArModel::white(vec![2e-4]).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white: white.clone() };
        let fitted =
            |unknowns: &[Unknown]| fit(&plan, &plan.fitted, &plan.scene_values, unknowns, Some(&white), &POLICY.fine).unwrap();
        let base = Hypothesis::baseline(fitted(&[]));
        let child = base.and(cause, fitted(std::slice::from_ref(&number)));
        let contest = Contest::new(&bench, &[&base, &child], 1).unwrap();
        let adopted = contest.adopted(1, &child);
        // a fit takes no size beyond its bound, where the readings would not feel it
        for own in adopted.fitted.records.iter().flat_map(|rec| &rec.sizes) {
            let far = number.coordinate_of(number.value(&adopted.fitted.values)) + own.of[0].1 * own.beyond;
            assert!(far > -1e-9, "{far}");
        }
        let size = |rec: &RecordPlan| rec.sizes.first()?.value(&number, &adopted.fitted.values);
        let sizes = adopted.fitted.records.iter().filter_map(size).collect();
        (contest.varies[1], sizes)
    }

    #[test]
    fn a_size_that_differs_varies_and_one_that_does_not_does_not() {
        let (varies, sizes) = contested([0.01, 0.03, 0.02]);
        assert!(varies && sizes.iter().zip([0.01, 0.03, 0.02]).all(|(a, b)| (a / b - 1.0).abs() < 0.1), "{varies} {sizes:?}");
        // there in one record of three
        let (varies, sizes) = contested([0.0, 0.03, 0.0]);
        assert!(varies && sizes[0] < 2e-3 && (sizes[1] / 0.03 - 1.0).abs() < 0.1, "{varies} {sizes:?}");
        let (varies, sizes) = contested([0.02; 3]);
        assert!(!varies && sizes.is_empty(), "{sizes:?}");
    }

    /// Two numbers that only together are there in two records of three: the way from the scene's values to those that are best for all records is not
    /// the one to these, and turns towards it.
    #[test]
    fn the_way_of_several_numbers_turns() {
        let mut plan = experiment(&pendulum("measured"), &[vec![1.2; 40], vec![0.5; 40], vec![1.0; 40], vec![0.2; 40]]).0;
        let numbers =
            ["pivot.quadratic_damping", "pivot.stiffness"].map(|path| Unknown::of_theta(&plan.model, path, 0.1).unwrap());
        for k in 0..3 {
            let mut values = plan.scene_values.clone();
            if k != 1 {
                numbers.iter().zip([0.05, 0.4]).for_each(|(number, value)| number.set(&mut values, value));
            }
            let clean = shoot(&plan, &plan.fitted[k], &values, ShotWants::default()).unwrap().predicted;
            let noise = gaussians(40, 3 + k as u64);
            plan.fitted[k].record.joints = clean.iter().zip(noise).map(|(x, e)| vec![x + 2e-4 * e]).collect();
        }
        let white = ArModel::white(vec![2e-4]).unwrap();
        let bench = Bench { plan: &plan, declared: Vec::new(), white: white.clone() };
        let common = fit(&plan, &plan.fitted, &plan.scene_values, &numbers, Some(&white), &POLICY.fine).unwrap();
        let (way, spread) = bench.promise_apart(&common, &numbers).unwrap().unwrap();
        let straight = opened(&common, &[way], &spread.of_each);
        let straight = bench.finished(&straight, &straight.records).unwrap();
        let turned = bench.apart(&common, &numbers).unwrap().unwrap();
        let ratio = |fitted: &Fitted| {
            let of = &fitted.records[0].sizes[0].of;
            of[0].1 / of[1].1 / (0.05 / 0.4)
        };
        let [before, after] = [&straight, &turned].map(|fitted| (bench.over(fitted), ratio(fitted)));
        assert!(before.0 > 1.05 && (before.1 - 1.0).abs() > 0.03, "{before:?}");
        assert!(after.0 < 0.85 && (after.1 - 1.0).abs() < 0.01, "{after:?}");
    }
}
