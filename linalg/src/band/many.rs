//! Many right-hand sides at a time behind a band's LU.
//!
//! A few vectors' width of columns is brought into storage order, swept through both triangles while it lies in the first cache, and
//! brought back. Sums over the rows of other nodes stay in registers, where every number that is loaded serves all rows of a node.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use crate::NodeLayout;
use crate::band::sweep::Band;
use pulp::{Arch, Simd, WithSimd};
use std::cell::RefCell;

/// Vectors of columns taken at a time: B rows of them, and one more, fit the registers.
const TAKEN: usize = 2;

thread_local! {
    /// Columns in storage order; one a thread, so that solves neither allocate nor share.
    static COLUMNS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// L with the reciprocals of its diagonal, and U, in the storage of [`crate::band::sweep`].
#[derive(Clone, Copy)]
pub(crate) struct Triangles<'a, const B: usize> {
    pub band: Band<B>,
    pub lower: &'a [f64],
    pub inverse: &'a [f64],
    pub upper: &'a [f64],
}

/// Right-hand sides, row-major in the system's order; those of `units` are taken as unit columns and not read.
struct Sides<'a> {
    layout: &'a NodeLayout,
    b: &'a mut [f64],
    columns: usize,
    units: bool,
    transpose: bool,
}

impl<const B: usize> Triangles<'_, B> {
    /// `B ← U⁻¹ L⁻¹ B`, or `B ← L⁻ᵀ U⁻ᵀ B`.
    pub fn solve(self, layout: &NodeLayout, b: &mut [f64], columns: usize, transpose: bool) {
        self.run(Sides { layout, b, columns, units: false, transpose });
    }

    /// Writes L⁻ᵀ U⁻ᵀ into the first columns of `out`, and zero into the others.
    pub fn transposed_inverse(self, layout: &NodeLayout, out: &mut [f64], columns: usize) {
        self.run(Sides { layout, b: out, columns, units: true, transpose: true });
    }

    fn run(self, sides: Sides) {
        struct Run<'a, const B: usize>(Triangles<'a, B>, Sides<'a>, &'a mut Vec<f64>);
        impl<const B: usize> WithSimd for Run<'_, B> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(triangles, sides, chunk) = self;
                let band = triangles.band;
                // not by a closure, which would be compiled without the wide vectors
                match band.half_width {
                    2 => Triangles { band: Band { half_width: 2, ..band }, ..triangles }.sweep(simd, sides, chunk),
                    1 => Triangles { band: Band { half_width: 1, ..band }, ..triangles }.sweep(simd, sides, chunk),
                    _ => triangles.sweep(simd, sides, chunk),
                }
            }
        }
        COLUMNS.with_borrow_mut(|chunk| Arch::new().dispatch(Run(self, sides, chunk)));
    }

    #[inline(always)]
    fn sweep<S: Simd>(self, simd: S, sides: Sides, chunk: &mut Vec<f64>) {
        let width = TAKEN * S::F64_LANES;
        chunk.clear();
        chunk.resize(self.band.dim() * width, 0.0);
        let Sides { layout, b, columns, units, transpose } = sides;
        for first in (0..columns).step_by(width) {
            let taken = width.min(columns - first);
            let mut start = 0;
            chunk.fill(0.0);
            if units {
                start = self.band.n_blocks;
                for r in first..layout.dim().min(first + taken) {
                    let at = layout.storage(r);
                    chunk[at * width + r - first] = 1.0;
                    start = start.min(at / B);
                }
            } else {
                for (r, row) in b.chunks_exact(columns).enumerate() {
                    let to = &mut chunk[layout.storage(r) * width..][..width];
                    to[..taken].copy_from_slice(&row[first..first + taken]);
                }
            }
            let x = S::as_mut_simd_f64s(chunk).0.as_chunks_mut::<TAKEN>().0;
            if transpose {
                self.upper_transpose(simd, x, start);
                self.lower_transpose(simd, x);
            } else {
                self.lower(simd, x, start);
                self.upper(simd, x);
            }
            for (r, row) in b.chunks_exact_mut(columns).enumerate() {
                row[first..first + taken].copy_from_slice(&chunk[layout.storage(r) * width..][..taken]);
            }
        }
    }

    /// `x ← L⁻¹ x`; nodes before `start` have nothing but zeros.
    #[inline(always)]
    fn lower<S: Simd>(self, simd: S, x: &mut [[S::f64s; TAKEN]], start: usize) {
        let (width, half) = (self.band.width(), B * self.band.half_width);
        for i in start..self.band.n_blocks {
            let rows = &self.lower[B * i * width..B * (i + 1) * width];
            let from = i.saturating_sub(self.band.half_width).max(start);
            let (before, own) = x.split_at_mut(B * i);
            let mut y = Self::reduced(simd, own, &before[B * from..], rows, width, half - B * (i - from));
            for a in 0..B {
                for c in 0..a {
                    let factor = simd.splat_f64s(rows[a * width + half + c]);
                    for v in 0..TAKEN {
                        y[a][v] = simd.negate_mul_add_e_f64s(factor, y[c][v], y[a][v]);
                    }
                }
                let inverse = simd.splat_f64s(self.inverse[B * i + a]);
                for v in 0..TAKEN {
                    y[a][v] = simd.mul_f64s(inverse, y[a][v]);
                }
                own[a] = y[a];
            }
        }
    }

    /// `x ← U⁻¹ x`.
    #[inline(always)]
    fn upper<S: Simd>(self, simd: S, x: &mut [[S::f64s; TAKEN]]) {
        let width = self.band.width();
        for i in (0..self.band.n_blocks).rev() {
            let rows = &self.upper[B * i * width..B * (i + 1) * width];
            let end = self.band.n_blocks.min(i + 1 + self.band.half_width);
            let (own, after) = x[B * i..B * end].split_at_mut(B);
            let mut y = Self::reduced(simd, own, after, rows, width, B - 1);
            for a in (0..B).rev() {
                for c in a + 1..B {
                    let factor = simd.splat_f64s(rows[a * width + c - 1]);
                    for v in 0..TAKEN {
                        y[a][v] = simd.negate_mul_add_e_f64s(factor, y[c][v], y[a][v]);
                    }
                }
                own[a] = y[a];
            }
        }
    }

    /// `x ← U⁻ᵀ x`; nodes before `start` have nothing but zeros.
    #[inline(always)]
    fn upper_transpose<S: Simd>(self, simd: S, x: &mut [[S::f64s; TAKEN]], start: usize) {
        let width = self.band.width();
        for i in start..self.band.n_blocks {
            let from = i.saturating_sub(self.band.half_width).max(start);
            let (before, own) = x.split_at_mut(B * i);
            let mut y = Self::own(own);
            for j in from..i {
                for c in 0..B {
                    let factors = &self.upper[(B * j + c) * width + B * (i - j) - 1..][..B];
                    Self::reduce(simd, &mut y, factors, &before[B * j + c]);
                }
            }
            for a in 0..B {
                for c in 0..a {
                    let factor = simd.splat_f64s(self.upper[(B * i + c) * width + a - 1]);
                    for v in 0..TAKEN {
                        y[a][v] = simd.negate_mul_add_e_f64s(factor, y[c][v], y[a][v]);
                    }
                }
                own[a] = y[a];
            }
        }
    }

    /// `x ← L⁻ᵀ x`.
    #[inline(always)]
    fn lower_transpose<S: Simd>(self, simd: S, x: &mut [[S::f64s; TAKEN]]) {
        let (width, half) = (self.band.width(), B * self.band.half_width);
        for i in (0..self.band.n_blocks).rev() {
            let end = self.band.n_blocks.min(i + 1 + self.band.half_width);
            let (head, after) = x.split_at_mut(B * i + B);
            let own = &mut head[B * i..];
            let mut y = Self::own(own);
            for j in i + 1..end {
                for c in 0..B {
                    let factors = &self.lower[(B * j + c) * width + half - B * (j - i)..][..B];
                    Self::reduce(simd, &mut y, factors, &after[B * (j - i - 1) + c]);
                }
            }
            for a in (0..B).rev() {
                for c in a + 1..B {
                    let factor = simd.splat_f64s(self.lower[(B * i + c) * width + half + a]);
                    for v in 0..TAKEN {
                        y[a][v] = simd.negate_mul_add_e_f64s(factor, y[c][v], y[a][v]);
                    }
                }
                let inverse = simd.splat_f64s(self.inverse[B * i + a]);
                for v in 0..TAKEN {
                    y[a][v] = simd.mul_f64s(inverse, y[a][v]);
                }
                own[a] = y[a];
            }
        }
    }

    /// The rows of a node.
    #[inline(always)]
    fn own<V: Copy>(x: &[[V; TAKEN]]) -> [[V; TAKEN]; B] {
        let mut y = [x[0]; B];
        y.copy_from_slice(&x[..B]);
        y
    }

    /// Subtracts the contribution of one row of another node.
    #[inline(always)]
    fn reduce<S: Simd>(simd: S, y: &mut [[S::f64s; TAKEN]; B], factors: &[f64], other: &[S::f64s; TAKEN]) {
        for a in 0..B {
            let factor = simd.splat_f64s(factors[a]);
            for v in 0..TAKEN {
                y[a][v] = simd.negate_mul_add_e_f64s(factor, other[v], y[a][v]);
            }
        }
    }

    /// The rows of a node less the contributions of `others`, whose factors are in `rows` from column `first` on.
    #[inline(always)]
    fn reduced<S: Simd>(
        simd: S,
        own: &[[S::f64s; TAKEN]],
        others: &[[S::f64s; TAKEN]],
        rows: &[f64],
        width: usize,
        first: usize,
    ) -> [[S::f64s; TAKEN]; B] {
        let mut y = [[simd.splat_f64s(0.0); TAKEN]; B];
        y.copy_from_slice(&own[..B]);
        let n = others.len();
        let mut factors = [&[][..]; B];
        for a in 0..B {
            factors[a] = &rows[a * width + first..][..n];
        }
        for k in 0..n {
            for a in 0..B {
                let factor = simd.splat_f64s(factors[a][k]);
                for v in 0..TAKEN {
                    y[a][v] = simd.negate_mul_add_e_f64s(factor, others[k][v], y[a][v]);
                }
            }
        }
        y
    }
}
