//! Triangular solves inside a block band, shared by the band's LU and Cholesky.
//!
//! A strict triangle is stored by rows of `width = 3 half_width + 2` entries. Row r of node i of an *upper* triangle holds the
//! columns 3i + 1 … 3i + width; row r of node j of a *lower* one holds 3 (j − half_width) … 3j + 1. Entries that do not belong to
//! the strict triangle, or lie outside the matrix, are zero. Every row then has the same length, and its part outside the own
//! node is contiguous at a fixed offset.
//!
//! One right-hand side is vectorised along the band, many along the right-hand sides.

/// Sizes of a block band.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    pub n_blocks: usize,
    pub half_width: usize,
}

/// Right-hand sides taken at a time, so that the rows of a band's width stay in the first cache.
const CHUNK: usize = 256;

impl Band {
    pub fn dim(self) -> usize {
        3 * self.n_blocks
    }

    #[inline(always)]
    pub fn width(self) -> usize {
        3 * self.half_width + 2
    }

    /// Calls `run` with the half width as a constant where it is a common one, so that its inner loops unroll.
    #[inline(always)]
    pub fn specialised<R>(self, run: impl FnOnce(Band) -> R) -> R {
        match self.half_width {
            2 => run(Band { half_width: 2, ..self }),
            1 => run(Band { half_width: 1, ..self }),
            _ => run(self),
        }
    }

    /// `b ← U⁻¹ b`, U unit upper.
    pub fn solve_upper(self, upper: &[f64], b: &mut [f64], columns: usize) {
        self.specialised(|band| match columns {
            1 => upper_one(band, upper, b),
            _ => sweep(band, b, columns, Triangle::upper(band, upper, false), [2, 1, 0], |_| 1.0),
        });
    }

    /// `b ← U⁻ᵀ b`, U unit upper.
    pub fn solve_upper_transpose(self, upper: &[f64], b: &mut [f64], columns: usize) {
        self.specialised(|band| match columns {
            1 => upper_transpose_one(band, upper, b),
            _ => sweep(band, b, columns, Triangle::upper(band, upper, true), [0, 1, 2], |_| 1.0),
        });
    }

    /// `b ← L⁻¹ b`, L = strict lower triangle + diagonal, the reciprocals of which are `inverse`.
    pub fn solve_lower(self, lower: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        self.specialised(|band| match columns {
            1 => lower_one(band, lower, inverse, b),
            _ => sweep(band, b, columns, Triangle::lower(band, lower, false), [0, 1, 2], |r| inverse[r]),
        });
    }

