//! Effects whose size differs from record to record.
//!
//! An effect of numbers θ_j is of another size in record r if their coordinates are
//! ```text
//! x_j(r) = x_j + w_j d_r,     d_r = s z_r,  z_r ~ N(0, 1)
//! ```
//! with the common coordinates x of a fit ([`crate::unknown::Unknown`]) and a direction w: that from the scene's values to the common ones where the
//! size was first let vary, so that there d = −1 is a record without the effect. The deviation's standard deviation s is the spread; z_r is one
//! more of the record's own unknowns, beside those of its initial state, and its column is s Σ w_j times those of the numbers.

use super::plan::RecordPlan;
use super::run::Shot;
use crate::unknown::{Unknown, Values};
use pliant_adjoint::Tangent;
use std::ops::Range;

/// An effect's own size in a record.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnSize {
    /// Its numbers, as they are common to all records, and by how much a deviation of 1 moves the coordinate of each [-].
    pub of: Vec<(Unknown, f64)>,
    /// Deviation in this record [-].
    pub beyond: f64,
    /// Standard deviation of that over records [-]; none where the deviation is not estimated.
    pub spread: Option<f64>,
}

impl OwnSize {
    /// The deviation in its standard deviation, where it is estimated.
    fn z(&self) -> Option<f64> {
        self.spread.map(|spread| self.beyond / spread)
    }

    /// Whether it is about one of these numbers.
    pub fn is_of(&self, numbers: &[Unknown]) -> bool {
        self.of.iter().any(|(own, _)| numbers.iter().any(|u| u.target.same(&own.target)))
    }

    /// The value of one of its numbers in this record, the common values being these.
    pub fn value(&self, number: &Unknown, common: &Values) -> Option<f64> {
        let (own, weight) = self.of.iter().find(|(own, _)| own.target.same(&number.target))?;
        Some(own.far(own.value(common), weight * self.beyond))
    }
}

impl RecordPlan {
    /// Number of its own sizes that are estimated.
    pub fn own_sizes(&self) -> usize {
        self.sizes.iter().filter(|own| own.spread.is_some()).count()
    }

    /// The unknowns of its initial state and its own sizes, each with a standard normal prior.
    pub fn z(&self) -> Vec<f64> {
        self.start.z.iter().copied().chain(self.sizes.iter().filter_map(OwnSize::z)).collect()
    }

    /// Moves the record's own unknowns.
    pub(crate) fn move_own(&mut self, change: &[f64]) {
        let (start, sizes) = change.split_at(self.start.z.len());
        self.start.z.iter_mut().zip(start).for_each(|(z, d)| *z += d);
        let free = self.sizes.iter_mut().filter_map(|own| own.spread.map(|spread| (&mut own.beyond, spread)));
        free.zip(sizes).for_each(|((beyond, spread), d)| *beyond += spread * d);
    }

    /// Takes deviations back to where they still change a size, the common values being these: beyond its bounds a number stays at them.
    pub(crate) fn keep_physical(&mut self, common: &Values) {
        for own in self.sizes.iter_mut().filter(|own| own.spread.is_some()) {
            let ends = own.of.iter().filter(|(_, weight)| *weight != 0.0).map(|(number, weight)| {
                let here = number.coordinate_of(number.value(common));
                let [a, b] = [number.bounds.0, number.bounds.1].map(|end| (number.coordinate_of(end) - here) / weight);
                [a.min(b), a.max(b)]
            });
            if let Some([low, high]) = ends.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]) {
                own.beyond = own.beyond.max(low).min(high);
            }
        }
    }

    /// With its own sizes of the numbers that these unknowns set, followers with them.
    pub(crate) fn tied(&self, unknowns: &[Unknown]) -> Self {
        let mut out = self.clone();
        for (own, _) in out.sizes.iter_mut().flat_map(|own| &mut own.of) {
            if let Some(known) = unknowns.iter().find(|u| u.target.same(&own.target)) {
                own.clone_from(known);
            }
        }
        out
    }

    /// The values as they are in this record.
    pub fn values(&self, common: &Values) -> Values {
        let mut out = common.clone();
        for (beyond, (number, weight)) in self.sizes.iter().flat_map(|own| own.of.iter().map(|of| (own.beyond, of))) {
            number.set(&mut out, number.far(number.value(common), weight * beyond));
        }
        out
    }
}

/// The pieces of each measured record. They share its sizes.
pub fn pieces_by_record(records: &[RecordPlan]) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for (k, rec) in records.iter().enumerate() {
        match out.last_mut() {
            Some(last) if records[last.start].parent == rec.parent => last.end = k + 1,
            _ => out.push(k..k + 1),
        }
    }
    out
}

