//! Likelihood of effects whose size differs from record to record, to second order about a fit.
//!
//! The deviation d_r of a cause in record r has the prior N(0, s²) ([`crate::shooting::OwnSize`]). With a record's whitened sensitivities G_r by the deviations of
//! all such causes (its initial state projected off) and its residual, F_r = G_rᵀG_r, b_r = G_rᵀ(residual without the deviations) and T = diag(s²),
//! all deviations together leave
//! ```text
//! −2 log p(T) = const + Σ_r [ln det(1 + T^½ F_r T^½) − b_rᵀ P_r b_r] − gᵀ A⁻¹ g,     P_r = (F_r + T⁻¹)⁻¹,
//! g = Σ (b_r − F_r P_r b_r),  A = Σ (F_r − F_r P_r F_r)                              (the common sizes move by A⁻¹ g)
//! ```
//! which T minimizes. So a size that varies costs one number, its spread, and what the deviations are uncertain by, and not as many numbers as
//! there are records. (A linear mixed model, by maximum likelihood: Laird & Ware 1982.)

use super::super::policy::POLICY;
use super::super::scores::reduce_each;
use super::across::solved;
use super::hypothesis::Bench;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::{OwnSize, RecordPlan, pieces_by_record};
use crate::stats::reduced::{Block, Reduced};
use crate::unknown::Unknown;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A record, or a half of it: its squares as a function of its own sizes, to second order.
#[derive(Clone, Debug)]
struct Of {
    /// F: curvature of the squares.
    gram: DMatrix<f64>,
    /// Gᵀ r at the present sizes.
    score: DVector<f64>,
    square: f64,
    /// The present deviations.
    beyond: DVector<f64>,
}

impl Of {
    /// Sum of some of a record's blocks, whose columns are numbers; `along`: those of the causes.
    fn sum(blocks: &[Block], along: &DMatrix<f64>, beyond: &DVector<f64>) -> Self {
        let n = beyond.len();
        let none = Self { gram: DMatrix::zeros(n, n), score: DVector::zeros(n), square: 0.0, beyond: beyond.clone() };
        blocks.iter().fold(none, |sum, b| Self {
            gram: sum.gram + along.transpose() * &b.gram * along,
            score: sum.score + along.transpose() * &b.score,
            square: sum.square + b.square,
            ..sum
        })
    }

    /// Gᵀ(residual without the deviation).
    fn pull(&self) -> DVector<f64> {
        &self.score + &self.gram * &self.beyond
    }
}

/// The numbers of a cause, and the direction in their coordinates in which its size varies.
pub(super) type Direction = Vec<(Unknown, f64)>;

/// Likelihood of own sizes of some causes, linearized at a fit.
pub(super) struct Apart {
    records: Vec<Of>,
    /// Of each record its first and second half.
    halves: Vec<[Of; 2]>,
    rows: f64,
    /// Common size of the first cause along its direction, counted from the scene's values.
    common: f64,
}

/// The best spreads, and what they gain.
pub(super) struct Spread {
    /// Of each cause; 0: it does not vary.
    pub of_each: Vec<f64>,
    /// Squares with these deviations and the best common sizes.
    pub squares: f64,
    /// Squares with common sizes alone.
    pub together: f64,
    /// Σ ln det(1 + T^½ F_r T^½).
    pub uncertain: f64,
}

impl Apart {
    /// Of a fit under its noise.
    pub fn new(bench: &Bench, fitted: &Fitted, causes: &[Direction]) -> Result<Self, IdentifyError> {
        let numbers: Vec<Unknown> = causes.iter().flatten().map(|(u, _)| u.clone()).collect();
        let frozen = fitted.records.iter().map(|rec| frozen(rec, &numbers)).collect();
        let reduced = reduce_each(bench.plan, &Fitted { records: frozen, ..fitted.clone() }, &numbers)?;
        let owner = causes.iter().enumerate().flat_map(|(c, of)| of.iter().map(move |(_, weight)| (c, *weight)));
        let mut along = DMatrix::zeros(numbers.len(), causes.len());
        owner.enumerate().for_each(|(j, (c, weight))| along[(j, c)] = weight);
        let one = |(pieces, reduced): (Range<usize>, &Reduced)| {
            let beyond = DVector::from_fn(causes.len(), |c, _| deviation(&fitted.records[pieces.start], &causes[c]));
            let (first, second) = reduced.blocks().split_at(reduced.blocks().len().div_ceil(2));
            let sum = |blocks: &[Block]| Of::sum(blocks, &along, &beyond);
            (sum(reduced.blocks()), [sum(first), sum(second)])
        };
        let (records, halves) = pieces_by_record(&fitted.records).into_iter().zip(&reduced).map(one).unzip();
        let way = |u: &Unknown| u.coordinate_of(u.value(&fitted.values)) - u.coordinate_of(u.value(&bench.plan.scene_values));
        let size = DVector::from_iterator(numbers.len(), numbers.iter().map(way).map(|w| if w.is_finite() { w } else { 0.0 }));
        let gram = reduced.iter().fold(DMatrix::zeros(numbers.len(), numbers.len()), |sum, r| sum + r.gram());
        let of_first = along.columns(0, causes.len().min(1)).column_sum();
        let [with, own] = [&size, &of_first].map(|x| of_first.dot(&(&gram * x)));
        let common = if own > 0.0 { with / own } else { 1.0 };
        Ok(Self { records, halves, rows: reduced.iter().map(|r| r.rows() as f64).sum(), common })
    }