    /// `b ← L⁻ᵀ b`, L as in [`Self::solve_lower`].
    pub fn solve_lower_transpose(self, lower: &[f64], inverse: &[f64], b: &mut [f64], columns: usize) {
        self.specialised(|band| match columns {
            1 => lower_transpose_one(band, lower, inverse, b),
            _ => sweep(band, b, columns, Triangle::lower(band, lower, true), [2, 1, 0], |r| inverse[r]),
        });
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

/// The three rows of node `i`, of `width` entries each.
#[inline(always)]
fn node_rows(triangle: &[f64], width: usize, i: usize) -> [&[f64]; 3] {
    let rows = &triangle[3 * i * width..(3 * i + 3) * width];
    [&rows[..width], &rows[width..2 * width], &rows[2 * width..]]
}

/// Three dot products with the same vector.
#[inline(always)]
fn dots(rows: [&[f64]; 3], x: &[f64]) -> [f64; 3] {
    let mut even = [0.0; 3];
    let mut odd = [0.0; 3];
    for a in 0..3 {
        let (pairs, x_pairs) = (rows[a][..x.len()].as_chunks::<2>(), x.as_chunks::<2>());
        for (r, x) in pairs.0.iter().zip(x_pairs.0) {
            even[a] += r[0] * x[0];
            odd[a] += r[1] * x[1];
        }
        for (r, x) in pairs.1.iter().zip(x_pairs.1) {
            even[a] += r * x;
        }
    }
    [even[0] + odd[0], even[1] + odd[1], even[2] + odd[2]]
}

/// `x −= y₀ row₀ + y₁ row₁ + y₂ row₂`.
#[inline(always)]
fn subtract_rows(x: &mut [f64], rows: [&[f64]; 3], y: [f64; 3]) {
    let n = x.len();
    for (((x, r0), r1), r2) in x.iter_mut().zip(&rows[0][..n]).zip(&rows[1][..n]).zip(&rows[2][..n]) {
        *x -= (y[0] * r0 + y[1] * r1) + y[2] * r2;
    }
}

#[inline(always)]
fn upper_one(band: Band, upper: &[f64], b: &mut [f64]) {
    let far = 3 * band.half_width;
    for i in (0..band.n_blocks).rev() {
        let rows = node_rows(upper, band.width(), i);
        let (head, tail) = b.split_at_mut(3 * i + 3);
        let s = dots(rows.map(|row| &row[2..]), if tail.len() >= far { &tail[..far] } else { tail });
        let x2 = head[3 * i + 2] - s[2];
        let x1 = (head[3 * i + 1] - s[1]) - rows[1][1] * x2;
        let x0 = ((head[3 * i] - s[0]) - rows[0][1] * x2) - rows[0][0] * x1;
        head[3 * i..].copy_from_slice(&[x0, x1, x2]);
    }
}

#[inline(always)]
fn upper_transpose_one(band: Band, upper: &[f64], b: &mut [f64]) {
    let far = 3 * band.half_width;
    for i in 0..band.n_blocks {
        let rows = node_rows(upper, band.width(), i);
        let (head, tail) = b[3 * i..].split_at_mut(3);
        let y0 = head[0];
        let y1 = head[1] - rows[0][0] * y0;
        let y2 = (head[2] - rows[0][1] * y0) - rows[1][1] * y1;
        head.copy_from_slice(&[y0, y1, y2]);
        let reach = far.min(tail.len());
        subtract_rows(if reach == far { &mut tail[..far] } else { tail }, rows.map(|row| &row[2..]), [y0, y1, y2]);
    }
}

#[inline(always)]
fn lower_one(band: Band, lower: &[f64], inverse: &[f64], b: &mut [f64]) {
    let far = 3 * band.half_width;
    for i in 0..band.n_blocks {
        let rows = node_rows(lower, band.width(), i);
        let (head, own) = b.split_at_mut(3 * i);
        let s = match head.len().checked_sub(far) {
            Some(start) => dots(rows, &head[start..start + far]),
            None => dots(rows.map(|row| &row[far - 3 * i..]), head),
        };
        let d = &inverse[3 * i..3 * i + 3];
        let x0 = (own[0] - s[0]) * d[0];
        let x1 = ((own[1] - s[1]) - rows[1][far] * x0) * d[1];
        let x2 = (((own[2] - s[2]) - rows[2][far] * x0) - rows[2][far + 1] * x1) * d[2];
        own[..3].copy_from_slice(&[x0, x1, x2]);
    }
}

#[inline(always)]
fn lower_transpose_one(band: Band, lower: &[f64], inverse: &[f64], b: &mut [f64]) {
    let far = 3 * band.half_width;
    for i in (0..band.n_blocks).rev() {
        let rows = node_rows(lower, band.width(), i);
        let (head, own) = b.split_at_mut(3 * i);
        let d = &inverse[3 * i..3 * i + 3];
        let x2 = own[2] * d[2];
        let x1 = (own[1] - rows[2][far + 1] * x2) * d[1];
        let x0 = ((own[0] - rows[2][far] * x2) - rows[1][far] * x1) * d[0];
        own[..3].copy_from_slice(&[x0, x1, x2]);
        match head.len().checked_sub(far) {
            Some(start) => subtract_rows(&mut head[start..start + far], rows, [x0, x1, x2]),
            None => subtract_rows(head, rows.map(|row| &row[far - 3 * i..]), [x0, x1, x2]),
        }
    }
}

/// A stored triangle T, or its transpose, seen by blocks.
#[derive(Clone, Copy)]
struct Triangle<'a> {
    entries: &'a [f64],
    width: usize,
    /// Entry (r, c) of node i is at r · width + c − 3i + offset − shift.
    offset: usize,
    shift: usize,
    transpose: bool,
}

impl<'a> Triangle<'a> {
    #[inline(always)]
    fn upper(band: Band, entries: &'a [f64], transpose: bool) -> Self {
        Self { entries, width: band.width(), offset: 0, shift: 1, transpose }
    }

