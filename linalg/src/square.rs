//! A full square matrix: the block of the bodies' degrees of freedom.

use crate::KktError;
use crate::dense::lu::DenseLu;
use pliant_math::simd::rows::{PADDING, joined, subtract_four, support};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// A full matrix by rows.
#[derive(Debug, Default, PartialEq)]
pub struct Square {
    dim: usize,
    data: Vec<f64>,
}

// by hand, for the one that is derived allocates in `clone_from`
impl Clone for Square {
    fn clone(&self) -> Self {
        Self { dim: self.dim, data: self.data.clone() }
    }

    fn clone_from(&mut self, from: &Self) {
        self.dim = from.dim;
        self.data.clone_from(&from.data);
    }
}

impl Square {
    /// The zero matrix.
    pub fn zeros(dim: usize) -> Self {
        Self { dim, data: vec![0.0; dim * dim] }
    }

    /// Number of rows.
    #[inline]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Entry (r, c).
    #[inline]
    pub fn get(&self, r: usize, c: usize) -> f64 {
        self.data[r * self.dim + c]
    }

    /// Replaces entry (r, c).
    #[inline]
    pub fn set(&mut self, r: usize, c: usize, value: f64) {
        self.data[r * self.dim + c] = value;
    }

    /// Adds to entry (r, c).
    #[inline]
    pub fn add(&mut self, r: usize, c: usize, value: f64) {
        self.data[r * self.dim + c] += value;
    }

    /// All rows in one slice.
    #[inline]
    pub fn data(&self) -> &[f64] {
        &self.data
    }

    /// All rows in one slice, to change.
    #[inline]
    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`. Rows of X that are zero but for a few columns (the unit columns of
    /// a Jacobian) cost only those.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        if self.dim == 0 || columns == 0 {
            return;
        }
        if columns == 1 {
            self.add_mul_one(scale, x, y);
            return;
        }
        struct Run<'a>(&'a Square, f64, &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.add_mul_kernel(simd, self.1, self.2, self.3, self.4);
            }
        }
        Arch::new().dispatch(Run(self, scale, x, y, columns));
    }

    /// One column, term by term onto y: where A x nearly cancels y, as in a defect, that loses fewer digits than a sum subtracted at the
    /// end. Four rows at a time, whose sums do not wait for each other.
    fn add_mul_one(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        for (rows, y) in self.data.chunks(4 * self.dim).zip(y.chunks_mut(4)) {
            let mut sums = [0.0; 4];
            sums[..y.len()].copy_from_slice(y);
            for (k, x) in x.iter().enumerate() {
                let factor = scale * x;
                for (i, sum) in sums[..y.len()].iter_mut().enumerate() {
                    *sum += rows[i * self.dim + k] * factor;
                }
            }
            y.copy_from_slice(&sums[..y.len()]);
        }
    }

    #[inline(always)]
    fn add_mul_kernel<S: Simd>(&self, simd: S, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for first in (0..self.dim).step_by(4) {
            let count = (self.dim - first).min(4);
            // the last rows are taken again, times nothing, where there are no four
            let row = |i: usize| &x[(first + i.min(count - 1)) * columns..][..columns];
            let range = (0..count).fold(0..0, |range, i| joined(&range, &support(row(i))));
            if range.is_empty() {
                continue;
            }
            let single = |i: usize| row(i)[range.clone()].iter().filter(|x| **x != 0.0).count() <= 1;
            if range.len() <= 2 * PADDING && (0..count).all(single) {
                self.add_few(scale, first..first + count, x, y, columns, &range);
                continue;
            }
            let rows = [&row(0)[range.clone()], &row(1)[range.clone()], &row(2)[range.clone()], &row(3)[range.clone()]];
            for (a, y) in self.data.chunks_exact(self.dim).zip(y.chunks_exact_mut(columns)) {
                let mut factors = [0.0; 4];
                for (factor, a) in factors.iter_mut().zip(&a[first..first + count]) {
                    *factor = -scale * a;
                }
                if factors != [0.0; 4] {
                    subtract_four(simd, &mut y[range.clone()], factors, rows);
                }
            }
        }
    }

    /// The part of [`Square::add_mul_many`] of these rows of x, which are zero but for one number each, in `range`.
    #[inline(always)]
    fn add_few(&self, scale: f64, rows: Range<usize>, x: &[f64], y: &mut [f64], columns: usize, range: &Range<usize>) {
        for k in rows {
            let row = &x[k * columns..(k + 1) * columns];
            if let Some(c) = range.clone().find(|c| row[*c] != 0.0) {
                let factor = scale * row[c];
                for (a, y) in self.data.chunks_exact(self.dim).zip(y.chunks_exact_mut(columns)) {
                    y[c] += a[k] * factor;
                }
            }
        }
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        if self.dim == 0 {
            return;
        }
        for (row, x) in self.data.chunks_exact(self.dim).zip(x) {
            let factor = scale * x;
            y.iter_mut().zip(row).for_each(|(y, a)| *y += factor * a);
        }
    }
}

/// LU of a [`Square`] with row pivoting.
#[derive(Clone, Debug)]
pub(crate) struct SquareLu(DenseLu);

impl SquareLu {
    pub fn new(dim: usize) -> Self {
        Self(DenseLu::new(dim))
    }

    /// Factors `a`, whose first row errors call `first_row`.
    pub fn refactor(&mut self, a: &Square, first_row: usize) -> Result<(), KktError> {
        self.0.factor(&a.data).map_err(|error| match error {
            KktError::Singular { row, dim, pivot, size } => {
                KktError::Singular { row: first_row + row, dim: first_row + dim, pivot, size }
            }
            KktError::NotFinite { row, dim } => KktError::NotFinite { row: first_row + row, dim: first_row + dim },
            other => other,
        })
    }

    pub fn solve(&self, b: &mut [f64], columns: usize, transpose: bool) {
        self.0.solve(b, columns, transpose);
    }
}
