//! Dense LU for systems of up to about a hundred rows, where libraries' blocking costs more than it gives.
//!
//! Rows are filled up with those of the identity, so that no loop has a remainder; elimination takes four pivots at a time, in the
//! order of operations of the textbook's.

use crate::KktError;
use crate::constants::LINALG;
use crate::panel::{PANEL, Panel, reduce_row};
use crate::pivot::sum_abs;
use pliant_math::simd::rows::{PADDING, products, subtract_four};
use pulp::{Arch, Simd, WithSimd};

/// P A = L U with row pivoting: L unit lower, U upper.
#[derive(Clone, Debug)]
pub(crate) struct DenseLu {
    dim: usize,
    /// Numbers per row, and rows.
    stride: usize,
    /// L below the diagonal, U from it on.
    entries: Vec<f64>,
    /// Row exchanged with row k at step k.
    swaps: Vec<usize>,
    /// 1/U_kk.
    inverse: Vec<f64>,
    /// Largest magnitude of each column.
    sizes: Vec<f64>,
    /// Four columns at work, from the rows of their pivots on.
    strip: Vec<[f64; 4]>,
}

impl DenseLu {
    pub fn new(dim: usize) -> Self {
        let stride = dim.next_multiple_of(PADDING);
        let mut entries = vec![0.0; stride * stride];
        for r in dim..stride {
            entries[r * stride + r] = 1.0;
        }
        let (swaps, inverse, sizes) = (vec![0; dim], vec![0.0; dim], vec![0.0; stride]);
        Self { dim, stride, entries, swaps, inverse, sizes, strip: Vec::with_capacity(stride) }
    }

