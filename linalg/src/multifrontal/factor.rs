//! Sparse factorization front by front, without pivoting; the analysis of the pattern is made once and shared.
//!
//! Each front is assembled from the matrix and the updates of its children, its pivots are eliminated in the processor's widest vectors,
//! and the remaining update goes to its parent. Without pivoting there is no fill beyond that of the analysis; that is as safe as in a
//! band ([`crate::band::lu`]), and each row's pivot is checked likewise, and its growth where the matrix is not symmetric.

use crate::buffer::Buffer;
use crate::constants::LINALG;
use crate::multifrontal::Symbolic;
use crate::multifrontal::symbolic::Front;
use crate::{KktError, NodeMatrix, Symmetry};
use faer::linalg::matmul::matmul;
use faer::prelude::{IntoConst, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};
use pliant_math::simd::rows::{PADDING, ROWS, add_row, copy_row, magnitudes, subtract_four, subtract_from_four};
use pulp::{Arch, Simd, WithSimd};
use std::cell::RefCell;

thread_local! {
    /// One a thread, so that factorizations neither allocate nor share.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

#[derive(Default)]
struct Scratch {
    front: Vec<f64>,
    /// Contribution blocks of fronts.
    stack: Vec<f64>,
    /// Size of each row of the matrix in the order of elimination: which its pivot is compared with.
    sizes: Vec<f64>,
    /// A strip's rows over their pivots.
    scaled: Vec<f64>,
}

/// A = L U, L unit lower, or Uᵀ D⁻¹ U with D the diagonal of U.
#[derive(Clone, Debug)]
pub(crate) struct Numeric {
    /// Front by front its pivots' rows: L before the diagonal (unless symmetric), U from it on.
    pub(crate) upper: Buffer,
    /// Front by front the rows of L beyond the pivots; none if symmetric.
    pub(crate) lower: Buffer,
    /// 1/U_kk.
    pub(crate) inverse: Vec<f64>,
}

impl Numeric {
    pub fn new(fronts: &Symbolic) -> Self {
        let (upper, lower) = (Buffer::zeros(fronts.upper_len), Buffer::zeros(fronts.lower_len));
        Self { upper, lower, inverse: vec![0.0; fronts.dim()] }
    }

    /// Whether all pivots are positive, as those of a matrix with a positive definite symmetric part are.
    pub fn all_positive(&self) -> bool {
        self.inverse.iter().all(|x| *x > 0.0)
    }

    pub fn refactor(&mut self, a: &NodeMatrix, fronts: &Symbolic) -> Result<(), KktError> {
        struct Run<'a>(&'a mut Numeric, &'a NodeMatrix, &'a Symbolic, &'a mut Scratch);
        impl WithSimd for Run<'_> {
            type Output = Result<(), KktError>;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                let Self(factor, a, fronts, scratch) = self;
                factor.measure(simd, a, fronts, scratch)?;
                factor.eliminate(simd, a, fronts, scratch)
            }
        }
        SCRATCH.with_borrow_mut(|scratch| Arch::new().dispatch(Run(self, a, fronts, scratch)))
    }

    /// Sizes of rows.
    #[inline(always)]
    fn measure<S: Simd>(&self, simd: S, a: &NodeMatrix, fronts: &Symbolic, scratch: &mut Scratch) -> Result<(), KktError> {
        let dim = fronts.dim();
        scratch.sizes.resize(dim, 0.0);
        for row in 0..dim {
            let size = magnitudes(simd, a.row(row));
            if !size.is_finite() {
                return Err(KktError::NotFinite { row, dim });
            }
            scratch.sizes[fronts.row(row)] = size;
        }
        Ok(())
    }

    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, a: &NodeMatrix, fronts: &Symbolic, scratch: &mut Scratch) -> Result<(), KktError> {
        let (b, symmetric) = (fronts.block, fronts.symmetry == Symmetry::Symmetric);
        let Scratch { front: square, stack, sizes, scaled } = scratch;
        let widest = (b * fronts.widest).next_multiple_of(PADDING);
        grow(square, widest * widest);
        grow(stack, fronts.stack);
        grow(scaled, LINALG.strip * widest);
        let mut top = 0;
        for front in &fronts.fronts {
            let (k, m) = (b * front.pivots, b * front.rows.len());
            let mut dense = Square { entries: &mut *square, stride: (k + m).next_multiple_of(PADDING), rows: k + m };
            dense.clear(symmetric);
            let absent = |slot: usize| fronts.absent[fronts.slot(front.first + slot)];
            match b {
                3 => dense.load::<3>(a, front, absent),
                _ => dense.load::<4>(a, front, absent),
            }
            for &child in front.children.iter().rev() {
                let child = &fronts.fronts[child];
                let len = (b * child.rows.len()).pow(2);
                dense.take_in(simd, &stack[top - len..top], child, b, symmetric);
                top -= len;
            }
            let own = b * front.first..b * front.first + k;
            let done = dense.eliminate(simd, k, symmetric, &sizes[own.clone()], &mut self.inverse[own], scaled);
            done.map_err(|broken| broken.named(fronts, b * front.first))?;
            self.keep(simd, &dense, front, b, symmetric);
            for (r, (to, from)) in stack[top..top + m * m].chunks_exact_mut(m.max(1)).zip(dense.rows_from(k)).enumerate() {
                let first = if symmetric { r } else { 0 };
                copy_row(simd, &mut to[first..], &from[k + first..k + m]);
            }
            top += m * m;
        }
        Ok(())
    }

    /// Copies the parts that solves need.
    #[inline(always)]
    fn keep<S: Simd>(&mut self, simd: S, dense: &Square, front: &Front, b: usize, symmetric: bool) {
        let (k, f) = (b * front.pivots, dense.rows);
        for (r, (to, from)) in
            self.upper[front.upper..front.upper + k * f].chunks_exact_mut(f).zip(dense.rows_from(0)).enumerate()
        {
            let first = if symmetric { r } else { 0 };
            copy_row(simd, &mut to[first..], &from[first..f]);
        }
        if !symmetric {
            for (to, from) in self.lower[front.lower..front.lower + k * (f - k)].chunks_exact_mut(k).zip(dense.rows_from(k)) {
                copy_row(simd, to, &from[..k]);
            }
        }
    }
}

