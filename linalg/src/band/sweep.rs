//! Triangular solves inside a block band, shared by the band's LU and Cholesky.
//!
//! A strict triangle is stored by rows of `width = B half_width + B − 1` entries, B rows a node. Row r of node i of an *upper* triangle
//! holds the columns B i + 1 … B i + width; row r of node j of a *lower* one holds B (j − half_width) … B j + B − 2. Entries that do not belong to
//! the strict triangle, or lie outside the matrix, are zero. Every row then has the same length, and its part outside the own
//! node is contiguous at a fixed offset.
//!
//! One right-hand side is vectorised along the band, many along the right-hand sides.

use pulp::{Arch, Simd, WithSimd};

/// Sizes of a block band of B × B blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Band<const B: usize> {
    pub n_blocks: usize,
    pub half_width: usize,
}

/// Which triangle.
#[derive(Clone, Copy)]
enum Way {
    Upper,
    UpperTranspose,
    Lower,
    LowerTranspose,
}

/// Right-hand sides taken at a time, so that the rows of a band's width stay in the first cache.
const CHUNK: usize = 256;

impl<const B: usize> Band<B> {
    pub fn dim(self) -> usize {
        B * self.n_blocks
    }

    #[inline(always)]
    pub fn width(self) -> usize {
        B * self.half_width + B - 1
    }

    /// Calls `run` with the half width as a constant where it is a common one, so that its inner loops unroll.
    #[inline(always)]
    pub fn specialised<R>(self, run: impl FnOnce(Self) -> R) -> R {
        match self.half_width {
            2 => run(Self { half_width: 2, ..self }),
            1 => run(Self { half_width: 1, ..self }),
            _ => run(self),
        }
    }

    /// `b ← U⁻¹ b`, U unit upper.
    pub fn solve_upper(self, upper: &[f64], b: &mut [f64], columns: usize) {
        self.solve(Way::Upper, upper, &[], b, columns);
    }

    /// `b ← U⁻ᵀ b`, U unit upper.
    pub fn solve_upper_transpose(self, upper: &[f64], b: &mut [f64], columns: usize) {
        self.solve(Way::UpperTranspose, upper, &[], b, columns);
    }

    /// `b ← L⁻¹ b`, L = strict lower triangle + diagonal, the reciprocals of which are `inverse`.
    pub fn solve_lower(self, lower: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        self.solve(Way::Lower, lower, inverse, b, columns);
    }

    /// `b ← L⁻ᵀ b`, L as in [`Self::solve_lower`].
    pub fn solve_lower_transpose(self, lower: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        self.solve(Way::LowerTranspose, lower, inverse, b, columns);
    }

    /// In the processor's widest vectors.
    fn solve(self, way: Way, triangle: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        struct Run<'a, const B: usize>(Band<B>, Way, &'a [f64], &'a [f64], &'a mut [f64], usize);
        impl<const B: usize> WithSimd for Run<'_, B> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) {
                let Self(band, way, triangle, inverse, b, columns) = self;
                // not by a closure, which would be compiled without the wide vectors
                match band.half_width {
                    2 => Band { half_width: 2, ..band }.sweep(way, triangle, inverse, b, columns),
                    1 => Band { half_width: 1, ..band }.sweep(way, triangle, inverse, b, columns),
                    _ => band.sweep(way, triangle, inverse, b, columns),
                }
            }
        }
        Arch::new().dispatch(Run(self, way, triangle, inverse, b, columns));
    }

    #[inline(always)]
    fn sweep(self, way: Way, entries: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        match (way, columns) {
            (Way::Upper, 1) => upper_one(self, entries, b),
            (Way::UpperTranspose, 1) => upper_transpose_one(self, entries, b),
            (Way::Lower, 1) => lower_one(self, entries, inverse, b),
            (Way::LowerTranspose, 1) => lower_transpose_one(self, entries, inverse, b),
            (Way::Upper, _) => sweep(self, b, columns, Triangle::upper(self, entries, false), false, None),
            (Way::UpperTranspose, _) => sweep(self, b, columns, Triangle::upper(self, entries, true), true, None),
            (Way::Lower, _) => sweep(self, b, columns, Triangle::lower(self, entries, false), true, Some(inverse)),
            (Way::LowerTranspose, _) => sweep(self, b, columns, Triangle::lower(self, entries, true), false, Some(inverse)),
        }
    }

    /// Nodes below and above `i` that are coupled to it.
    #[inline(always)]
    fn before(self, i: usize) -> std::ops::Range<usize> {
        i.saturating_sub(self.half_width)..i
    }

    #[inline(always)]
    fn after(self, i: usize) -> std::ops::Range<usize> {
        i + 1..self.n_blocks.min(i + 1 + self.half_width)
    }
}

