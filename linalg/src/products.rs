//! Products of a nodal matrix with one vector and with many.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use crate::layout::Pattern;
use crate::matrix::NodeMatrix;
use pliant_math::simd::rows::{joined, subtract_four, support};
use pulp::{Arch, Simd, WithSimd};

impl NodeMatrix {
    /// The part of a plain band's row that lies inside the matrix, and the column of its first entry.
    #[inline]
    fn span(&self, r: usize) -> Option<(&[f64], usize)> {
        let Pattern::Band(_) = self.layout().pattern else { return None };
        if !self.layout().is_plain() {
            return None;
        }
        let (first, range) = self.stored_row(r);
        let (skip, column) = (3 * (-first).max(0) as usize, 3 * first.max(0) as usize);
        let end = range.len().min((self.dim() as isize - 3 * first) as usize);
        Some((&self.data()[range][skip..end], column))
    }

    /// Calls `visit(column, entry)` for the entries of row `r` of the system.
    #[inline(always)]
    fn for_system_row(&self, r: usize, mut visit: impl FnMut(usize, f64)) {
        self.for_row(self.layout().storage(r), |c, place| {
            if let Some(column) = self.layout().system(c) {
                visit(column, self.data()[place]);
            }
        });
    }

    /// Calls `visit(row, column, place, down)` for every block of a sparse matrix of nodes alone, with the system's row and column that it begins
    /// in and where its rows are; false if this is another one.
    #[inline(always)]
    fn for_blocks(&self, mut visit: impl FnMut(usize, usize, usize, usize)) -> bool {
        let layout = self.layout();
        let (Pattern::Sparse { starts, columns, .. }, 3) = (&layout.pattern, layout.block()) else { return false };
        for i in 0..layout.n_nodes() {
            let (Some(row), listed) = (layout.system(3 * i), &columns[starts[i]..starts[i + 1]]) else { continue };
            for (k, column) in listed.iter().enumerate() {
                if let Some(column) = layout.system(3 * column) {
                    visit(row, column, 9 * starts[i] + 3 * k, 3 * listed.len());
                }
            }
        }
        true
    }

    /// `y += scale · A x`.
    pub fn add_mul(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let blocks = self.for_blocks(|row, column, place, down| {
            let (x, y) = (&x[column..column + 3], &mut y[row..row + 3]);
            for (a, y) in y.iter_mut().enumerate() {
                let entries = &self.data()[place + a * down..][..3];
                *y += scale * (entries[0] * x[0] + entries[1] * x[1] + entries[2] * x[2]);
            }
        });
        if blocks {
            return;
        }
        for (r, y_r) in y.iter_mut().enumerate() {
            *y_r += scale
                * match self.span(r) {
                    Some((row, column)) => row.iter().zip(&x[column..column + row.len()]).map(|(a, b)| a * b).sum(),
                    None => {
                        let mut sum = 0.0;
                        self.for_system_row(r, |c, a| sum += a * x[c]);
                        sum
                    }
                };
        }
    }

