//! The whole inverse of a matrix from its fronts.
//!
//! With A = Uᵀ D⁻¹ U, D the diagonal of U, the inverse X obeys U X = D U⁻ᵀ, of which the right side is one on the diagonal and zero behind
//! it. So a row follows from the diagonal on from later rows, and before it by symmetry:
//! ```text
//! X_pj = (δ_pj − Σ_{c > p} U_pc X_cj)/U_pp,  j ≥ p
//! ```
//! That takes no forward sweep and half of the backward one. (Takahashi, Fagan and Chin 1973 find the entries in the pattern of U that way;
//! here all are wanted.)
//!
//! With A = L U, L unit lower, U X = L⁻¹ gives the rows of X from the diagonal on likewise, and X L = U⁻¹, which is zero below the diagonal,
//! the columns below it:
//! ```text
//! X_pj = (δ_pj − Σ_{c > p} U_pc X_cj)/U_pp,  j ≥ p        X_jp = −Σ_{c > p} X_jc L_cp,  j > p
//! ```

use crate::multifrontal::solve::Dense;
use crate::multifrontal::symbolic::Front;
use crate::multifrontal::{Numeric, Symbolic};
use crate::panel::{PANEL, reduce_row};
use pulp::{Arch, Simd, WithSimd};

/// Pivots whose rows are found together.
const GROUP: usize = 12;

impl Numeric {
    /// A⁻¹ in the order of elimination, row-major; the factor must be symmetric.
    pub fn invert(&self, fronts: &Symbolic, x: &mut [f64]) {
        struct Run<'a>(&'a Numeric, &'a Symbolic, Inverse<'a>);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(factor, fronts, mut inverse) = self;
                let mut panel = vec![[0.0; PANEL]; fronts.block * fronts.widest];
                for front in fronts.fronts.iter().rev() {
                    let dense = factor.of(front, fronts.block);
                    let groups = dense.k.div_ceil(GROUP).max(1);
                    let size = dense.k.div_ceil(groups);
                    let mut last = dense.k;
                    while last > 0 {
                        let part = Part { front, dense, block: fronts.block, pivots: last.saturating_sub(size)..last };
                        last = part.pivots.start;
                        inverse.rows_beyond(simd, &part, &mut panel);
                        inverse.own_rows(simd, &part, &mut panel);
                    }
                }
            }
        }
        let dim = self.inverse.len();
        Arch::new().dispatch(Run(self, fronts, Inverse { x, dim }));
    }
}

impl Numeric {
    /// A⁻¹ and A⁻ᵀ in the order of elimination, row-major; the factor must be L U.
    pub fn invert_general(&self, fronts: &Symbolic, x: &mut [f64], transposed: &mut [f64]) {
        struct Run<'a>(&'a Numeric, &'a Symbolic, [Inverse<'a>; 2]);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(factor, fronts, mut both) = self;
                let mut panels = [(); 2].map(|()| vec![[0.0; PANEL]; fronts.block * fronts.widest]);
                let mut columns = [(); GROUP].map(|()| Vec::new());
                for front in fronts.fronts.iter().rev() {
                    let dense = factor.of(front, fronts.block);
                    let groups = dense.k.div_ceil(GROUP).max(1);
                    let size = dense.k.div_ceil(groups);
                    let mut last = dense.k;
                    while last > 0 {
                        let part = Part { front, dense, block: fronts.block, pivots: last.saturating_sub(size)..last };
                        last = part.pivots.start;
                        for (p, column) in part.pivots.clone().zip(&mut columns) {
                            column.clear();
                            dense.extend_by_lower(p, column);
                        }
                        let [x, transposed] = &mut both;
                        let upper = |p: usize| (&dense.upper(p)[p + 1..], dense.inverse[p]);
                        let lower = |p: usize| (columns[p - part.pivots.start].as_slice(), 1.0);
                        rows_beyond(simd, &part, x, transposed, &mut panels[0], upper);
                        rows_beyond(simd, &part, transposed, x, &mut panels[0], lower);
                        own_square(simd, &part, [x, transposed], &mut panels, upper, lower);
                    }
                }
            }
        }
        let dim = self.inverse.len();
        Arch::new().dispatch(Run(self, fronts, [Inverse { x, dim }, Inverse { x: transposed, dim }]));
    }
}

/// Entries of the pivots' rows of `x` in the columns behind them all, from rows of U (or columns of L) over their pivots, and the same in
/// the columns of its transpose.
#[inline(always)]
fn rows_beyond<'f, S: Simd>(
    simd: S,
    part: &Part,
    x: &mut Inverse,
    transposed: &mut Inverse,
    panel: &mut [[f64; PANEL]],
    factors: impl Fn(usize) -> (&'f [f64], f64),
) {
    let (first, count, dim) = (part.row(part.pivots.start), part.pivots.len(), x.dim);
    for start in (first + count..dim).step_by(PANEL) {
        let used = (dim - start).min(PANEL);
        x.gather(part, panel, start, used);
        for p in part.pivots.clone().rev() {
            let (own, after) = panel[..part.dense.f - part.pivots.start].split_at_mut(p - part.pivots.start + 1);
            let (row, scale) = factors(p);
            reduce_row(simd, &mut own[p - part.pivots.start], row, after, scale, used);
        }
        for (p, row) in panel[..count].iter().enumerate() {
            x.x[(first + p) * dim + start..][..used].copy_from_slice(&row[..used]);
        }
        for (j, to) in transposed.x[start * dim..].chunks_exact_mut(dim).take(used).enumerate() {
            for (to, row) in to[first..first + count].iter_mut().zip(&panel[..count]) {
                *to = row[j];
            }
        }
    }
}