/// Four rows, one after the other.
#[inline(always)]
fn four(rows: &mut [f64], stride: usize) -> [&mut [f64]; ROWS] {
    let (first, rest) = rows.split_at_mut(stride);
    let (second, rest) = rest.split_at_mut(stride);
    let (third, fourth) = rest.split_at_mut(stride);
    [first, second, third, &mut fourth[..stride]]
}

fn grow(buffer: &mut Vec<f64>, len: usize) {
    if buffer.len() < len {
        buffer.resize(len, 0.0);
    }
}

/// Why a row of a front cannot be eliminated.
struct Broken {
    row: usize,
    pivot: f64,
    size: f64,
    growth: Option<f64>,
    indefinite: bool,
}

impl Broken {
    #[cold]
    fn named(&self, fronts: &Symbolic, first: usize) -> KktError {
        let (at, dim) = (first + self.row, fronts.dim());
        let row = (0..dim).find(|&row| fronts.row(row) == at).unwrap_or(at);
        let (pivot, size) = (self.pivot, self.size);
        match self.growth {
            Some(growth) => KktError::Growth { row, dim, growth },
            None if self.indefinite => KktError::NotPositiveDefinite { row, dim, pivot, size },
            None => KktError::Singular { row, dim, pivot, size },
        }
    }
}

/// A front's matrix, row-major.
struct Square<'a> {
    entries: &'a mut Vec<f64>,
    stride: usize,
    rows: usize,
}