    #[inline(always)]
    fn lower(band: Band, entries: &'a [f64], transpose: bool) -> Self {
        Self { entries, width: band.width(), offset: 3 * band.half_width, shift: 0, transpose }
    }

    /// Where block (i, j) starts, plus the shift, and the distances between its rows and between its columns.
    #[inline(always)]
    fn start(self, i: usize, j: usize) -> usize {
        let (owner, other) = if self.transpose { (j, i) } else { (i, j) };
        3 * owner * self.width + 3 * other + self.offset - 3 * owner
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
    fn block(self, i: usize, j: usize) -> [[f64; 3]; 3] {
        let (down, across) = self.strides();
        let entries = &self.entries[self.start(i, j) - self.shift..][..2 * self.width + 3];
        std::array::from_fn(|a| std::array::from_fn(|c| entries[a * down + c * across]))
    }
}

/// `b_r ← (b_r − Σ t(r, c) b_c) · scale(r)` for all columns, over the rows c before r in the sweep: nodes rising and the node's
/// rows in `order` 0, 1, 2, or all falling.
#[inline(always)]
fn sweep(band: Band, b: &mut [f64], columns: usize, t: Triangle, order: [usize; 3], scale: impl Fn(usize) -> f64) {
    let rising = order[0] == 0;
    for first in (0..columns).step_by(CHUNK) {
        let chunk = first..columns.min(first + CHUNK);
        for k in 0..band.n_blocks {
            let i = if rising { k } else { band.n_blocks - 1 - k };
            for j in if rising { band.before(i) } else { band.after(i) } {
                let block = t.block(i, j);
                let (own, near) = two_nodes(b, columns, i, j);
                let near = [0, 1, 2].map(|c| &near[c * columns..][chunk.clone()]);
                for (own, factors) in own.chunks_exact_mut(columns).zip(block) {
                    subtract_rows(&mut own[chunk.clone()], near, factors);
                }
            }
            for (k, &a) in order.iter().enumerate() {
                for &done in &order[..k] {
                    let factor = t.own(i, a, done);
                    let (target, source) = two_rows(b, columns, 3 * i + a, 3 * i + done);
                    for (x, y) in target[chunk.clone()].iter_mut().zip(&source[chunk.clone()]) {
                        *x -= factor * y;
                    }
                }
                let factor = scale(3 * i + a);
                if factor != 1.0 {
                    b[(3 * i + a) * columns..][chunk.clone()].iter_mut().for_each(|x| *x *= factor);
                }
            }
        }
    }
}

/// The three rows of node i, to change, and those of node j ≠ i.
#[inline(always)]
fn two_nodes(b: &mut [f64], columns: usize, i: usize, j: usize) -> (&mut [f64], &[f64]) {
    two_rows(b, 3 * columns, i, j)
}

/// Row r, to change, and row s ≠ r.
#[inline(always)]
pub(super) fn two_rows(b: &mut [f64], columns: usize, r: usize, s: usize) -> (&mut [f64], &[f64]) {
    if r < s {
        let (head, tail) = b.split_at_mut(s * columns);
        (&mut head[r * columns..(r + 1) * columns], &tail[..columns])
    } else {
        let (head, tail) = b.split_at_mut(r * columns);
        (&mut tail[..columns], &head[s * columns..(s + 1) * columns])
    }
}
