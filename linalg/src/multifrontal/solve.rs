//! Solves with a factor made front by front.
//!
//! Vectors are permuted into the order of elimination. Forward, each front's pivots are solved for and reduce its rows; backward the other
//! way round. One right-hand side is vectorised along a front, many along the right-hand sides.

use crate::Symmetry;
use crate::multifrontal::symbolic::Front;
use crate::multifrontal::{Numeric, Symbolic};
use crate::panel::{PANEL, reduce_row};
use pliant_math::simd::rows::{products_in_vectors, subtract_four};
use pulp::{Arch, Simd, WithSimd};
use std::cell::RefCell;

thread_local! {
    /// One a thread, so that solves neither allocate nor share.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

#[derive(Default)]
struct Scratch {
    /// Right-hand sides in the order of elimination.
    ordered: Vec<f64>,
    panel: Vec<[f64; PANEL]>,
    /// The same in one front.
    local: Vec<f64>,
    local_panel: Vec<[f64; PANEL]>,
    /// A column of a front.
    column: Vec<f64>,
}

/// Which triangular factors are inverted: those of A = L U, of Aᵀ = Uᵀ Lᵀ, or of A = Uᵀ D⁻¹ U.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    General,
    Transposed,
    Symmetric,
}

impl Numeric {
    /// `B ← A⁻¹ B` or `A⁻ᵀ B`, row-major with `columns` right-hand sides.
    pub fn solve(&self, fronts: &Symbolic, b: &mut [f64], columns: usize, transpose: bool) {
        struct Run<'a>(&'a Numeric, &'a Symbolic, &'a mut [f64], usize, Form, &'a mut Scratch);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(factor, fronts, b, columns, form, scratch) = self;
                match columns {
                    0 => {}
                    1 if fronts.block == 3 => factor.solve_one::<S, 3>(simd, fronts, b, form, scratch),
                    1 => factor.solve_one::<S, 4>(simd, fronts, b, form, scratch),
                    _ => factor.solve_many(simd, fronts, b, columns, form, scratch),
                }
            }
        }
        let form = match fronts.symmetry {
            Symmetry::Symmetric => Form::Symmetric,
            Symmetry::General if transpose => Form::Transposed,
            Symmetry::General => Form::General,
        };
        SCRATCH.with_borrow_mut(|scratch| Arch::new().dispatch(Run(self, fronts, b, columns, form, scratch)));
    }

    /// The pivots' rows of a front, and those of L beyond.
    #[inline(always)]
    pub(crate) fn of(&self, front: &Front, b: usize) -> Dense<'_> {
        let (k, m) = (b * front.pivots, b * front.rows.len());
        let lower = if self.lower.is_empty() { &[][..] } else { &self.lower[front.lower..front.lower + k * m] };
        let (first, upper) = (b * front.first, &self.upper[front.upper..front.upper + k * (k + m)]);
        Dense { k, f: k + m, upper, lower, inverse: &self.inverse[first..first + k] }
    }

    #[inline(always)]
    fn solve_one<S: Simd, const B: usize>(&self, simd: S, fronts: &Symbolic, b: &mut [f64], form: Form, scratch: &mut Scratch) {
        let Scratch { ordered, local, .. } = scratch;
        ordered.resize(b.len(), 0.0);
        local.resize(B * fronts.widest, 0.0);
        let slots = ordered.as_chunks_mut::<B>().0;
        for (x, &position) in b.as_chunks::<B>().0.iter().zip(&fronts.position) {
            slots[position] = *x;
        }
        for front in &fronts.fronts {
            let dense = self.of(front, B);
            let (own, rows) = local[..dense.f].as_chunks_mut::<B>().0.split_at_mut(front.pivots);
            own.iter_mut().zip(&slots[front.first..]).for_each(|(x, slot)| *x = *slot);
            rows.iter_mut().for_each(|x| *x = [0.0; B]);
            dense.forward(simd, &mut local[..dense.f], form);
            let (own, rows) = local[..dense.f].as_chunks::<B>().0.split_at(front.pivots);
            own.iter().zip(&mut slots[front.first..]).for_each(|(x, slot)| *slot = *x);
            for (&row, x) in front.rows.iter().zip(rows) {
                slots[row].iter_mut().zip(x).for_each(|(y, x)| *y += x);
            }
        }
        for front in fronts.fronts.iter().rev() {
            let dense = self.of(front, B);
            let (own, rows) = local[..dense.f].as_chunks_mut::<B>().0.split_at_mut(front.pivots);
            own.iter_mut().zip(&slots[front.first..]).for_each(|(x, slot)| *x = *slot);
            for (&row, x) in front.rows.iter().zip(rows) {
                *x = slots[row];
            }
            dense.backward(simd, &mut local[..dense.f], form);
            let own = local[..dense.k].as_chunks::<B>().0;
            own.iter().zip(&mut slots[front.first..]).for_each(|(x, slot)| *slot = *x);
        }
        for (x, &position) in b.as_chunks_mut::<B>().0.iter_mut().zip(&fronts.position) {
            *x = slots[position];
        }
    }

    #[inline(always)]
    fn solve_many<S: Simd>(&self, simd: S, fronts: &Symbolic, b: &mut [f64], columns: usize, form: Form, scratch: &mut Scratch) {
        let Scratch { panel, local_panel, column, .. } = scratch;
        let (block, dim) = (fronts.block, b.len() / columns);
        panel.resize(dim, [0.0; PANEL]);
        local_panel.resize(block * fronts.widest, [0.0; PANEL]);
        for start in (0..columns).step_by(PANEL) {
            let used = (columns - start).min(PANEL);
            for (row, b) in b.chunks_exact(columns).enumerate() {
                let to = &mut panel[fronts.row(row)];
                to[..used].copy_from_slice(&b[start..start + used]);
                to[used..].fill(0.0);
            }
            for front in &fronts.fronts {
                let dense = self.of(front, block);
                let (x, first) = (&mut local_panel[..dense.f], block * front.first);
                // unit columns leave most fronts untouched
                if is_zero(&panel[first..first + dense.k], used) {
                    continue;
                }
                x[..dense.k].copy_from_slice(&panel[first..first + dense.k]);
                x[dense.k..].fill([0.0; PANEL]);
                dense.forward_many(simd, x, form, column, used);
                panel[first..first + dense.k].copy_from_slice(&x[..dense.k]);
                for (&row, x) in front.rows.iter().zip(x[dense.k..].chunks_exact(block)) {
                    for (y, x) in panel[block * row..][..block].iter_mut().zip(x) {
                        y.iter_mut().zip(x).for_each(|(y, x)| *y += x);
                    }
                }
            }
            for front in fronts.fronts.iter().rev() {
                let dense = self.of(front, block);
                let (x, first) = (&mut local_panel[..dense.f], block * front.first);
                x[..dense.k].copy_from_slice(&panel[first..first + dense.k]);
                for (&row, x) in front.rows.iter().zip(x[dense.k..].chunks_exact_mut(block)) {
                    x.copy_from_slice(&panel[block * row..][..block]);
                }
                dense.backward_many(simd, x, form, column, used);
                panel[first..first + dense.k].copy_from_slice(&x[..dense.k]);
            }
            for (row, b) in b.chunks_exact_mut(columns).enumerate() {
                b[start..start + used].copy_from_slice(&panel[fronts.row(row)][..used]);
            }
        }
    }
}