impl Square<'_> {
    #[inline(always)]
    fn rows_from(&self, first: usize) -> impl Iterator<Item = &[f64]> {
        self.entries[first * self.stride..self.rows * self.stride].chunks_exact(self.stride)
    }

    /// Sets to zero the used part: where symmetric, rows from the vector on that the diagonal is in.
    #[inline(always)]
    fn clear(&mut self, symmetric: bool) {
        for (r, row) in self.entries[..self.stride * self.rows].chunks_exact_mut(self.stride).enumerate() {
            // (whole pieces, which need no call)
            let pieces = row.as_chunks_mut::<PADDING>().0;
            for piece in &mut pieces[if symmetric { r / PADDING } else { 0 }..] {
                *piece = [0.0; PADDING];
            }
        }
    }

    /// Adds the entries of the matrix in the front, in blocks of `B` rows; slots that are `absent` are rows and columns of the identity.
    #[inline(always)]
    fn load<const B: usize>(&mut self, a: &NodeMatrix, front: &Front, absent: impl Fn(usize) -> bool) {
        for entry in &front.entries {
            let to = entry.row * B * self.stride + entry.column * B;
            if entry.row == entry.column && absent(entry.row) {
                (0..B).for_each(|r| self.entries[to + r * self.stride + r] = 1.0);
                continue;
            }
            for r in 0..B {
                let from = a.data()[entry.place + r * entry.down..].first_chunk::<B>();
                if let (Some(from), Some(to)) = (from, self.entries[to + r * self.stride..].first_chunk_mut::<B>()) {
                    *to = *from;
                }
            }
        }
    }

    /// Adds a child's update.
    #[inline(always)]
    fn take_in<S: Simd>(&mut self, simd: S, handed: &[f64], child: &Front, b: usize, symmetric: bool) {
        let m = b * child.rows.len();
        for rows in &child.spans {
            for r in 0..b * rows.len {
                let from = &handed[(b * rows.from + r) * m..][..m];
                let to = &mut self.entries[(b * rows.to + r) * self.stride..][..self.stride];
                for columns in child.spans.iter().filter(|c| !symmetric || c.from >= rows.from) {
                    let len = b * columns.len;
                    add_row(simd, &mut to[b * columns.to..][..len], &from[b * columns.from..][..len]);
                }
            }
        }
    }

    /// Eliminates the first `k` rows, with `sizes` to compare pivots with; `inverse` receives 1 over the pivots.
    #[inline(always)]
    fn eliminate<S: Simd>(
        &mut self,
        simd: S,
        k: usize,
        symmetric: bool,
        sizes: &[f64],
        inverse: &mut [f64],
        scaled: &mut [f64],
    ) -> Result<(), Broken> {
        let strip = if self.rows < LINALG.wide_front { k } else { LINALG.strip };
        for first in (0..k).step_by(strip.max(1)) {
            let last = k.min(first + strip);
            let whole = self.rows < LINALG.wide_front;
            for quad in (first..last).step_by(4) {
                self.pivot(simd, quad, last.min(quad + 4), symmetric, sizes, inverse)?;
                if symmetric {
                    self.reduce_symmetric(simd, quad, last.min(quad + 4), if whole { self.rows } else { last }, inverse);
                } else {
                    self.reduce(simd, quad, last.min(quad + 4), last, whole, inverse);
                }
            }
            if !whole && symmetric {
                self.subtract_square(first, last, inverse, scaled);
            } else if !whole {
                self.subtract_product(first, last);
            }
        }
        Ok(())
    }

    /// Eliminates rows `first` to `last`, four at most, by one another, and checks them.
    #[inline(always)]
    fn pivot<S: Simd>(
        &mut self,
        simd: S,
        first: usize,
        last: usize,
        symmetric: bool,
        sizes: &[f64],
        inverse: &mut [f64],
    ) -> Result<(), Broken> {
        let (stride, rows) = (self.stride, self.rows);
        let (head, _) = self.entries[first * stride..].split_at_mut((last - first) * stride);
        for c in 0..last - first {
            let (done, row) = head.split_at_mut(c * stride);
            let row = &mut row[..stride];
            if c > 0 {
                let mut factors = [0.0; 4];
                for i in 0..c {
                    let above = &done[i * stride..(i + 1) * stride];
                    let mut own = if symmetric { above[first + c] } else { row[first + i] };
                    if !symmetric {
                        for (j, factor) in factors.iter().enumerate().take(i) {
                            own -= factor * done[j * stride + first + i];
                        }
                    }
                    factors[i] = own * inverse[first + i];
                }
                let from = (first + c) / PADDING * PADDING;
                let above = |i: usize| &done[i.min(c - 1) * stride + from..(i.min(c - 1) + 1) * stride];
                // entries before the diagonal in the same vector are put back below
                let kept: [f64; PADDING] = std::array::from_fn(|i| row[from + i]);
                subtract_four(simd, &mut row[from..], factors, [above(0), above(1), above(2), above(3)]);
                row[from..first + c].copy_from_slice(&kept[..first + c - from]);
                if !symmetric {
                    row[first..first + c].copy_from_slice(&factors[..c]);
                }
            }
            let (at, size) = (first + c, sizes[first + c]);
            let pivot = row[at];
            // (where all pivots are positive nothing grows: the reduced diagonal bounds its row)
            let grown = if symmetric { pivot } else { magnitudes(simd, &row[at..rows]) };
            // written so that NaN fails
            let positive = !symmetric || pivot > 0.0;
            let sound = positive && pivot.abs() > LINALG.pivot_floor * size && grown <= LINALG.growth_limit * size;
            if !sound {
                let singular = pivot.abs() <= LINALG.pivot_floor * size;
                let growth = (!singular && positive).then_some(grown / size);
                return Err(Broken { row: at, pivot, size, growth, indefinite: symmetric && growth.is_none() });
            }
            inverse[at] = 1.0 / pivot;
        }
        Ok(())
    }

    /// Reduces the rows below by rows `first` to `last` of U, four at most; those from `end` on in the columns before `end` alone, unless
    /// `whole`.
    #[inline(always)]
    fn reduce<S: Simd>(&mut self, simd: S, first: usize, last: usize, end: usize, whole: bool, inverse: &[f64]) {
        let (stride, count) = (self.stride, last - first);
        let (head, below) = self.entries[first * stride..self.rows * stride].split_at_mut(count * stride);
        let upper = |i: usize| &head[i.min(count - 1) * stride..(i.min(count - 1) + 1) * stride];
        let mut inner = [[0.0; 4]; 4];
        for (i, row) in inner.iter_mut().enumerate().take(count) {
            row[..count].copy_from_slice(&upper(i)[first..last]);
        }
        let inverse: [f64; 4] = std::array::from_fn(|i| inverse.get(first + i).copied().filter(|_| i < count).unwrap_or(0.0));
        let until = |r: usize| if whole || last + r < end { stride } else { end };
        let mut r = 0;
        for rows in below.chunks_mut(ROWS * stride) {
            let mut l = [[0.0; 4]; ROWS];
            for (row, l) in rows.chunks_exact_mut(stride).zip(&mut l) {
                for i in 0..count {
                    let mut own = row[first + i];
                    for j in 0..i {
                        own -= l[j] * inner[j][i];
                    }
                    l[i] = own * inverse[i];
                }
                row[first..last].copy_from_slice(&l[..count]);
            }
            let range = last..until(r);
            if rows.len() == ROWS * stride && until(r) == until(r + ROWS - 1) {
                let rows = four(rows, stride).map(|row| &mut row[range.clone()]);
                let above = |i: usize| &upper(i)[range.clone()];
                match count {
                    1 => subtract_from_four(simd, rows, &l, [above(0)]),
                    2 => subtract_from_four(simd, rows, &l, [above(0), above(1)]),
                    3 => subtract_from_four(simd, rows, &l, [above(0), above(1), above(2)]),
                    _ => subtract_from_four(simd, rows, &l, [above(0), above(1), above(2), above(3)]),
                }
            } else {
                for (k, (row, l)) in rows.chunks_exact_mut(stride).zip(l).enumerate() {
                    let range = last..until(r + k);
                    let above = |i: usize| &upper(i)[range.clone()];
                    subtract_four(simd, &mut row[range.clone()], l, [above(0), above(1), above(2), above(3)]);
                }
            }
            r += ROWS;
        }
    }

    /// Reduces the upper triangle of the rows below up to row `end` by rows `first` to `last`, four at most.
    #[inline(always)]
    fn reduce_symmetric<S: Simd>(&mut self, simd: S, first: usize, last: usize, end: usize, inverse: &[f64]) {
        let (stride, count) = (self.stride, last - first);
        let (head, below) = self.entries[first * stride..end * stride].split_at_mut(count * stride);
        let upper = |i: usize| &head[i.min(count - 1) * stride..(i.min(count - 1) + 1) * stride];
        let pivots = [upper(0), upper(1), upper(2), upper(3)];
        let inverse: [f64; 4] = std::array::from_fn(|i| inverse.get(first + i).copied().filter(|_| i < count).unwrap_or(0.0));
        // rows whose diagonals are in the same vector begin with it together
        let single = (last.next_multiple_of(ROWS) - last).min(end - last);
        let (before, groups) = below.split_at_mut(single * stride);
        let factors = |own: usize| -> [f64; 4] { std::array::from_fn(|i| pivots[i][own] * inverse[i]) };
        let mut own = last;
        for row in before.chunks_exact_mut(stride) {
            let from = own / PADDING * PADDING;
            subtract_four(simd, &mut row[from..], factors(own), pivots.map(|u| &u[from..]));
            own += 1;
        }
        for rows in groups.chunks_mut(ROWS * stride) {
            let from = own / PADDING * PADDING;
            if rows.len() < ROWS * stride {
                for (k, row) in rows.chunks_exact_mut(stride).enumerate() {
                    subtract_four(simd, &mut row[from..], factors(own + k), pivots.map(|u| &u[from..]));
                }
                break;
            }
            let l = [factors(own), factors(own + 1), factors(own + 2), factors(own + 3)];
            let rows = four(rows, stride).map(|row| &mut row[from..]);
            let above = pivots.map(|u| &u[from..]);
            match count {
                1 => subtract_from_four(simd, rows, &l, [above[0]]),
                2 => subtract_from_four(simd, rows, &l, [above[0], above[1]]),
                3 => subtract_from_four(simd, rows, &l, [above[0], above[1], above[2]]),
                _ => subtract_from_four(simd, rows, &l, above),
            }
            own += ROWS;
        }
    }

    fn view(&mut self) -> MatMut<'_, f64> {
        let (rows, stride) = (self.rows, self.stride);
        // (faer 0.24.4 takes the same of rows for columns)
        MatMut::from_column_major_slice_with_stride_mut(&mut self.entries[..rows * stride], rows, rows, stride).transpose_mut()
    }

    /// Updates the part beyond pivots `first` to `last` by −L U.
    fn subtract_product(&mut self, first: usize, last: usize) {
        let all = self.view();
        let (_, upper, lower, rest) = all.split_at_mut(last, last);
        let (upper, lower) = (upper.into_const().subrows(first, last - first), lower.into_const().subcols(first, last - first));
        matmul(rest, Accum::Add, lower, upper, -1.0, Par::Seq);
    }

    /// The same of a symmetric front, in the upper triangle.
    fn subtract_square(&mut self, first: usize, last: usize, inverse: &[f64], scaled: &mut [f64]) {
        let (rows, stride, count) = (self.rows, self.stride, last - first);
        let left = rows - last;
        for (i, to) in scaled.chunks_exact_mut(left.max(1)).enumerate().take(count) {
            let from = &self.entries[(first + i) * stride + last..][..left];
            to.iter_mut().zip(from).for_each(|(x, u)| *x = u * inverse[first + i]);
        }
        let scaled = MatRef::from_row_major_slice(&scaled[..count * left], count, left).transpose();
        let all = self.view();
        let (_, upper, _, mut rest) = all.split_at_mut(last, last);
        let upper = upper.into_const().subrows(first, count);
        for r in (0..left).step_by(LINALG.wide_front) {
            let (some, beyond) = (LINALG.wide_front.min(left - r), left - r);
            let target = rest.rb_mut().submatrix_mut(r, r, some, beyond);
            matmul(target, Accum::Add, scaled.subrows(r, some), upper.subcols(r, beyond), -1.0, Par::Seq);
        }
    }
}