/// The rows of node `i`, of `width` entries each.
#[inline(always)]
fn node_rows<const B: usize>(triangle: &[f64], width: usize, i: usize) -> [&[f64]; B] {
    let rows = &triangle[B * i * width..(B * i + B) * width];
    std::array::from_fn(|a| &rows[a * width..(a + 1) * width])
}

/// The entries of node `i` in a vector.
#[inline(always)]
fn node_entries<const B: usize>(x: &[f64], i: usize) -> [f64; B] {
    std::array::from_fn(|a| x[B * i + a])
}

/// Dot products with the same vector.
#[inline(always)]
fn dots<const B: usize>(rows: [&[f64]; B], x: &[f64]) -> [f64; B] {
    let mut even = [0.0; B];
    let mut odd = [0.0; B];
    for a in 0..B {
        let (pairs, x_pairs) = (rows[a][..x.len()].as_chunks::<2>(), x.as_chunks::<2>());
        for (r, x) in pairs.0.iter().zip(x_pairs.0) {
            even[a] += r[0] * x[0];
            odd[a] += r[1] * x[1];
        }
        for (r, x) in pairs.1.iter().zip(x_pairs.1) {
            even[a] += r * x;
        }
    }
    std::array::from_fn(|a| even[a] + odd[a])
}

/// `x −= Σ y_a row_a`.
#[inline(always)]
fn subtract_rows<const B: usize>(x: &mut [f64], rows: [&[f64]; B], y: [f64; B]) {
    let n = x.len();
    let rows = rows.map(|row| &row[..n]);
    for (k, x) in x.iter_mut().enumerate() {
        let mut sum = y[0] * rows[0][k];
        for a in 1..B {
            sum += y[a] * rows[a][k];
        }
        *x -= sum;
    }
}

#[inline(always)]
fn upper_one<const B: usize>(band: Band<B>, upper: &[f64], b: &mut [f64]) {
    let far = B * band.half_width;
    for i in (0..band.n_blocks).rev() {
        let rows: [&[f64]; B] = node_rows(upper, band.width(), i);
        let (head, tail) = b.split_at_mut(B * i + B);
        let s = dots(rows.map(|row| &row[B - 1..]), if tail.len() >= far { &tail[..far] } else { tail });
        let mut x: [f64; B] = node_entries(head, i);
        for a in (0..B).rev() {
            x[a] -= s[a];
            for c in (a + 1..B).rev() {
                x[a] -= rows[a][c - 1] * x[c];
            }
        }
        head[B * i..].copy_from_slice(&x);
    }
}

#[inline(always)]
fn upper_transpose_one<const B: usize>(band: Band<B>, upper: &[f64], b: &mut [f64]) {
    let far = B * band.half_width;
    for i in 0..band.n_blocks {
        let rows: [&[f64]; B] = node_rows(upper, band.width(), i);
        let (head, tail) = b[B * i..].split_at_mut(B);
        let mut y: [f64; B] = node_entries(head, 0);
        for c in 1..B {
            for a in 0..c {
                y[c] -= rows[a][c - 1] * y[a];
            }
        }
        head.copy_from_slice(&y);
        let reach = far.min(tail.len());
        subtract_rows(if reach == far { &mut tail[..far] } else { tail }, rows.map(|row| &row[B - 1..]), y);
    }
}

#[inline(always)]
fn lower_one<const B: usize>(band: Band<B>, lower: &[f64], inverse: &[f64], b: &mut [f64]) {
    let far = B * band.half_width;
    for i in 0..band.n_blocks {
        let rows: [&[f64]; B] = node_rows(lower, band.width(), i);
        let (head, own) = b.split_at_mut(B * i);
        let s = match head.len().checked_sub(far) {
            Some(start) => dots(rows, &head[start..start + far]),
            None => dots(rows.map(|row| &row[far - B * i..]), head),
        };
        let d = &inverse[B * i..B * i + B];
        let mut x: [f64; B] = node_entries(own, 0);
        for a in 0..B {
            x[a] -= s[a];
            for c in 0..a {
                x[a] -= rows[a][far + c] * x[c];
            }
            x[a] *= d[a];
        }
        own[..B].copy_from_slice(&x);
    }
}

