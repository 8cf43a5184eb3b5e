//! Dense Cholesky for systems of up to about a hundred rows, where blocking costs more than it gives.

use crate::KktError;
use crate::constants::LINALG;
use crate::prescribed::axpy_rows;

/// A = L Lᵀ, row-major in place, lower triangle.
#[derive(Clone, Debug)]
pub(crate) struct DenseCholesky {
    dim: usize,
    /// 1/L_kk.
    inverse: Vec<f64>,
}

impl DenseCholesky {
    pub fn new(dim: usize) -> Self {
        Self { dim, inverse: vec![0.0; dim] }
    }

    pub fn factor(&mut self, a: &mut [f64]) -> Result<(), KktError> {
        let dim = self.dim;
        for r in 0..dim {
            let (above, row) = a.split_at_mut(r * dim);
            for (c, other) in above.chunks_exact(dim).enumerate() {
                row[c] = (row[c] - dot(&row[..c], &other[..c])) * self.inverse[c];
            }
            let size = row[r];
            let pivot = size - dot(&row[..r], &row[..r]);
            let sound = pivot > LINALG.pivot_floor * size && pivot < f64::INFINITY;
            if !sound {
                return Err(KktError::NotPositiveDefinite { row: r, dim, pivot, size });
            }
            self.inverse[r] = 1.0 / pivot.sqrt();
        }
        Ok(())
    }

    pub fn solve(&self, a: &[f64], b: &mut [f64], columns: usize) {
        let dim = self.dim;
        for r in 0..dim {
            gather(b, columns, r, 0, &a[r * dim..r * dim + r]);
            scale_row(b, columns, r, self.inverse[r]);
        }
        for r in (0..dim).rev() {
            scale_row(b, columns, r, self.inverse[r]);
            scatter(b, columns, r, 0, &a[r * dim..r * dim + r]);
        }
    }
}

#[inline(always)]
fn dot(x: &[f64], y: &[f64]) -> f64 {
    let (x, y) = (x.as_chunks::<4>(), y.as_chunks::<4>());
    let mut lanes = [0.0; 4];
    for (x, y) in x.0.iter().zip(y.0) {
        for (lane, (x, y)) in lanes.iter_mut().zip(x.iter().zip(y)) {
            *lane += x * y;
        }
    }
    let rest: f64 = x.1.iter().zip(y.1).map(|(x, y)| x * y).sum();
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + rest
}

/// Columns that are gathered at once, in registers.
const PANEL: usize = 16;

/// Row `r` −= Σ_k factors[k] · row `first + k`; those rows all lie before `r`, or all after it.
#[inline(always)]
fn gather(b: &mut [f64], columns: usize, r: usize, first: usize, factors: &[f64]) {
    if factors.is_empty() || columns == 0 {
        return;
    }
    if columns == 1 {
        b[r] -= dot(factors, &b[first..first + factors.len()]);
        return;
    }
    let (before, rest) = b.split_at_mut(r * columns);
    let (row, after) = rest.split_at_mut(columns);
    let sources = if first < r { &before[first * columns..] } else { &after[(first - r - 1) * columns..] };
    let mut panels = row.chunks_exact_mut(PANEL);
    for (p, panel) in panels.by_ref().enumerate() {
        let mut sums = [0.0; PANEL];
        for (factor, source) in factors.iter().zip(sources.chunks_exact(columns)) {
            let source = &source[p * PANEL..(p + 1) * PANEL];
            sums.iter_mut().zip(source).for_each(|(s, x)| *s += factor * x);
        }
        panel.iter_mut().zip(sums).for_each(|(x, s)| *x -= s);
    }
    let tail = panels.into_remainder();
    let begin = columns - tail.len();
    for (factor, source) in factors.iter().zip(sources.chunks_exact(columns)) {
        tail.iter_mut().zip(&source[begin..]).for_each(|(t, x)| *t -= factor * x);
    }
}

/// Row `first + k` −= factors[k] · row `r`, for all k.
#[inline(always)]
fn scatter(b: &mut [f64], columns: usize, r: usize, first: usize, factors: &[f64]) {
    if columns == 1 {
        let source = b[r];
        for (x, factor) in b[first..].iter_mut().zip(factors) {
            *x -= factor * source;
        }
        return;
    }
    for (k, &factor) in factors.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
        axpy_rows(b, columns, first + k, r, factor);
    }
}

#[inline(always)]
fn scale_row(b: &mut [f64], columns: usize, r: usize, factor: f64) {
    for x in &mut b[r * columns..(r + 1) * columns] {
        *x *= factor;
    }
}
