//! Causes whose size differs from record to record: its spread over records, and what own sizes are worth.
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
use super::coarse::Coarse;
use super::hypothesis::Bench;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::{OwnSize, RecordPlan, measured};
use crate::stats::reduced::{Block, Reduced};
use crate::unknown::{Coordinate, Unknown};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What one record, or a part of it, says of its own sizes.
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

/// What the data say of own sizes of some causes, linearized.
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
    /// Standard deviation of each cause's deviation; 0: it does not vary.
    pub sizes: Vec<f64>,
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
        let (records, halves) = measured(&fitted.records).into_iter().zip(&reduced).map(one).unzip();
        let way = |u: &Unknown| u.coordinate_of(u.value(&fitted.values)) - u.coordinate_of(u.value(&bench.plan.scene_values));
        let size = DVector::from_iterator(numbers.len(), numbers.iter().map(way).map(|w| if w.is_finite() { w } else { 0.0 }));
        let gram = reduced.iter().fold(DMatrix::zeros(numbers.len(), numbers.len()), |sum, r| sum + r.gram());
        let [with, own] = [&size, &along.column(0).into_owned()].map(|x| along.column(0).dot(&(&gram * x)));
        let common = if own > 0.0 { with / own } else { 1.0 };
        Ok(Self { records, halves, rows: reduced.iter().map(|r| r.rows() as f64).sum(), common })
    }

    /// −2 log likelihood under these spreads beside a constant, in the parts of [`Spread`]: (squares, ln det).
    fn at(&self, spreads: &[f64]) -> (f64, f64) {
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
        let mut sizes = vec![0.0; n];
        let score = |sizes: &[f64]| {
            let (squares, uncertain) = self.at(sizes);
            squares + uncertain
        };
        let together = self.at(&sizes).0;
        let mut best = together;
        let know = |j: usize| self.records.iter().map(|of| of.gram[(j, j)]).fold(0.0, f64::max).sqrt();
        for _ in 0..POLICY.spread_rounds {
            for j in 0..n {
                let known = know(j);
                if known == 0.0 {
                    continue;
                }
                let (mut middle, mut width) = (POLICY.widest_spread.ln() / 2.0, POLICY.widest_spread.ln() / 2.0);
                let mut trial = sizes.clone();
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
                    (best, sizes[j]) = least;
                }
            }
        }
        let (squares, uncertain) = self.at(&sizes);
        Spread { sizes, squares, together, uncertain }
    }

    /// Deviations under these spreads, by record.
    fn deviations(&self, spreads: &[f64]) -> Vec<DVector<f64>> {
        self.records.iter().map(|of| posterior(&of.gram, spreads).0 * of.pull()).collect()
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

    /// Whether own sizes are worth a fit: −2 log likelihood that they take, whatever the noise, against the price of the spreads. Where they
    /// leave more than `most` times the scatter they have to take most of what is left: then a linearization says little of what they leave.
    pub fn promises(&self, spread: &Spread, most: f64) -> bool {
        let numbers = spread.sizes.iter().filter(|s| **s > 0.0).count() as f64;
        let left = spread.squares / self.rows;
        if numbers == 0.0 || left > (most * most).max(POLICY.mostly * spread.together / self.rows) {
            return false;
        }
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

    /// Whether part of what the first cause does, in the squares of the readings, is against what it does on the whole: an effect that is there in some
    /// records, or of another size in each, is not the opposite in others.
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

/// A fit whose records have the common sizes of some numbers.
pub(super) fn with_common(fitted: &Fitted, numbers: &[Unknown]) -> Fitted {
    let mut out = fitted.clone();
    out.records.iter_mut().for_each(|rec| rec.sizes.retain(|own| !own.is_of(numbers)));
    out
}

/// Deviation of a cause in a record.
fn deviation(rec: &RecordPlan, cause: &Direction) -> f64 {
    rec.sizes.iter().find(|own| own.of[0].0.target.same(&cause[0].0.target)).map_or(0.0, |own| own.beyond)
}

/// From the scene's values to those of a fit, in the numbers of a cause; none where there is no way to go. What only shapes a law (its coordinate is a logarithm) is
/// part of a size where there is nothing else.
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
    pub(super) fn apart(&self, fitted: &Fitted, numbers: &[Unknown], most: f64) -> Result<Option<Fitted>, IdentifyError> {
        let Some(cause) = direction(self, fitted, numbers) else { return Ok(None) };
        let coarse = Coarse::of(self, fitted)?;
        let white = Fitted { noise: self.white.clone(), ..coarse.fitted.clone() };
        let causes = [cause];
        let apart = Apart::new(&coarse.bench(self), &white, &causes)?;
        let spread = apart.spread();
        if !apart.promises(&spread, most) {
            return Ok(None);
        }
        let opened = opened(fitted, &causes, &spread.sizes, &apart.deviations(&spread.sizes));
        Ok(Some(self.finished(&opened, &opened.records)?))
    }

    /// A fit with the spreads that are likeliest under its noise, of the causes that have own sizes in it.
    pub(super) fn spread_anew(&self, fitted: &Fitted) -> Result<Fitted, IdentifyError> {
        let causes = own_sizes(fitted);
        if causes.is_empty() {
            return Ok(fitted.clone());
        }
        let coarse = Coarse::of(self, fitted)?;
        let apart = Apart::new(&coarse.bench(self), &coarse.fitted, &causes)?;
        let spreads = apart.spread().sizes;
        Ok(opened(fitted, &causes, &spreads, &apart.deviations(&spreads)))
    }
}

/// A fit with these deviations of some causes, whose spreads are these; 0: none.
fn opened(fitted: &Fitted, causes: &[Direction], spreads: &[f64], deviations: &[DVector<f64>]) -> Fitted {
    let place = |k: usize| measured(&fitted.records).iter().position(|pieces| pieces.contains(&k)).unwrap_or(0);
    let one = |(k, rec): (usize, &RecordPlan)| {
        let (deviations, mut rec) = (&deviations[place(k)], rec.clone());
        let of = |own: &OwnSize, cause: &Direction| own.of[0].0.target.same(&cause[0].0.target);
        rec.sizes.retain(|own| !causes.iter().any(|cause| of(own, cause)));
        for (c, cause) in causes.iter().enumerate().filter(|(c, _)| spreads[*c] > 0.0) {
            rec.sizes.push(OwnSize { of: cause.clone(), beyond: deviations[c], spread: Some(spreads[c]) });
        }
        rec
    };
    Fitted { records: fitted.records.iter().enumerate().map(one).collect(), ..fitted.clone() }
}

/// The causes that have own sizes in a fit.
pub(super) fn own_sizes(fitted: &Fitted) -> Vec<Direction> {
    let free = |own: &&OwnSize| own.spread.is_some();
    fitted.records.first().map_or(Vec::new(), |rec| rec.sizes.iter().filter(free).map(|own| own.of.clone()).collect())
}

/// What the deviations in a fit are uncertain by: Σ ln det(1 + T^½ F_r T^½).
pub(super) fn uncertain(bench: &Bench, fitted: &Fitted) -> Result<f64, IdentifyError> {
    let causes = own_sizes(fitted);
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
pub(super) fn carried(fitted: &Fitted, records: &[RecordPlan]) -> Vec<RecordPlan> {
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
    use super::super::contest::Contest;
    use super::super::hypothesis::Hypothesis;
    use super::*;
    use crate::causes::{Situation, library};
    use crate::fit::fit;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
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
        assert!((1.2..1.6).contains(&found.sizes[0]) && found.sizes[1] < 0.2, "{:?}", found.sizes);
        let score = found.squares + found.uncertain;
        for other in [[1.05 * found.sizes[0], found.sizes[1]], [0.95 * found.sizes[0], found.sizes[1]], [found.sizes[0], 0.3]] {
            assert!(dense(6, &other) > score - 1e-3, "{other:?}");
        }
        assert!(found.together > score + 100.0 && apart(6).promises(&found, 1.5) && !apart(6).promises(&found, 0.5));
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

    /// What a record does not know does not make a size vary, and what is there in some records alone does not point both ways.
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
}