/// Number of unknowns that these records have of their own.
pub fn own_unknowns(records: &[RecordPlan]) -> usize {
    let starts: usize = records.iter().map(|rec| rec.start.z.len()).sum();
    starts + pieces_by_record(records).into_iter().map(|pieces| records[pieces.start].own_sizes()).sum::<usize>()
}

/// Squares of these unknowns: the share of their priors in a fit's squares.
pub fn own_squares(records: &[RecordPlan]) -> f64 {
    let starts = records.iter().flat_map(|rec| &rec.start.z).map(|z| z * z).sum::<f64>();
    let sizes = |pieces: Range<usize>| records[pieces.start].sizes.iter().filter_map(OwnSize::z).map(|z| z * z).sum::<f64>();
    starts + pieces_by_record(records).into_iter().map(sizes).sum::<f64>()
}

/// A pass with the columns of own sizes among the record's own. It differentiated by `k` unknowns and behind them, `all` in sum, by the numbers
/// of own sizes that are not among these; `sizes` has of each own size the columns of its numbers, with their weights times the spread.
pub(super) fn beside(shot: Shot, k: usize, all: usize, sizes: &[Vec<(usize, f64)>]) -> Shot {
    let m = shot.own_columns;
    let own = m + sizes.len();
    let split = |start: &[f64], global: &[f64]| -> Vec<f64> {
        start.iter().copied().chain(sizes.iter().map(|of| of.iter().map(|(j, weight)| weight * global[*j]).sum())).collect()
    };
    let rows = shot.residual.len();
    let row = |r: usize| (&shot.own[r * m..(r + 1) * m], &shot.global[r * all..(r + 1) * all]);
    let joined = (0..rows).flat_map(|r| split(row(r).0, row(r).1)).collect();
    let global = (0..rows).flat_map(|r| row(r).1[..k].iter().copied()).collect();
    let along = |matrix: &[f64]| -> Vec<f64> {
        let one = |row: &[f64]| [&split(&row[..m], &row[m..m + all])[..], &row[m..m + k], &row[m + all..]].concat();
        matrix.chunks_exact(m + all + 1).flat_map(one).collect()
    };
    let boundary = shot.boundary.iter().map(|x| Tangent { q: along(&x.q), v: along(&x.v), z: along(&x.z) }).collect();
    Shot { own: joined, own_columns: own, global, boundary, ..shot }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::run::{ShotWants, shoot};
    use super::*;
    use crate::diagnose::testing::{experiment, pendulum};
    use crate::shooting::Plan;

    fn plan() -> (Plan, Vec<Unknown>) {
        let plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40]]).0;
        let of = |path: &str, scale: f64| Unknown::of_theta(&plan.model, path, scale).unwrap();
        let unknowns = vec![of("pivot.damping", 0.1), of("pivot.stiffness", 2.0)];
        (plan, unknowns)
    }

    /// The record with this size of its own, and two segments.
    fn with_size(plan: &Plan, of: &[Unknown], beyond: f64, spread: Option<f64>) -> RecordPlan {
        let of = of.iter().cloned().zip([2.0, 0.5]).collect();
        let mut rec = RecordPlan { sizes: vec![OwnSize { of, beyond, spread }], ..plan.fitted[0].clone() };
        let states = shoot(plan, &rec, &plan.scene_values, ShotWants { states: true, ..ShotWants::default() }).unwrap().states;
        rec.nodes = vec![(20, states[20].clone())];
        rec
    }

    #[test]
    fn an_own_size_is_the_common_one_moved() {
        let (plan, unknowns) = plan();
        let rec = with_size(&plan, &unknowns[..1], 0.7, None);
        let mut values = plan.scene_values.clone();
        unknowns[0].set(&mut values, 0.1 * (2.0 * 0.7));
        let common = RecordPlan { sizes: Vec::new(), ..rec.clone() };
        let shot = |rec: &RecordPlan, values: &Values| shoot(&plan, rec, values, ShotWants::default()).unwrap().predicted;
        assert_eq!(shot(&rec, &plan.scene_values), shot(&common, &values));
        assert_ne!(shot(&rec, &plan.scene_values), shot(&common, &plan.scene_values));
        assert!((rec.sizes[0].value(&unknowns[0], &plan.scene_values).unwrap() - 0.14).abs() < 1e-15);
        assert_eq!(rec.sizes[0].value(&unknowns[1], &plan.scene_values), None);
        // of what is not estimated there is no unknown
        assert_eq!((rec.own_sizes(), rec.z()), (0, common.z()));
    }

    /// A deviation that would make a damping negative ends where there is none, the common value being what it is; others stay.
    #[test]
    fn a_size_stays_physical() {
        let (plan, unknowns) = plan();
        let mut values = plan.scene_values.clone();
        unknowns[0].set(&mut values, 0.1);
        let kept = |beyond: f64, spread: Option<f64>| {
            let mut rec = with_size(&plan, &unknowns, beyond, spread);
            rec.keep_physical(&values);
            rec.sizes[0].beyond
        };
        // 2 of its coordinate for a deviation of 1, and a common value of 1
        assert!((kept(-3.0, Some(0.5)) + 0.5).abs() < 1e-12);
        assert_eq!([kept(-0.4, Some(0.5)), kept(9.0, Some(0.5)), kept(-3.0, None)], [-0.4, 9.0, -3.0]);
    }

    /// Its column is the derivative by its deviation, whether the common number is asked for or not, and those of all else stay what they were, at
    /// segment starts too.
    #[test]
    fn its_column_is_the_derivative() {
        let (plan, unknowns) = plan();
        let rec = with_size(&plan, &unknowns, 0.7, Some(0.5));
        let fixed = RecordPlan { sizes: vec![OwnSize { spread: None, ..rec.sizes[0].clone() }], ..rec.clone() };
        let whole = RecordPlan { nodes: Vec::new(), ..rec.clone() };
        let m = rec.z().len();
        let moved = |by: f64| {
            let mut there = whole.clone();
            let mut change = vec![0.0; m];
            change[m - 1] = by;
            there.move_own(&change);
            assert!((there.z()[m - 1] - whole.z()[m - 1] - by).abs() < 1e-12);
            shoot(&plan, &there, &plan.scene_values, ShotWants::default()).unwrap().predicted
        };
        for asked in [&unknowns[..], &unknowns[1..], &[]] {
            let wants = ShotWants { unknowns: asked, tangents: true, ..ShotWants::default() };
            let shot = |rec: &RecordPlan| shoot(&plan, rec, &plan.scene_values, wants).unwrap();
            let (own, plain) = (shot(&rec), shot(&fixed));
            assert_eq!((own.own_columns, &own.global), (m, &plain.global));
            let columns = m + asked.len() + 1;
            for (with, without) in own.boundary[0].q.chunks_exact(columns).zip(plain.boundary[0].q.chunks_exact(columns - 1)) {
                assert_eq!([&with[..m - 1], &with[m..]].concat(), without);
            }
            // the error of a central difference falls with the square of its step
            let column: Vec<f64> = shot(&whole).own.chunks_exact(m).map(|row| row[m - 1]).collect();
            let error = |by: f64| {
                let slope = |(a, b): (&f64, &f64)| (a - b) / (2.0 * by);
                let difference: Vec<f64> = moved(by).iter().zip(&moved(-by)).map(slope).collect();
                difference.iter().zip(&column).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let ratio = error(0.1) / error(0.05);
            assert!((3.6..4.4).contains(&ratio) && error(5e-3) < 1e-4 * column.iter().copied().fold(0.0, |a, b| b.abs().max(a)));
        }
    }

    /// Pieces of a record share its sizes, which count once.
    #[test]
    fn pieces_share_the_sizes_of_their_record() {
        let (plan, unknowns) = plan();
        let rec = with_size(&plan, &unknowns, 0.7, Some(0.5));
        let other = RecordPlan { parent: 1, ..with_size(&plan, &unknowns, -0.5, Some(0.5)) };
        let records = [rec.clone(), rec.clone(), other];
        assert_eq!(pieces_by_record(&records), [0..2, 2..3]);
        assert_eq!(own_unknowns(&records), 3 * rec.start.z.len() + 2);
        assert!((own_squares(&records) - 1.4f64.powi(2) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_number_that_is_tied_anew_sets_what_it_is_tied_to() {
        let (plan, unknowns) = plan();
        let rec = with_size(&plan, &unknowns[..1], 0.7, None);
        let tie = Unknown {
            target: crate::unknown::Target::Theta([unknowns[0].target.entries()[0].0, 3].to_vec()),
            ..unknowns[0].clone()
        };
        assert_eq!(rec.tied(std::slice::from_ref(&tie)).sizes[0].of, [(tie, 2.0)]);
        assert_eq!(rec.tied(&unknowns[1..]).sizes[0].of, [(unknowns[0].clone(), 2.0)]);
    }
}