/// Whether the first `used` numbers of all rows are zero.
#[inline(always)]
fn is_zero(rows: &[[f64; PANEL]], used: usize) -> bool {
    for row in rows {
        let mut any = false;
        for x in &row[..used] {
            any |= *x != 0.0;
        }
        if any {
            return false;
        }
    }
    true
}

/// The factor of a front: `k` pivots of `f` rows.
#[derive(Clone, Copy)]
pub(crate) struct Dense<'a> {
    pub k: usize,
    pub f: usize,
    /// L before the diagonal, U from it on.
    upper: &'a [f64],
    /// The other rows of L.
    lower: &'a [f64],
    /// 1 over the pivots.
    pub inverse: &'a [f64],
}

impl<'a> Dense<'a> {
    /// Row `p` of the pivots.
    #[inline(always)]
    pub fn upper(&self, p: usize) -> &'a [f64] {
        &self.upper[p * self.f..(p + 1) * self.f]
    }

    /// Adds to `out` the entries of column `p` of L below the diagonal.
    #[inline(always)]
    pub fn extend_by_lower(&self, p: usize, out: &mut Vec<f64>) {
        out.extend((p + 1..self.f).map(|r| if r < self.k { self.upper(r)[p] } else { self.lower(r)[p] }));
    }

    #[inline(always)]
    fn lower(&self, r: usize) -> &'a [f64] {
        &self.lower[(r - self.k) * self.k..(r - self.k + 1) * self.k]
    }

    /// Solves for the pivots, and subtracts their contribution from the rows.
    #[inline(always)]
    fn forward<S: Simd>(&self, simd: S, x: &mut [f64], form: Form) {
        match form {
            Form::General => self.forward_lower(simd, x),
            Form::Transposed | Form::Symmetric => self.forward_upper(simd, x, form),
        }
    }

    #[inline(always)]
    fn forward_lower<S: Simd>(&self, simd: S, x: &mut [f64]) {
        let (own, rows) = x.split_at_mut(self.k);
        for p in 0..self.k {
            let sum: f64 = self.upper(p)[..p].iter().zip(own.iter()).map(|(l, x)| l * x).sum();
            own[p] -= sum;
        }
        for (quad, x) in rows.chunks_mut(4).enumerate() {
            let row = |i: usize| self.lower((self.k + 4 * quad + i).min(self.f - 1));
            let sums = products_in_vectors(simd, [row(0), row(1), row(2), row(3)], own);
            x.iter_mut().zip(sums).for_each(|(x, sum)| *x -= sum);
        }
    }

    /// By the transpose of U.
    #[inline(always)]
    fn forward_upper<S: Simd>(&self, simd: S, x: &mut [f64], form: Form) {
        for first in (0..self.k).step_by(4) {
            let last = self.k.min(first + 4);
            let factors = match last - first {
                1 => self.forward_pivots::<1>(x, first, form),
                2 => self.forward_pivots::<2>(x, first, form),
                3 => self.forward_pivots::<3>(x, first, form),
                _ => self.forward_pivots::<4>(x, first, form),
            };
            let row = |i: usize| &self.upper((first + i).min(last - 1))[last..];
            subtract_four(simd, &mut x[last..], factors, [row(0), row(1), row(2), row(3)]);
        }
    }

    /// `N` pivots from row `first` on by one another; returns their contributions to the rows after them.
    #[inline(always)]
    fn forward_pivots<const N: usize>(&self, x: &mut [f64], first: usize, form: Form) -> [f64; 4] {
        let (Some(own), Some(inverse)) = (x[first..].first_chunk_mut::<N>(), self.inverse[first..].first_chunk::<N>()) else {
            return [0.0; 4];
        };
        let mut factors = [0.0; 4];
        for p in 0..N {
            factors[p] = own[p] * inverse[p];
            let Some(row) = self.upper(first + p)[first..].first_chunk::<N>() else { continue };
            for r in p + 1..N {
                own[r] -= factors[p] * row[r];
            }
        }
        if form == Form::Transposed {
            own.copy_from_slice(&factors[..N]);
        }
        factors
    }

    /// Solves for the pivots at given rows.
    #[inline(always)]
    fn backward<S: Simd>(&self, simd: S, x: &mut [f64], form: Form) {
        match form {
            Form::Transposed => self.backward_lower(simd, x),
            Form::General | Form::Symmetric => self.backward_upper(simd, x),
        }
    }

    #[inline(always)]
    fn backward_upper<S: Simd>(&self, simd: S, x: &mut [f64]) {
        for first in (0..self.k).step_by(4).rev() {
            let last = self.k.min(first + 4);
            let (own, after) = x.split_at_mut(last);
            let row = |i: usize| &self.upper((first + i).min(last - 1))[last..];
            let sums = products_in_vectors(simd, [row(0), row(1), row(2), row(3)], after);
            match last - first {
                1 => self.backward_pivots::<1>(own, first, &sums),
                2 => self.backward_pivots::<2>(own, first, &sums),
                3 => self.backward_pivots::<3>(own, first, &sums),
                _ => self.backward_pivots::<4>(own, first, &sums),
            }
        }
    }

    /// `N` pivots from row `first` on, of which the rows after them take `sums`.
    #[inline(always)]
    fn backward_pivots<const N: usize>(&self, x: &mut [f64], first: usize, sums: &[f64; 4]) {
        let (Some(own), Some(inverse)) = (x[first..].first_chunk_mut::<N>(), self.inverse[first..].first_chunk::<N>()) else {
            return;
        };
        for p in (0..N).rev() {
            let Some(row) = self.upper(first + p)[first..].first_chunk::<N>() else { continue };
            let mut left = own[p] - sums[p];
            for r in p + 1..N {
                left -= row[r] * own[r];
            }
            own[p] = left * inverse[p];
        }
    }

    /// By the transpose of L.
    #[inline(always)]
    fn backward_lower<S: Simd>(&self, simd: S, x: &mut [f64]) {
        let (own, rows) = x.split_at_mut(self.k);
        for (quad, x) in rows.chunks(4).enumerate() {
            let row = |i: usize| self.lower((self.k + 4 * quad + i).min(self.f - 1));
            let factors = std::array::from_fn(|i| x.get(i).copied().unwrap_or(0.0));
            subtract_four(simd, own, factors, [row(0), row(1), row(2), row(3)]);
        }
        for p in (0..self.k).rev() {
            let (before, from) = own.split_at_mut(p);
            before.iter_mut().zip(self.upper(p)).for_each(|(x, l)| *x -= from[0] * l);
        }
    }

    #[inline(always)]
    fn forward_many<S: Simd>(&self, simd: S, x: &mut [[f64; PANEL]], form: Form, column: &mut Vec<f64>, used: usize) {
        for r in 0..self.f {
            let (before, own) = x.split_at_mut(r);
            let count = r.min(self.k);
            if form == Form::General {
                let factors = if r < self.k { &self.upper(r)[..r] } else { self.lower(r) };
                reduce_row(simd, &mut own[0], factors, before, 1.0, used);
            } else {
                column.clear();
                column.extend((0..count).map(|p| self.upper(p)[r] * if form == Form::Symmetric { self.inverse[p] } else { 1.0 }));
                let scale = if form == Form::Transposed && r < self.k { self.inverse[r] } else { 1.0 };
                reduce_row(simd, &mut own[0], column, before, scale, used);
            }
        }
    }

    #[inline(always)]
    fn backward_many<S: Simd>(&self, simd: S, x: &mut [[f64; PANEL]], form: Form, column: &mut Vec<f64>, used: usize) {
        for p in (0..self.k).rev() {
            let (own, after) = x.split_at_mut(p + 1);
            if form == Form::Transposed {
                column.clear();
                self.extend_by_lower(p, column);
                reduce_row(simd, &mut own[p], column, after, 1.0, used);
            } else {
                reduce_row(simd, &mut own[p], &self.upper(p)[p + 1..], after, self.inverse[p], used);
            }
        }
    }
}
