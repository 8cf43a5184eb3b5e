//! Curvature of costs that are given by value and slope, from one step to the next: the BFGS matrix.
//!
//! ```text
//! B ← B − B s sᵀ B/(sᵀ B s) + r rᵀ/(sᵀ r),   s = u⁺ − u,  y = g⁺ − g,  r = t y + (1 − t) B s
//! ```
//! with the largest t ≤ 1 for which sᵀ r ≥ 0.2 sᵀ B s (Powell), so that B stays positive definite.
//! g is the gradient of these costs by the inputs, exact by the rollout's derivatives. B begins with |g|²/|J| I, whose step along −g
//! promises J/2, and is yᵀy/sᵀy I before the first pair. It is kept dense, as the Gauss–Newton matrix that it is added to is: a limited
//! memory would save nothing here.

use faer::Mat;

/// B, and the inputs and the gradient it was last updated with.
#[derive(Clone, Debug, Default)]
pub(super) struct Curvature {
    matrix: Option<Mat<f64>>,
    last: Option<(Vec<f64>, Vec<f64>)>,
    pairs: usize,
}

impl Curvature {
    /// Updates B with the gradient `g` at inputs `u`, where the cost is `cost`, and adds it to the lower triangle of `hessian`.
    pub fn add(&mut self, u: &[f64], g: &[f64], cost: f64, hessian: &mut Mat<f64>) {
        let n = u.len();
        let size = dot(g, g);
        let matrix = self.matrix.get_or_insert_with(|| identity(n, size / cost.abs().max(f64::MIN_POSITIVE)));
        if let Some((u0, g0)) = &self.last {
            let s: Vec<f64> = u.iter().zip(u0).map(|(a, b)| a - b).collect();
            let y: Vec<f64> = g.iter().zip(g0).map(|(a, b)| a - b).collect();
            let sy = dot(&s, &y);
            if self.pairs == 0 && sy > 0.0 {
                *matrix = identity(n, dot(&y, &y) / sy);
            }
            let bs: Vec<f64> = (0..n).map(|i| dot(matrix.col_as_slice(i), &s)).collect();
            let sbs = dot(&s, &bs);
            if sbs > 0.0 {
                let part = if sy >= LEAST * sbs { 1.0 } else { (1.0 - LEAST) * sbs / (sbs - sy) };
                let r: Vec<f64> = y.iter().zip(&bs).map(|(y, b)| part * y + (1.0 - part) * b).collect();
                let sr = dot(&s, &r);
                for j in 0..n {
                    let column = matrix.col_as_slice_mut(j);
                    column.iter_mut().zip(bs.iter().zip(&r)).for_each(|(m, (b, r_i))| *m += r_i * r[j] / sr - b * bs[j] / sbs);
                }
                self.pairs += 1;
            }
        }
        self.last = Some((u.to_vec(), g.to_vec()));
        for j in 0..n {
            (j..n).for_each(|i| hessian[(i, j)] += matrix[(i, j)]);
        }
    }
}

/// Least part of sᵀBs that sᵀr has [-], Powell's.
const LEAST: f64 = 0.2;

fn identity(n: usize, scale: f64) -> Mat<f64> {
    Mat::from_fn(n, n, |i, j| if i == j { scale } else { 0.0 })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// B s = y of the last pair where sᵀ y > 0, and B stays positive definite where it is not.
    #[test]
    fn the_matrix_has_the_slope_of_the_last_pair() {
        let mut curvature = Curvature::default();
        let points = [[0.0, 0.0], [1.0, 0.5], [1.5, -0.5], [1.2, 0.1]];
        let slope = |u: &[f64; 2]| [3.0 * u[0] + u[1], u[0] + 2.0 * u[1]];
        let mut hessian = Mat::zeros(2, 2);
        for u in &points {
            hessian = Mat::zeros(2, 2);
            curvature.add(u, &slope(u), 1.0, &mut hessian);
        }
        let [last, before] = [points[3], points[2]];
        let s = [last[0] - before[0], last[1] - before[1]];
        let y = [slope(&last)[0] - slope(&before)[0], slope(&last)[1] - slope(&before)[1]];
        let b = [hessian[(0, 0)] * s[0] + hessian[(1, 0)] * s[1], hessian[(1, 0)] * s[0] + hessian[(1, 1)] * s[1]];
        assert!((b[0] - y[0]).abs() < 1e-12 && (b[1] - y[1]).abs() < 1e-12, "{b:?} {y:?}");
        // a step along which the slope falls
        let mut hessian = Mat::zeros(2, 2);
        curvature.add(&[2.2, 0.1], &[0.0, 0.0], 1.0, &mut hessian);
        assert!(hessian[(0, 0)] > 0.0 && hessian[(0, 0)] * hessian[(1, 1)] > hessian[(1, 0)].powi(2));
    }
}