    /// −2 log likelihood under these spreads beside a constant, in the parts of [`Spread`]: (squares, ln det).
    pub fn at(&self, spreads: &[f64]) -> (f64, f64) {
        let n = spreads.len();
        let (mut squares, mut uncertain) = (0.0, 0.0);
        let (mut g, mut a) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for of in &self.records {
            let b = of.pull();
            // of the residual without the deviation
            let square = of.square + 2.0 * of.beyond.dot(&of.score) + of.beyond.dot(&(&of.gram * &of.beyond));
            let (p, ln_det) = posterior(&of.gram, spreads);
            let moved = &p * &b;
            squares += square - b.dot(&moved);
            uncertain += ln_det;
            g += &b - &of.gram * &moved;
            a += &of.gram - &of.gram * &p * &of.gram;
        }
        squares -= g.dot(&solved(&a, &g));
        (squares.max(0.0), uncertain)
    }

    /// The likeliest spreads: each in turn, on a grid of its logarithm that is refined.
    pub fn spread(&self) -> Spread {
        let n = self.records.first().map_or(0, |of| of.beyond.len());
        let mut spreads = vec![0.0; n];
        let score = |spreads: &[f64]| {
            let (squares, uncertain) = self.at(spreads);
            squares + uncertain
        };
        let together = self.at(&spreads).0;
        let mut best = together;
        let know = |j: usize| self.records.iter().map(|of| of.gram[(j, j)]).fold(0.0, f64::max).sqrt();
        for _ in 0..POLICY.spread_rounds {
            for j in 0..n {
                let known = know(j);
                if known == 0.0 {
                    continue;
                }
                let (mut middle, mut width) = (POLICY.widest_spread.ln() / 2.0, POLICY.widest_spread.ln() / 2.0);
                let mut trial = spreads.clone();
                trial[j] = 0.0;
                let mut least = (score(&trial), 0.0);
                for _ in 0..POLICY.spread_grids {
                    let grid = |k: i32| middle + width * f64::from(k) / 8.0;
                    let mut at = middle;
                    let mut lowest = f64::INFINITY;
                    for k in -8..=8 {
                        trial[j] = grid(k).exp() / known;
                        let now = score(&trial);
                        if now < lowest {
                            (lowest, at) = (now, grid(k));
                        }
                    }
                    if lowest < least.0 {
                        least = (lowest, at.exp() / known);
                    }
                    (middle, width) = (at, width / 8.0);
                }
                if least.0 < best {
                    (best, spreads[j]) = least;
                }
            }
        }
        let (squares, uncertain) = self.at(&spreads);
        Spread { of_each: spreads, squares, together, uncertain }
    }

    /// Squares of both halves of every record, its own sizes told from the other half.
    pub fn left_out(&self, spreads: &[f64]) -> Vec<f64> {
        let one = |(whole, halves): (&Of, &[Of; 2])| {
            halves.clone().map(|half| {
                let other = Of { gram: &whole.gram - &half.gram, score: &whole.score - &half.score, ..whole.clone() };
                let moved = posterior(&other.gram, spreads).0 * other.pull() - &whole.beyond;
                half.square - 2.0 * moved.dot(&half.score) + moved.dot(&(&half.gram * &moved))
            })
        };
        self.records.iter().zip(&self.halves).flat_map(one).collect()
    }

    /// Squares of both halves of every record as they are.
    pub fn halves(&self) -> Vec<f64> {
        self.halves.iter().flat_map(|halves| halves.each_ref().map(|half| half.square)).collect()
    }

    /// Whether own sizes are worth a fit: −2 log likelihood that they take, whatever the noise, against the price of the spreads.
    pub fn promises(&self, spread: &Spread) -> bool {
        let numbers = spread.of_each.iter().filter(|s| **s > 0.0).count() as f64;
        let taken = self.rows * (spread.together / spread.squares.max(f64::MIN_POSITIVE)).max(1.0).ln();
        taken > POLICY.per_number * numbers + spread.uncertain
    }