    /// Factors the row-major `a`.
    pub fn factor(&mut self, a: &[f64]) -> Result<(), KktError> {
        struct Run<'a>(&'a mut DenseLu, &'a [f64]);
        impl WithSimd for Run<'_> {
            type Output = Result<(), KktError>;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                self.0.load(self.1)?;
                self.0.eliminate(simd)
            }
        }
        Arch::new().dispatch(Run(self, a))
    }

    #[inline(always)]
    fn load(&mut self, a: &[f64]) -> Result<(), KktError> {
        let (dim, stride) = (self.dim, self.stride);
        self.sizes.fill(0.0);
        for (r, from) in a.chunks_exact(dim.max(1)).enumerate() {
            if !sum_abs(from).is_finite() {
                return Err(KktError::NotFinite { row: r, dim });
            }
            self.entries[r * stride..r * stride + dim].copy_from_slice(from);
            for (size, x) in self.sizes.iter_mut().zip(from) {
                let magnitude = x.abs();
                *size = if magnitude > *size { magnitude } else { *size };
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S) -> Result<(), KktError> {
        let (dim, stride) = (self.dim, self.stride);
        for first in (0..dim).step_by(4) {
            self.strip.clear();
            let mut largest = [0.0; 4];
            for row in self.entries[first * stride..dim * stride].chunks_exact(stride) {
                let quad = four(row, first);
                enlarge(&mut largest, &quad);
                self.strip.push(quad);
            }
            for c in 0..(dim - first).min(4) {
                self.pivot(first, c, &mut largest)?;
            }
            for (row, quad) in self.entries[first * stride..dim * stride].chunks_exact_mut(stride).zip(&self.strip) {
                row[first..first + 4].copy_from_slice(quad);
            }
            let next = first + 4;
            if next >= dim {
                break;
            }
            let (head, below) = self.entries[first * stride..dim * stride].split_at_mut(4 * stride);
            let (u0, head) = head.split_at_mut(stride);
            let (u1, head) = head.split_at_mut(stride);
            let (u2, u3) = head.split_at_mut(stride);
            let [u0, u1, u2, u3] = [&mut u0[next..], &mut u1[next..], &mut u2[next..], &mut u3[next..]];
            let l = &self.strip[..4];
            subtract_four(simd, u1, [l[1][0], 0.0, 0.0, 0.0], [u0, u0, u0, u0]);
            subtract_four(simd, u2, [l[2][0], l[2][1], 0.0, 0.0], [u0, u1, u0, u0]);
            subtract_four(simd, u3, [l[3][0], l[3][1], l[3][2], 0.0], [u0, u1, u2, u0]);
            for (row, l) in below.chunks_exact_mut(stride).zip(&self.strip[4..]) {
                // band matrices are mostly zero
                if *l != [0.0; 4] {
                    subtract_four(simd, &mut row[next..], *l, [u0, u1, u2, u3]);
                }
            }
        }
        Ok(())
    }

    /// Brings the pivot of column `c` of the strip, which begins at row and column `first`, to its row, and eliminates below it within
    /// the strip. `largest` holds the largest magnitudes of the strip's columns from row `c` on, and then those below it.
    #[inline(always)]
    fn pivot(&mut self, first: usize, c: usize, largest: &mut [f64; 4]) -> Result<(), KktError> {
        let (dim, stride, k) = (self.dim, self.stride, first + c);
        let candidates = &self.strip[c..];
        let mut best = c;
        if candidates[0][c].abs() < largest[c] {
            best += candidates.iter().position(|quad| quad[c].abs() == largest[c]).unwrap_or(0);
        }
        self.strip.swap(c, best);
        best += first;
        self.swaps[k] = best;
        if best != k {
            let (head, tail) = self.entries.split_at_mut(best * stride);
            head[k * stride..(k + 1) * stride].swap_with_slice(&mut tail[..stride]);
        }
        let (head, below) = self.strip.split_at_mut(c + 1);
        let mut pivots = head[c];
        let (pivot, size) = (pivots[c], self.sizes[k]);
        let sound = pivot.abs() > LINALG.pivot_floor * size;
        if !sound {
            return Err(KktError::Singular { row: k, dim, pivot, size });
        }
        let inverse = 1.0 / pivot;
        self.inverse[k] = inverse;
        pivots[..c].fill(0.0);
        pivots[c] = -1.0;
        let mut kept = [1.0; 4];
        kept[c] = 0.0;
        *largest = [0.0; 4];
        for quad in below {
            // the entry itself is replaced by its factor
            let factor = quad[c] * inverse;
            for i in 0..4 {
                quad[i] = quad[i] * kept[i] - factor * pivots[i];
            }
            enlarge(largest, quad);
        }
        Ok(())
    }

    /// `B ← A⁻¹ B` or `A⁻ᵀ B`, row-major with `columns` right-hand sides.
    pub fn solve(&self, b: &mut [f64], columns: usize, transpose: bool) {
        struct Run<'a>(&'a DenseLu, &'a mut [f64], usize, bool);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(lu, b, columns, transpose) = self;
                match (columns, transpose) {
                    (1, false) => lu.solve_one(simd, b),
                    (1, true) => lu.solve_one_transpose(simd, b),
                    _ => lu.solve_many(simd, b, columns, transpose),
                }
            }
        }
        Arch::new().dispatch(Run(self, b, columns, transpose));
    }

    #[inline(always)]
    fn row(&self, r: usize) -> &[f64] {
        &self.entries[r * self.stride..(r + 1) * self.stride]
    }

    /// Columns `range` of four rows from `first` on.
    #[inline(always)]
    fn four_rows(&self, first: usize, range: std::ops::Range<usize>) -> [&[f64]; 4] {
        let row = |i: usize| &self.row(first + i)[range.clone()];
        [row(0), row(1), row(2), row(3)]
    }

    #[inline(always)]
    fn solve_one<S: Simd>(&self, simd: S, b: &mut [f64]) {
        let dim = self.dim;
        for (k, &other) in self.swaps.iter().enumerate() {
            b.swap(k, other);
        }
        for first in (0..dim).step_by(4) {
            let (before, own) = b.split_at_mut(first);
            let sums = products(simd, self.four_rows(first, 0..first), before);
            for i in 0..(dim - first).min(4) {
                let l = &self.row(first + i)[first..];
                let mut sum = sums[i];
                for j in 0..i {
                    sum += l[j] * own[j];
                }
                own[i] -= sum;
            }
        }
        for first in (0..dim).step_by(4).rev() {
            let count = (dim - first).min(4);
            let (own, after) = b[first..].split_at_mut(count);
            let sums = products(simd, self.four_rows(first, first + count..dim), after);
            for i in (0..count).rev() {
                let u = &self.row(first + i)[first..];
                let mut sum = sums[i];
                for j in i + 1..count {
                    sum += u[j] * own[j];
                }
                own[i] = (own[i] - sum) * self.inverse[first + i];
            }
        }
    }

    #[inline(always)]
    fn solve_one_transpose<S: Simd>(&self, simd: S, b: &mut [f64]) {
        let dim = self.dim;
        for first in (0..dim).step_by(4) {
            let count = (dim - first).min(4);
            let (own, after) = b[first..].split_at_mut(count);
            let mut x = [0.0; 4];
            for i in 0..count {
                x[i] = own[i];
                for j in 0..i {
                    x[i] -= self.row(first + j)[first + i] * x[j];
                }
                x[i] *= self.inverse[first + i];
            }
            own.copy_from_slice(&x[..count]);
            subtract_four(simd, after, x, self.four_rows(first, first + count..dim));
        }
        for first in (0..dim).step_by(4).rev() {
            let count = (dim - first).min(4);
            let (before, own) = b.split_at_mut(first);
            let mut x = [0.0; 4];
            for i in (0..count).rev() {
                x[i] = own[i];
                for j in i + 1..count {
                    x[i] -= self.row(first + j)[first + i] * x[j];
                }
            }
            own[..count].copy_from_slice(&x[..count]);
            subtract_four(simd, before, x, self.four_rows(first, 0..first));
        }
        for (k, &other) in self.swaps.iter().enumerate().rev() {
            b.swap(k, other);
        }
    }

    #[inline(always)]
    fn solve_many<S: Simd>(&self, simd: S, b: &mut [f64], columns: usize, transpose: bool) {
        let mut panel = Panel::default();
        for first in (0..columns).step_by(PANEL) {
            panel.load(b, columns, first);
            let used = (columns - first).min(PANEL);
            if transpose {
                self.substitute_transpose(simd, panel.rows(), used);
            } else {
                self.substitute(simd, panel.rows(), used);
            }
            panel.store(b, columns, first);
        }
    }

    #[inline(always)]
    fn substitute<S: Simd>(&self, simd: S, x: &mut [[f64; PANEL]], used: usize) {
        for (k, &other) in self.swaps.iter().enumerate() {
            x.swap(k, other);
        }
        for r in 0..self.dim {
            let (before, own) = x.split_at_mut(r);
            reduce_row(simd, &mut own[0], self.row(r), before, 1.0, used);
        }
        for r in (0..self.dim).rev() {
            let (own, after) = x.split_at_mut(r + 1);
            reduce_row(simd, &mut own[r], &self.row(r)[r + 1..], after, self.inverse[r], used);
        }
    }

    #[inline(always)]
    fn substitute_transpose<S: Simd>(&self, simd: S, x: &mut [[f64; PANEL]], used: usize) {
        let (dim, mut column) = (self.dim, vec![0.0; self.dim]);
        for r in 0..dim {
            (0..r).for_each(|k| column[k] = self.row(k)[r]);
            let (before, own) = x.split_at_mut(r);
            reduce_row(simd, &mut own[0], &column[..r], before, self.inverse[r], used);
        }
        for r in (0..dim).rev() {
            (r + 1..dim).for_each(|k| column[k] = self.row(k)[r]);
            let (own, after) = x.split_at_mut(r + 1);
            reduce_row(simd, &mut own[r], &column[r + 1..], after, 1.0, used);
        }
        for (k, &other) in self.swaps.iter().enumerate().rev() {
            x.swap(k, other);
        }
    }
}

/// Takes in the magnitudes of four numbers.
#[inline(always)]
fn enlarge(largest: &mut [f64; 4], quad: &[f64; 4]) {
    for (largest, x) in largest.iter_mut().zip(quad) {
        let magnitude = x.abs();
        *largest = if magnitude > *largest { magnitude } else { *largest };
    }
}

/// Four numbers of a row, which is long enough.
#[inline(always)]
fn four(row: &[f64], first: usize) -> [f64; 4] {
    let mut out = [0.0; 4];
    out.copy_from_slice(&row[first..first + 4]);
    out
}
