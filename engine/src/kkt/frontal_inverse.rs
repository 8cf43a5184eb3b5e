//! The whole inverse of a symmetric matrix from its fronts.
//!
//! With A = Uᵀ D⁻¹ U, D the diagonal of U, the inverse X obeys U X = D U⁻ᵀ, of which the right side is one on the diagonal and zero behind
//! it. So a row follows from the diagonal on from later rows, and before it by symmetry:
//! ```text
//! X_pj = (δ_pj − Σ_{c > p} U_pc X_cj)/U_pp,  j ≥ p
//! ```
//! That takes no forward sweep and half of the backward one. (Takahashi, Fagan and Chin 1973 find the entries in the pattern of U that way;
//! here all are wanted.)

use super::frontal::Frontal;
use super::frontal_solve::Dense;
use super::fronts::{Front, Fronts};
use super::lanes::{PANEL, reduce_row};
use pulp::{Arch, Simd, WithSimd};

/// Pivots whose rows are found together.
const GROUP: usize = 12;

impl Frontal {
    /// A⁻¹ in the order of elimination, row-major; the factor must be symmetric.
    pub fn invert(&self, fronts: &Fronts, x: &mut Vec<f64>) {
        struct Run<'a>(&'a Frontal, &'a Fronts, Inverse<'a>);
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
        x.clear();
        x.resize(dim * dim, 0.0);
        Arch::new().dispatch(Run(self, fronts, Inverse { x, dim }));
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

    /// What the pivots' rows have in the columns behind them all, and the same in their columns.
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