/// The square of the pivots' rows and columns, of A⁻¹ and its transpose.
#[inline(always)]
fn own_square<'f, S: Simd>(
    simd: S,
    part: &Part,
    both: [&mut Inverse; 2],
    panels: &mut [Vec<[f64; PANEL]>; 2],
    upper: impl Fn(usize) -> (&'f [f64], f64),
    lower: impl Fn(usize) -> (&'f [f64], f64),
) {
    let (first, count, size) = (part.row(part.pivots.start), part.pivots.len(), part.dense.f - part.pivots.start);
    let [x, transposed] = panels;
    both[0].gather(part, x, first, count);
    both[1].gather(part, transposed, first, count);
    for p in part.pivots.clone().rev() {
        let at = p - part.pivots.start;
        let ((row, scale), (column, unit)) = (upper(p), lower(p));
        for (panel, factors, scale) in [(&mut *x, row, scale), (&mut *transposed, column, unit)] {
            let (own, after) = panel[..size].split_at_mut(at + 1);
            reduce_row(simd, &mut own[at], factors, after, scale, count);
        }
        // later rows have their entries before the diagonal from here
        for j in at + 1..count {
            (x[j][at], transposed[j][at]) = (transposed[at][j], x[at][j]);
        }
        let sum: f64 = row.iter().zip(&x[at + 1..]).map(|(u, x)| u * x[at]).sum();
        x[at][at] = (1.0 - sum) * scale;
        transposed[at][at] = x[at][at];
    }
    for (to, panel) in both.into_iter().zip([x, transposed]) {
        for (p, row) in panel[..count].iter().enumerate() {
            to.x[(first + p) * to.dim + first..][..count].copy_from_slice(&row[..count]);
        }
    }
}

/// Some pivots of a front, one after the other.
struct Part<'a> {
    front: &'a Front,
    dense: Dense<'a>,
    block: usize,
    pivots: std::ops::Range<usize>,
}

impl Part<'_> {
    /// Row of the matrix, in the order of elimination, of row `c` of the front.
    #[inline(always)]
    fn row(&self, c: usize) -> usize {
        match c.checked_sub(self.dense.k) {
            None => self.block * self.front.first + c,
            Some(beyond) => self.block * self.front.rows[beyond / self.block] + beyond % self.block,
        }
    }
}

struct Inverse<'a> {
    x: &'a mut [f64],
    dim: usize,
}

impl Inverse<'_> {
    /// Copies the columns from `start` on that later rows of the front have; the pivots' own are zero.
    #[inline(always)]
    fn gather(&self, part: &Part, panel: &mut [[f64; PANEL]], start: usize, used: usize) {
        let count = part.pivots.len();
        panel[..count].fill([0.0; PANEL]);
        for (c, to) in (part.pivots.end..part.dense.f).zip(&mut panel[count..]) {
            let from = &self.x[part.row(c) * self.dim + start..][..used];
            match from.first_chunk() {
                Some(whole) => *to = *whole,
                None => {
                    to[..used].copy_from_slice(from);
                    to[used..].fill(0.0);
                }
            }
        }
    }

    /// Row `p` of the panel, from those after it.
    #[inline(always)]
    fn reduce<S: Simd>(&self, simd: S, part: &Part, panel: &mut [[f64; PANEL]], p: usize, used: usize) {
        let at = p - part.pivots.start;
        let (own, after) = panel[..part.dense.f - part.pivots.start].split_at_mut(at + 1);
        reduce_row(simd, &mut own[at], &part.dense.upper(p)[p + 1..], after, part.dense.inverse[p], used);
    }

    /// Entries of the pivots' rows in the columns behind them all, and the same in their columns.
    #[inline(always)]
    fn rows_beyond<S: Simd>(&mut self, simd: S, part: &Part, panel: &mut [[f64; PANEL]]) {
        let (first, count) = (part.row(part.pivots.start), part.pivots.len());
        for start in (first + count..self.dim).step_by(PANEL) {
            let used = (self.dim - start).min(PANEL);
            self.gather(part, panel, start, used);
            for p in part.pivots.clone().rev() {
                self.reduce(simd, part, panel, p, used);
            }
            for (p, row) in panel[..count].iter().enumerate() {
                self.x[(first + p) * self.dim + start..][..used].copy_from_slice(&row[..used]);
            }
            for (j, to) in self.x[start * self.dim..].chunks_exact_mut(self.dim).take(used).enumerate() {
                for (to, row) in to[first..first + count].iter_mut().zip(&panel[..count]) {
                    *to = row[j];
                }
            }
        }
    }

    /// The square of the pivots' rows and columns.
    #[inline(always)]
    fn own_rows<S: Simd>(&mut self, simd: S, part: &Part, panel: &mut [[f64; PANEL]]) {
        let (first, count) = (part.row(part.pivots.start), part.pivots.len());
        self.gather(part, panel, first, count);
        for p in part.pivots.clone().rev() {
            let at = p - part.pivots.start;
            self.reduce(simd, part, panel, p, count);
            // later rows have their entries before the diagonal from here
            if let Some((own, later)) = panel[at..count].split_first_mut() {
                later.iter_mut().zip(&own[at + 1..]).for_each(|(row, x)| row[at] = *x);
            }
            let upper = &part.dense.upper(p)[p + 1..];
            let sum: f64 = upper.iter().zip(&panel[at + 1..]).map(|(u, x)| u * x[at]).sum();
            panel[at][at] = (1.0 - sum) * part.dense.inverse[p];
        }
        for (p, row) in panel[..count].iter().enumerate() {
            self.x[(first + p) * self.dim + first..][..count].copy_from_slice(&row[..count]);
        }
    }
}
