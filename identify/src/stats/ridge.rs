//! Ridge regression on groups of rows, its weight chosen by leaving out one group at a time.
//!
//! ```text
//! B = (XᵀX + λ n D)⁻¹ XᵀY,   D = diag(XᵀX)/n
//! ```
//! so that λ is relative to each feature's own size, whatever its unit.

use super::constants::STATS;
use nalgebra::{Cholesky, DMatrix};

/// Sums of one group of rows: XᵀX, XᵀY and ΣY².
#[derive(Clone, Debug)]
pub struct Group {
    xx: DMatrix<f64>,
    xy: DMatrix<f64>,
    yy: f64,
}

impl Group {
    /// No rows of `features` features and `outputs` outputs.
    pub fn new(features: usize, outputs: usize) -> Self {
        Self { xx: DMatrix::zeros(features, features), xy: DMatrix::zeros(features, outputs), yy: 0.0 }
    }

    /// Adds a row.
    pub fn add(&mut self, x: &[f64], y: &[f64]) {
        for (i, xi) in x.iter().enumerate() {
            for (j, xj) in x.iter().enumerate().skip(i) {
                self.xx[(i, j)] += xi * xj;
            }
            for (j, yj) in y.iter().enumerate() {
                self.xy[(i, j)] += xi * yj;
            }
        }
        self.yy += y.iter().map(|y| y * y).sum::<f64>();
    }

    /// The sums of both groups' rows, the other's times `sign`.
    pub fn plus(&self, other: &Self, sign: f64) -> Self {
        Self { xx: &self.xx + &other.xx * sign, xy: &self.xy + &other.xy * sign, yy: self.yy + sign * other.yy }
    }

    /// Squared error of coefficients `b` on the group's rows, ‖Y − X B‖².
    fn error(&self, b: &DMatrix<f64>) -> f64 {
        let mut full = self.xx.clone();
        full.fill_lower_triangle_with_upper_triangle();
        self.yy - 2.0 * b.dot(&self.xy) + b.dot(&(full * b))
    }

    /// B at weight λ; `None` where the sums are not finite.
    fn solve(&self, weight: f64) -> Option<DMatrix<f64>> {
        let mut a = self.xx.clone();
        a.fill_lower_triangle_with_upper_triangle();
        let largest = a.diagonal().max();
        for i in 0..a.nrows() {
            // a feature that is always zero gets a zero coefficient
            a[(i, i)] += weight * a[(i, i)] + STATS.ridge_zero * largest + f64::MIN_POSITIVE;
        }
        Cholesky::new(a).map(|c| c.solve(&self.xy))
    }
}

/// Coefficients (features × outputs) for several regressions over the same groups (one row of `all` each), with one weight for
/// all of them: the one that predicts groups left out best. `None` where no weight beats predicting zero, or with fewer than
/// two groups.
pub fn cross_validated(all: &[Vec<Group>]) -> Option<Vec<DMatrix<f64>>> {
    let totals: Vec<Group> = all.iter().map(|groups| sum(groups)).collect::<Option<_>>()?;
    let (weight, part) = best_weight(all, &totals)?;
    if part > 0.0 { totals.iter().map(|t| t.solve(weight)).collect() } else { None }
}

/// Part of the squares of groups left out that such regressions predict; 0 where they predict none, `None` with fewer than two groups.
pub fn foretold(all: &[Vec<Group>]) -> Option<f64> {
    let totals: Vec<Group> = all.iter().map(|groups| sum(groups)).collect::<Option<_>>()?;
    best_weight(all, &totals).map(|(_, part)| part.max(0.0))
}

/// The weight that predicts groups left out best, and the part of their squares that it predicts.
fn best_weight(all: &[Vec<Group>], totals: &[Group]) -> Option<(f64, f64)> {
    if all.iter().any(|groups| groups.len() < 2) {
        return None;
    }
    let left_out = |weight: f64| -> Option<f64> {
        let mut error = 0.0;
        for (groups, total) in all.iter().zip(totals) {
            for group in groups {
                error += group.error(&total.plus(group, -1.0).solve(weight)?);
            }
        }
        Some(error)
    };
    let nothing: f64 = totals.iter().map(|t| t.yy).sum();
    let tried = STATS.ridge_weights.iter().filter_map(|&w| Some((w, left_out(w)?)));
    let (weight, error) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((weight, 1.0 - error / nothing.max(f64::MIN_POSITIVE)))
}

fn sum(groups: &[Group]) -> Option<Group> {
    let (first, rest) = groups.split_first()?;
    Some(rest.iter().fold(first.clone(), |sum, g| sum.plus(g, 1.0)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn noise(k: u64) -> f64 {
        // a cheap hash, uniform in ±0.5
        let mut z = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5555;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (z >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    fn groups(law: impl Fn(&[f64]) -> f64) -> Vec<Vec<Group>> {
        let group = |g: u64| {
            let mut group = Group::new(3, 1);
            for k in 0..200 {
                let x = [1.0, noise(1000 * g + k), 1e3 * noise(7_000_000 + 1000 * g + k)];
                group.add(&x, &[law(&x) + 0.1 * noise(99_000_000 + 1000 * g + k)]);
            }
            group
        };
        vec![(0..5).map(group).collect()]
    }

    #[test]
    fn finds_a_linear_law_whatever_the_units() {
        let b = cross_validated(&groups(|x| 0.3 + 2.0 * x[1] - 5e-3 * x[2])).unwrap();
        for (k, truth) in [0.3, 2.0, -5e-3].iter().enumerate() {
            assert!((b[0][(k, 0)] / truth - 1.0).abs() < 0.05, "{k}: {}", b[0][(k, 0)]);
        }
    }

    #[test]
    fn predicts_nothing_from_features_that_say_nothing() {
        let b = cross_validated(&groups(|_| 0.0));
        let size = b.map_or(0.0, |b| b[0][(1, 0)].abs());
        assert!(size < 0.03, "{size}");
        assert!(foretold(&groups(|_| 0.0)).unwrap() < 0.01);
        assert!(foretold(&groups(|x| 0.3 + 2.0 * x[1])).unwrap() > 0.9);
    }

    #[test]
    fn one_group_cannot_be_left_out() {
        assert!(cross_validated(&[vec![Group::new(2, 1)]]).is_none());
    }
}