    /// Whether the sizes of the first cause differ by more than a part of their mean; each weighs as much as its record says about it.
    pub fn differ(&self) -> bool {
        let mean_of = |f: &dyn Fn(f64) -> f64| {
            let weight = self.records.iter().map(|of| of.gram[(0, 0)]).sum::<f64>().max(f64::MIN_POSITIVE);
            self.records.iter().map(|of| f(self.common + of.beyond[0]) * of.gram[(0, 0)]).sum::<f64>() / weight
        };
        let mean = mean_of(&|x| x);
        mean_of(&|x| (x - mean) * (x - mean)).sqrt() > POLICY.varies * mean.abs()
    }

    /// Whether part of what the first cause does, in the squares of the readings, is against what it does on the whole: an effect that is there
    /// in some records, or of another size in each, is not the opposite in others.
    pub fn points_both_ways(&self) -> bool {
        let sum = |way: f64| -> f64 {
            let size = |of: &Of| (way * (self.common + of.beyond[0])).max(0.0);
            self.records.iter().map(|of| size(of) * size(of) * of.gram[(0, 0)]).sum()
        };
        let [with, against] = [sum(1.0), sum(-1.0)];
        with.min(against) > POLICY.against * (with + against)
    }
}

/// (F + T⁻¹)⁻¹ and ln det(1 + T^½ F T^½), for spreads that may be 0.
fn posterior(gram: &DMatrix<f64>, spreads: &[f64]) -> (DMatrix<f64>, f64) {
    let n = spreads.len();
    let inner = DMatrix::from_fn(n, n, |i, j| spreads[i] * gram[(i, j)] * spreads[j] + f64::from(u8::from(i == j)));
    let eigen = inner.symmetric_eigen();
    let values = eigen.eigenvalues.map(|x| x.max(1.0));
    let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&values.map(f64::recip)) * eigen.eigenvectors.transpose();
    (DMatrix::from_fn(n, n, |i, j| spreads[i] * inverse[(i, j)] * spreads[j]), values.iter().map(|x| x.ln()).sum())
}

/// A record whose own sizes of some numbers are no unknowns.
pub(super) fn frozen(rec: &RecordPlan, numbers: &[Unknown]) -> RecordPlan {
    let mut out = rec.clone();
    out.sizes.iter_mut().filter(|own| own.is_of(numbers)).for_each(|own| own.spread = None);
    out
}

/// Whether an own size is that of a cause.
pub(super) fn is_of(own: &OwnSize, cause: &Direction) -> bool {
    own.of[0].0.target.same(&cause[0].0.target)
}