#[inline(always)]
fn lower_transpose_one<const B: usize>(band: Band<B>, lower: &[f64], inverse: &[f64], b: &mut [f64]) {
    let far = B * band.half_width;
    for i in (0..band.n_blocks).rev() {
        let rows: [&[f64]; B] = node_rows(lower, band.width(), i);
        let (head, own) = b.split_at_mut(B * i);
        let d = &inverse[B * i..B * i + B];
        let mut x: [f64; B] = node_entries(own, 0);
        for a in (0..B).rev() {
            for c in (a + 1..B).rev() {
                x[a] -= rows[c][far + a] * x[c];
            }
            x[a] *= d[a];
        }
        own[..B].copy_from_slice(&x);
        match head.len().checked_sub(far) {
            Some(start) => subtract_rows(&mut head[start..start + far], rows, x),
            None => subtract_rows(head, rows.map(|row| &row[far - B * i..]), x),
        }
    }
}

/// A stored triangle T, or its transpose, seen by blocks.
#[derive(Clone, Copy)]
struct Triangle<'a, const B: usize> {
    entries: &'a [f64],
    width: usize,
    /// Entry (r, c) of node i is at r · width + c − B i + offset − shift.
    offset: usize,
    shift: usize,
    transpose: bool,
}

impl<'a, const B: usize> Triangle<'a, B> {
    #[inline(always)]
    fn upper(band: Band<B>, entries: &'a [f64], transpose: bool) -> Self {
        Self { entries, width: band.width(), offset: 0, shift: 1, transpose }
    }

    #[inline(always)]
    fn lower(band: Band<B>, entries: &'a [f64], transpose: bool) -> Self {
        Self { entries, width: band.width(), offset: B * band.half_width, shift: 0, transpose }
    }

    /// Where block (i, j) starts, plus the shift, and the distances between its rows and between its columns.
    #[inline(always)]
    fn start(self, i: usize, j: usize) -> usize {
        let (owner, other) = if self.transpose { (j, i) } else { (i, j) };
        B * owner * self.width + B * other + self.offset - B * owner
    }

    #[inline(always)]
    fn strides(self) -> (usize, usize) {
        if self.transpose { (1, self.width) } else { (self.width, 1) }
    }

    /// Entry (a, c) of the diagonal block of node i.
    #[inline(always)]
    fn own(self, i: usize, a: usize, c: usize) -> f64 {
        let (down, across) = self.strides();
        self.entries[self.start(i, i) + a * down + c * across - self.shift]
    }

    /// Block (i, j), i ≠ j.
    #[inline(always)]
    fn block(self, i: usize, j: usize) -> [[f64; B]; B] {
        let (down, across) = self.strides();
        let entries = &self.entries[self.start(i, j) - self.shift..][..(B - 1) * self.width + B];
        std::array::from_fn(|a| std::array::from_fn(|c| entries[a * down + c * across]))
    }
}

/// `b_r ← (b_r − Σ t(r, c) b_c) · scale_r` for all columns, over the rows c before r in the sweep: nodes and their rows rising, or
/// all falling.
#[inline(always)]
fn sweep<const B: usize>(band: Band<B>, b: &mut [f64], columns: usize, t: Triangle<B>, rising: bool, scale: Option<&[f64]>) {
    let order: [usize; B] = std::array::from_fn(|k| if rising { k } else { B - 1 - k });
    for first in (0..columns).step_by(CHUNK) {
        let chunk = first..columns.min(first + CHUNK);
        for k in 0..band.n_blocks {
            let i = if rising { k } else { band.n_blocks - 1 - k };
            for j in if rising { band.before(i) } else { band.after(i) } {
                let block = t.block(i, j);
                let (own, near) = two_rows(b, B * columns, i, j);
                let near: [&[f64]; B] = std::array::from_fn(|c| &near[c * columns..][chunk.clone()]);
                for (own, factors) in own.chunks_exact_mut(columns).zip(block) {
                    subtract_rows(&mut own[chunk.clone()], near, factors);
                }
            }
            for (k, &a) in order.iter().enumerate() {
                for &done in &order[..k] {
                    let factor = t.own(i, a, done);
                    let (target, source) = two_rows(b, columns, B * i + a, B * i + done);
                    for (x, y) in target[chunk.clone()].iter_mut().zip(&source[chunk.clone()]) {
                        *x -= factor * y;
                    }
                }
                if let Some(factor) = scale.map(|inverse| inverse[B * i + a]) {
                    b[(B * i + a) * columns..][chunk.clone()].iter_mut().for_each(|x| *x *= factor);
                }
            }
        }
    }
}

/// Row r, to change, and row s ≠ r.
#[inline(always)]
pub(crate) fn two_rows(b: &mut [f64], columns: usize, r: usize, s: usize) -> (&mut [f64], &[f64]) {
    if r < s {
        let (head, tail) = b.split_at_mut(s * columns);
        (&mut head[r * columns..(r + 1) * columns], &tail[..columns])
    } else {
        let (head, tail) = b.split_at_mut(r * columns);
        (&mut tail[..columns], &head[s * columns..(s + 1) * columns])
    }
}
