//! Many records, and models that leave more than noise: judged on records that they have not seen.
//!
//! Causes are then sought on some of the records, and models are compared on the others. What is left differs in size from record to
//! record: of a cable that falls to the other side it is a hundred times what it is elsewhere, and one such record would decide alone. With
//! that size unknown, −2 log L of record r is n_r log |r_r|² at its best. So models are compared by the geometric mean of their squares, and
//! fitted with each record counted by the inverse of what is left in it: iteratively reweighted least squares, the weights taken anew
//! whenever a cause is accepted.

use super::super::gain::prepared;
use super::super::policy::POLICY;
use super::hypothesis::Bench;
use crate::fit::{Fitted, evenly};
use crate::shooting::{Plan, RecordPlan, pieces_by_record};
use rayon::prelude::*;

/// Whether a model was fitted to some of the records alone.
pub(super) fn sought_on_some(plan: &Plan, fitted: &Fitted) -> bool {
    fitted.records.len() < plan.fitted.len()
}

/// Records that a model was not fitted to, at most so many measured ones, without segments: nobody has fitted their states.
pub(super) fn unseen(plan: &Plan, fitted: &Fitted, most: usize) -> Vec<RecordPlan> {
    let seen = |rec: &&RecordPlan| fitted.records.iter().any(|fitted| fitted.parent == rec.parent);
    let others: Vec<RecordPlan> =
        plan.fitted.iter().filter(|rec| !seen(rec)).map(|rec| RecordPlan { nodes: Vec::new(), ..rec.clone() }).collect();
    let keep = evenly(&others, most);
    others.into_iter().zip(keep).filter_map(|(rec, keep)| keep.then_some(rec)).collect()
}

/// Squares of every measured one of some records that a model was not fitted to, over the scatter, begun from their lead-in under it; infinite
/// where it cannot be simulated.
pub(super) fn foretold(bench: &Bench, fitted: &Fitted, records: &[RecordPlan]) -> Vec<f64> {
    let by = Fitted { noise: bench.white.clone(), ..fitted.clone() };
    let squares = |rec: &RecordPlan| {
        let begun = prepared(bench.plan, std::slice::from_ref(rec), &by, &POLICY.fine);
        begun.map_or(f64::INFINITY, |rec| bench.squares_at(&rec, &fitted.values))
    };
    let each: Vec<f64> = records.par_iter().map(squares).collect();
    pieces_by_record(records).into_iter().map(|of| each[of].iter().sum()).collect()
}

/// Their geometric mean, times their number.
pub(super) fn typical(squares: &[f64]) -> f64 {
    let n = squares.len().max(1) as f64;
    n * (logs(squares).iter().sum::<f64>() / n).exp()
}

/// Their logarithms.
pub(super) fn logs(squares: &[f64]) -> Vec<f64> {
    squares.iter().map(|x| x.max(f64::MIN_POSITIVE).ln()).collect()
}

/// A fit with each measured record counted by the inverse of what is left in it; a record of the typical size counts once.
pub(in super::super) fn counted(bench: &Bench, fitted: &Fitted) -> Fitted {
    let mut out = even(bench.plan, fitted);
    let of_records = pieces_by_record(&out.records);
    let one = |of: &std::ops::Range<usize>| {
        let part = Fitted { residuals: out.residuals[of.clone()].to_vec(), ..out.clone() };
        bench.over(&part).max(1.0)
    };
    let over: Vec<f64> = of_records.iter().map(one).collect();
    let size = (logs(&over).iter().sum::<f64>() / over.len().max(1) as f64).exp();
    for (of, over) in of_records.into_iter().zip(over) {
        for k in of {
            out.records[k].weight = size / over;
            out.residuals[k].iter_mut().for_each(|r| *r *= size / over);
        }
    }
    out
}