/// Deviation of a cause in a record.
fn deviation(rec: &RecordPlan, cause: &Direction) -> f64 {
    rec.sizes.iter().find(|own| is_of(own, cause)).map_or(0.0, |own| own.beyond)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::stats::testing::gaussians;

    /// Two numbers on thirty rows a record, at deviations that are not the best.
    fn rows(records: usize) -> Vec<(DMatrix<f64>, DVector<f64>, DVector<f64>)> {
        let one = |r: usize| {
            let g = DMatrix::from_fn(30, 2, |i, j| (0.3 * (i + 7 * r) as f64 + j as f64).sin() + 0.2 * j as f64);
            let noise = DVector::from_vec(gaussians(30, 5 + r as u64));
            let size = DVector::from_vec(vec![1.0 + 0.8 * (r as f64 - 1.5), -0.5]);
            (g.clone(), g * size + noise, DVector::from_vec(vec![0.1 * r as f64, -0.2]))
        };
        (0..records).map(one).collect()
    }

    fn of(g: &DMatrix<f64>, y: &DVector<f64>, beyond: &DVector<f64>) -> Of {
        let left = y - g * beyond;
        Of { gram: g.transpose() * g, score: g.transpose() * &left, square: left.norm_squared(), beyond: beyond.clone() }
    }

    fn apart(records: usize) -> Apart {
        let all = rows(records);
        let half = |(g, y, d): &(DMatrix<f64>, DVector<f64>, DVector<f64>)| {
            [0, 15].map(|from| of(&g.rows(from, 15).into_owned(), &y.rows(from, 15).into_owned(), d))
        };
        Apart {
            records: all.iter().map(|(g, y, d)| of(g, y, d)).collect(),
            halves: all.iter().map(half).collect(),
            rows: 30.0 * records as f64,
            common: 1.0,
        }
    }

    /// −2 log likelihood of the readings as one normal vector, the common sizes being the best.
    fn dense(records: usize, spreads: &[f64]) -> f64 {
        let all = rows(records);
        let n = 30 * records;
        let (mut cov, mut x, mut y) = (DMatrix::identity(n, n), DMatrix::zeros(n, 2), DVector::zeros(n));
        let t = DMatrix::from_diagonal(&DVector::from_vec(spreads.iter().map(|s| s * s).collect()));
        for (r, (g, readings, _)) in all.iter().enumerate() {
            let mut block = cov.view_mut((30 * r, 30 * r), (30, 30));
            block += g * &t * g.transpose();
            x.view_mut((30 * r, 0), (30, 2)).copy_from(g);
            y.rows_mut(30 * r, 30).copy_from(readings);
        }
        let factor = cov.cholesky().unwrap();
        let (xs, ys) = (factor.l().solve_lower_triangular(&x).unwrap(), factor.l().solve_lower_triangular(&y).unwrap());
        let common = (xs.transpose() * &xs).cholesky().unwrap().solve(&(xs.transpose() * &ys));
        (ys - xs * common).norm_squared() + 2.0 * factor.l().diagonal().map(f64::ln).sum()
    }

    #[test]
    fn the_likelihood_of_spreads_is_that_of_all_readings() {
        let apart = apart(4);
        for spreads in [[0.0, 0.0], [0.7, 0.0], [0.3, 2.0]] {
            let (squares, uncertain) = apart.at(&spreads);
            let truth = dense(4, &spreads);
            assert!((squares + uncertain - truth).abs() < 1e-8 * truth, "{spreads:?} {squares} {uncertain} {truth}");
        }
    }

    #[test]
    fn the_likeliest_spreads_are_found() {
        let found = apart(6).spread();
        // sizes from −0.2 to 3.8 by 0.8, and one that is the same everywhere
        assert!((1.2..1.6).contains(&found.of_each[0]) && found.of_each[1] < 0.2, "{:?}", found.of_each);
        let score = found.squares + found.uncertain;
        for other in
            [[1.05 * found.of_each[0], found.of_each[1]], [0.95 * found.of_each[0], found.of_each[1]], [found.of_each[0], 0.3]]
        {
            assert!(dense(6, &other) > score - 1e-3, "{other:?}");
        }
        assert!(found.together > score + 100.0 && apart(6).promises(&found));
    }

    /// A half's squares with its sizes told from the other half are those of a fit of that half under the prior.
    #[test]
    fn halves_foretell_each_other() {
        let (apart, spreads) = (apart(3), [0.7, 0.4]);
        let left = apart.left_out(&spreads);
        for (r, (g, y, _)) in rows(3).iter().enumerate() {
            for half in 0..2 {
                let part = |k: usize| (g.rows(15 * k, 15).into_owned(), y.rows(15 * k, 15).into_owned());
                let ((g, y), (own, seen)) = (part(1 - half), part(half));
                let prior = DMatrix::from_diagonal(&DVector::from_vec(spreads.iter().map(|s| 1.0 / (s * s)).collect()));
                let size = (g.transpose() * &g + prior).cholesky().unwrap().solve(&(g.transpose() * y));
                let truth = (seen - own * size).norm_squared();
                assert!((left[2 * r + half] / truth - 1.0).abs() < 1e-9);
            }
        }
        let squares: f64 = apart.halves().iter().sum();
        assert!((squares / apart.records.iter().map(|of| of.square).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    /// A record that knows little of a size does not make it vary, and an effect in some records alone does not point both ways.
    #[test]
    fn sizes_weigh_as_much_as_is_known_of_them() {
        let with = |information: [f64; 3], sizes: [f64; 3]| {
            let one = |(f, size): (&f64, f64)| {
                of(&DMatrix::from_element(1, 1, f.sqrt()), &DVector::zeros(1), &DVector::from_element(1, size - 1.0))
            };
            Apart { records: information.iter().zip(sizes).map(one).collect(), halves: Vec::new(), rows: 3.0, common: 1.0 }
        };
        assert!(with([1.0; 3], [1.5, 1.5, 0.0]).differ() && !with([1.0, 1.0, 1e-3], [1.5, 1.5, 0.0]).differ());
        assert!(!with([1.0; 3], [1.0, 1.01, 0.98]).differ());
        let both = |sizes: [f64; 3]| with([1.0; 3], sizes).points_both_ways();
        assert!(both([8.0, -6.0, 1.0]) && both([-8.0, 6.0, -1.0]) && !both([3.0, 0.0, 0.0]) && !both([3.0, -0.1, 0.4]));
    }
}