    /// Σ_c |a_rc| y_c of row `r`.
    pub fn row_magnitude(&self, r: usize, y: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.for_system_row(r, |c, a| sum += a.abs() * y[c]);
        sum
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let blocks = self.for_blocks(|row, column, place, down| {
            let (x, y) = (&x[row..row + 3], &mut y[column..column + 3]);
            for (a, x) in x.iter().enumerate() {
                let entries = &self.data()[place + a * down..][..3];
                y.iter_mut().zip(entries).for_each(|(y, entry)| *y += scale * x * entry);
            }
        });
        if blocks {
            return;
        }
        for (r, x_r) in x.iter().enumerate() {
            let factor = scale * x_r;
            match self.span(r) {
                Some((row, column)) => {
                    y[column..column + row.len()].iter_mut().zip(row).for_each(|(y_c, a)| *y_c += factor * a);
                }
                None => self.for_system_row(r, |c, a| y[c] += factor * a),
            }
        }
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`: row r of X is `x[r * columns..(r + 1) * columns]`. Rows of X that are
    /// zero but for a few columns (the unit columns of a Jacobian) cost only those.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        struct Run<'a>(&'a NodeMatrix, f64, &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.add_mul_kernel(simd, self.1, self.2, self.3, self.4);
            }
        }
        match columns {
            0 => {}
            1 => y.iter_mut().enumerate().take(self.dim()).for_each(|(r, y)| {
                self.for_system_row(r, |c, a| *y += scale * a * x[c]);
            }),
            _ => Arch::new().dispatch(Run(self, scale, x, y, columns)),
        }
    }

    #[inline(always)]
    fn add_mul_kernel<S: Simd>(&self, simd: S, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        let (layout, b) = (self.layout(), self.layout().block());
        let row = |r: usize| &x[r * columns..(r + 1) * columns];
        // of a node's three rows of X, slot by slot
        let mut supports = Vec::with_capacity(layout.n_nodes());
        for slot in 0..layout.n_nodes() {
            let c = layout.system(b * slot).unwrap_or(0);
            supports.push(joined(&joined(&support(row(c)), &support(row(c + 1))), &support(row(c + 2))));
        }
        for (r, y_row) in y.chunks_exact_mut(columns).enumerate().take(self.dim()) {
            let at = layout.storage(r);
            let (_, range) = self.stored_row(at);
            let entries = &self.data()[range];
            // blocks of the row: in a band those that stick out of the matrix are zero
            let (first, listed, blocks) = match &layout.pattern {
                Pattern::Band(half_width) => ((at / b) as isize - *half_width as isize, None, 2 * half_width + 1),
                Pattern::Sparse { starts, columns, .. } => {
                    let row = &columns[starts[at / b]..starts[at / b + 1]];
                    (0, Some(row), row.len())
                }
            };
            for k in 0..blocks {
                let slot = match listed {
                    Some(row) => row[k],
                    None if first + (k as isize) < 0 || first + k as isize >= layout.n_nodes() as isize => continue,
                    None => (first + k as isize) as usize,
                };
                let entries = &entries[b * k..b * (k + 1)];
                let (factors, range) = ([scale * entries[0], scale * entries[1], scale * entries[2]], supports[slot].clone());
                if let (true, Some(c)) = (factors != [0.0; 3] && !range.is_empty(), layout.system(b * slot)) {
                    let rows = [&row(c)[range.clone()], &row(c + 1)[range.clone()], &row(c + 2)[range.clone()]];
                    add_rows(simd, factors, rows, &mut y_row[range]);
                }
                if b == 4
                    && entries[3] != 0.0
                    && let Some(c) = layout.system(b * slot + 3)
                {
                    let range = support(row(c));
                    add_rows(simd, [scale * entries[3]], [&row(c)[range.clone()]], &mut y_row[range]);
                }
            }
        }
    }

    /// `Y += scale · Aᵀ X` for row-major `X`, `Y` of `dim × columns`.
    pub fn add_mul_transpose_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        struct Run<'a>(&'a NodeMatrix, f64, &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.add_mul_transpose_kernel(simd, self.1, self.2, self.3, self.4);
            }
        }
        if columns > 0 {
            Arch::new().dispatch(Run(self, scale, x, y, columns));
        }
    }

    /// A slot's rows at a time. (Plain loops: a closure would be compiled without the wide vectors.)
    #[inline(always)]
    fn add_mul_transpose_kernel<S: Simd>(&self, simd: S, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        let b = self.layout().block();
        for i in 0..self.layout().n_nodes() {
            // rows that are not there count for nothing
            let mut rows = [&x[..columns]; 4];
            let mut starts = [None; 4];
            for a in 0..b {
                if let Some(r) = self.layout().system(b * i + a) {
                    rows[a] = &x[r * columns..(r + 1) * columns];
                    starts[a] = Some(self.stored_row(b * i + a).1.start);
                }
            }
            let (first, listed, blocks) = match &self.layout().pattern {
                Pattern::Band(half_width) => (i as isize - *half_width as isize, None, 2 * half_width + 1),
                Pattern::Sparse { starts, columns, .. } => {
                    let row = &columns[starts[i]..starts[i + 1]];
                    (0, Some(row), row.len())
                }
            };
            for k in 0..blocks {
                let slot = match listed {
                    Some(row) => row[k],
                    None if first + (k as isize) < 0 || first + k as isize >= self.layout().n_nodes() as isize => continue,
                    None => (first + k as isize) as usize,
                };
                for c in 0..b {
                    let Some(column) = self.layout().system(b * slot + c) else { continue };
                    let mut factors = [0.0; 4];
                    for a in 0..b {
                        if let Some(start) = starts[a] {
                            factors[a] = -scale * self.data()[start + b * k + c];
                        }
                    }
                    if factors != [0.0; 4] {
                        subtract_four(simd, &mut y[column * columns..(column + 1) * columns], factors, rows);
                    }
                }
            }
        }
    }

    /// `out = Aᵀ X` for row-major `X` of `dim × columns` without zeros to speak of.
    pub fn transpose_times(&self, x: &[f64], out: &mut Vec<f64>, columns: usize) {
        struct Run<'a>(&'a NodeMatrix, &'a [Vec<[usize; 3]>], &'a [f64], &'a mut [f64], usize);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(matrix, blocks, x, out, columns) = self;
                let width = WIDE * S::F64_LANES;
                // a strip of X at a time, whose rows slots share with their neighbours; the last one overlaps the one before
                for start in (0..columns).step_by(width) {
                    let strip = start.min(columns.saturating_sub(width))..columns.min(start + width);
                    for (j, blocks) in blocks.iter().enumerate() {
                        let product = if columns < width {
                            transposed_slot::<S, false>(simd, matrix.data(), blocks, x, strip.clone(), columns)
                        } else {
                            transposed_slot::<S, true>(simd, matrix.data(), blocks, x, strip.clone(), columns)
                        };
                        for (a, sums) in product.iter().enumerate() {
                            let row = matrix.layout().system(3 * j + a).unwrap_or(0);
                            let (whole, rest) = S::as_mut_simd_f64s(&mut out[row * columns..][strip.clone()]);
                            for (to, sum) in whole.iter_mut().zip(sums) {
                                *to = *sum;
                            }
                            if !rest.is_empty() {
                                simd.partial_store_f64s(rest, sums[whole.len()]);
                            }
                        }
                    }
                }
            }
        }
        out.resize(self.dim() * columns, 0.0);
        if self.layout().block() != 3 {
            out.fill(0.0);
            for (r, x) in x.chunks_exact(columns.max(1)).enumerate() {
                self.for_system_row(r, |c, a| {
                    out[c * columns..(c + 1) * columns].iter_mut().zip(x).for_each(|(out, x)| *out += a * x);
                });
            }
            return;
        }
        // by columns of slots: which slot's rows of X (three, one after the other), and where the block is
        let mut blocks = vec![Vec::new(); self.layout().n_nodes()];
        for i in 0..blocks.len() {
            for j in self.layout().row(i) {
                if let (Some((start, down)), Some(row)) = (self.layout().place(i, j), self.layout().system(3 * i)) {
                    blocks[j].push([row, start, down]);
                }
            }
        }
        Arch::new().dispatch(Run(self, &blocks, x, out, columns));
    }
}

impl NodeMatrix {
    /// The columns of the blocks on the diagonal of X A, for row-major X of `dim` rows and columns: three entries of a node's column, one
    /// of a twist's (and zeros).
    pub fn diagonal_blocks_of_product(&self, x: &[f64], out: &mut Vec<Sums>) {
        let (n, nodes) = (self.dim(), self.layout().n_nodes());
        out.clear();
        out.resize(n, Sums::default());
        (0..nodes).for_each(|node| self.add_to_diagonal_blocks::<3>(3 * node, x, out));
        (3 * nodes..n).for_each(|twist| self.add_to_diagonal_blocks::<1>(twist, x, out));
    }

    /// What `R` rows of A from `r` on, of a node or a twist, contribute.
    fn add_to_diagonal_blocks<const R: usize>(&self, r: usize, x: &[f64], out: &mut [Sums]) {
        let (layout, b, n) = (self.layout(), self.layout().block(), self.dim());
        let at = layout.storage(r);
        let before = (-self.stored_row(at).0).max(0) as usize;
        let rows: [&[f64]; R] = std::array::from_fn(|a| &self.row(at + a)[b * before..]);
        let x = |row: usize| x[row * n + r..].first_chunk::<R>();
        for (k, slot) in layout.row(at / b).enumerate() {
            let Some(c) = layout.system(b * slot) else { continue };
            let (Some(x0), Some(x1), Some(x2), Some(sums)) = (x(c), x(c + 1), x(c + 2), out[c..].first_chunk_mut::<3>()) else {
                continue;
            };
            for a in 0..R {
                let Some(entries) = rows[a][b * k..].first_chunk::<3>() else { continue };
                for column in 0..3 {
                    let entry = entries[column];
                    sums[column].add([x0[a] * entry, x1[a] * entry, x2[a] * entry, 0.0]);
                }
            }
            if b == 4
                && let Some(c) = layout.system(b * slot + 3)
                && let Some(x) = x(c)
            {
                (0..R).for_each(|a| out[c].add([x[a] * rows[a][b * k + 3], 0.0, 0.0, 0.0]));
            }
        }
    }
}

/// Sums, and those of their terms' sizes: rounding is relative to those. Four, though a node has three: vectors have two or four.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σ x.
    pub value: [f64; 4],
    /// Σ |x|.
    pub size: [f64; 4],
}

impl Sums {
    /// Adds a term to each.
    #[inline]
    pub fn add(&mut self, x: [f64; 4]) {
        for r in 0..4 {
            self.value[r] += x[r];
            self.size[r] += x[r].abs();
        }
    }
}

/// Vectors of a row that are worked on together.
const WIDE: usize = 4;

/// Some columns of the three rows of Aᵀ X that belong to a slot, whose column of A has these blocks; `FULL` if they are `WIDE` vectors.
#[inline(always)]
fn transposed_slot<S: Simd, const FULL: bool>(
    simd: S,
    data: &[f64],
    blocks: &[[usize; 3]],
    x: &[f64],
    strip: std::ops::Range<usize>,
    columns: usize,
) -> [[S::f64s; WIDE]; 3] {
    let zero = simd.splat_f64s(0.0);
    let mut sums = [[zero; WIDE]; 3];
    for &[row, start, down] in blocks {
        for a in 0..3 {
            let Some(factors) = data[start + a * down..].first_chunk::<3>() else { continue };
            let (whole, rest) = S::as_simd_f64s(&x[(row + a) * columns..][strip.clone()]);
            let wide: [S::f64s; WIDE] = match whole.first_chunk() {
                Some(whole) => *whole,
                None if FULL => continue,
                None => std::array::from_fn(|k| match whole.get(k) {
                    Some(vector) => *vector,
                    None if k == whole.len() => simd.partial_load_f64s(rest),
                    None => zero,
                }),
            };
            for r in 0..3 {
                let factor = simd.splat_f64s(factors[r]);
                for k in 0..WIDE {
                    sums[r][k] = simd.mul_add_e_f64s(factor, wide[k], sums[r][k]);
                }
            }
        }
    }
    sums
}

/// `y += Σ_i a_i x_i` for rows that are equally long.
#[inline(always)]
fn add_rows<S: Simd, const N: usize>(simd: S, a: [f64; N], x: [&[f64]; N], y: &mut [f64]) {
    let (mut whole, mut tails, mut factors) = ([S::as_simd_f64s(x[0]).0; N], [x[0]; N], [simd.splat_f64s(0.0); N]);
    let (y, rest) = S::as_mut_simd_f64s(y);
    let n = y.len();
    for i in 0..N {
        let (x, tail) = S::as_simd_f64s(x[i]);
        (whole[i], tails[i], factors[i]) = (&x[..n], tail, simd.splat_f64s(a[i]));
    }
    for k in 0..n {
        let mut sum = y[k];
        for i in 0..N {
            sum = simd.mul_add_e_f64s(factors[i], whole[i][k], sum);
        }
        y[k] = sum;
    }
    for (k, y) in rest.iter_mut().enumerate() {
        for i in 0..N {
            *y += a[i] * tails[i][k];
        }
    }
}