/// A fit with every record counted once.
pub(super) fn even(plan: &Plan, fitted: &Fitted) -> Fitted {
    let mut out = fitted.clone();
    for (rec, residual) in out.records.iter_mut().zip(&mut out.residuals) {
        residual.iter_mut().for_each(|r| *r /= rec.weight);
        rec.weight = 1.0;
    }
    out.rmse = plan.rms(&out.residuals);
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::fit::fit;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::unknown::Unknown;

    const SCATTER: f64 = 1e-4;

    /// Swings of a pendulum with these dampings [1/s], the last record held out.
    fn swings(dampings: &[f64]) -> Plan {
        let swing = |damping: &f64| -> Vec<f64> {
            let at = |t: f64| 0.02 * (5.7 * t).cos() * (-damping * t).exp();
            (0..100).map(|k| at(0.01 * k as f64)).collect()
        };
        experiment(&pendulum("measured"), &dampings.iter().map(swing).collect::<Vec<_>>()).0
    }

    fn bench(plan: &Plan) -> Bench<'_> {
        Bench { plan, declared: Vec::new(), white: ArModel::white(vec![SCATTER]).unwrap() }
    }

    fn damping(plan: &Plan) -> Unknown {
        Unknown::of_theta(&plan.model, "pivot.damping", 0.1).unwrap()
    }

    fn fitted(plan: &Plan, records: &[RecordPlan], unknowns: &[Unknown]) -> Fitted {
        fit(plan, records, &plan.scene_values, unknowns, Some(&bench(plan).white), &POLICY.fine).unwrap()
    }

    #[test]
    fn records_are_counted_by_what_is_left_in_them() {
        let plan = swings(&[0.3, 2.0, 0.6, 0.3]);
        let (bench, plain) = (bench(&plan), fitted(&plan, &plan.fitted, &[]));
        let counted = counted(&bench, &plain);
        let over = |residual: &[f64]| (residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64).sqrt();
        let sizes: Vec<f64> = counted.residuals.iter().map(|r| over(r)).collect();
        assert!(over(&plain.residuals[1]) > 2.0 * over(&plain.residuals[0]), "{sizes:?}");
        sizes.iter().for_each(|size| assert!((size / sizes[0] - 1.0).abs() < 1e-9, "{sizes:?}"));
        // a simulation of the counted records gives the counted residuals
        for (rec, residual) in counted.records.iter().zip(&counted.residuals) {
            let shot = shoot(&plan, rec, &counted.values, ShotWants::default()).unwrap();
            shot.residual.iter().zip(residual).for_each(|(a, b)| assert!((a - b).abs() < 1e-12 * SCATTER.max(b.abs())));
        }
        let back = even(&plan, &counted);
        assert!(back.records.iter().all(|rec| rec.weight == 1.0));
        assert!((back.rmse / plain.rmse - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_record_that_no_model_follows_does_not_decide() {
        let plan = swings(&[0.5, 0.5, 0.5, 8.0, 0.55, 0.45, 0.5]);
        let (bench, unknown) = (bench(&plan), damping(&plan));
        let squares = fitted(&plan, &plan.fitted, std::slice::from_ref(&unknown));
        let mut at = squares.clone();
        for _ in 0..3 {
            let here = counted(&bench, &at);
            at = fit(&plan, &here.records, &here.values, &here.unknowns, Some(&bench.white), &POLICY.fine).unwrap();
        }
        let others = fitted(&plan, &[&plan.fitted[..3], &plan.fitted[4..]].concat(), std::slice::from_ref(&unknown));
        let [squares, at, truth] = [&squares, &at, &others].map(|fitted| unknown.value(&fitted.values));
        assert!((squares / truth - 1.0).abs() > 0.3, "{squares} {truth}");
        assert!((at / truth - 1.0).abs() < 0.05, "{at} {truth}");
    }

    #[test]
    fn models_are_judged_on_records_that_they_have_not_seen() {
        let plan = swings(&[0.5, 0.5, 0.8, 0.5]);
        let (bench, all) = (bench(&plan), fitted(&plan, &plan.fitted, &[]));
        let some = all.of_some(1);
        assert!(sought_on_some(&plan, &some) && !sought_on_some(&plan, &all) && unseen(&plan, &all, 9).is_empty());
        let others = unseen(&plan, &some, 9);
        let numbers: Vec<usize> = others.iter().map(|rec| rec.parent).collect();
        assert_eq!((some.records[0].parent, numbers), (1, vec![0, 2]));
        let squares = foretold(&bench, &some, &others);
        assert!(squares[1] > squares[0] && squares[0] > 0.0, "{squares:?}");
        assert_eq!(unseen(&plan, &some, 1)[0].parent, 2);
        // where it cannot be simulated it is infinitely far from the data
        let mut values = all.values.clone();
        damping(&plan).set(&mut values, f64::NAN);
        let nowhere = Fitted { values, ..some };
        assert!(foretold(&bench, &nowhere, &others).iter().all(|s| s.is_infinite()));
    }

    #[test]
    fn the_typical_square_is_no_sum() {
        assert!((typical(&[1.0, 4.0]) - 4.0).abs() < 1e-12 && typical(&[1.0, f64::INFINITY]).is_infinite());
        assert!(typical(&[1.0, 1.0, 1e6]) < typical(&[2.0, 2.0, 1e6]));
    }
}
