//! A factored matrix: solves, transposed solves, many right-hand sides, refinement.

use crate::band::cholesky::BandCholesky;
use crate::band::lu::BandLu;
use crate::buffer::Buffer;
use crate::dense::Dense;
use crate::multifrontal;
use crate::symbolic::{Shared, Symbolic};
use crate::{KktError, Method, NodeLayout, NodeMatrix, Symmetry};
use std::cell::RefCell;
use std::sync::Arc;

thread_local! {
    /// Right-hand sides in storage order.
    static STORED: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// The factorization of one matrix. Until [`Factor::refactor`] has succeeded, solves fill their argument with NaN.
///
/// Right-hand sides are overwritten by solutions. `_many` takes `columns` of them row-major: row r is
/// `b[r * columns..(r + 1) * columns]`. Slices must have `dim` (times `columns`) entries.
#[derive(Clone, Debug)]
pub struct Factor {
    symbolic: Symbolic,
    kind: Kind,
    coupling: Vec<[[f64; 3]; 3]>,
    ready: bool,
}

#[derive(Clone, Debug)]
enum Kind {
    BandLu3(BandLu<3>),
    BandLu4(BandLu<4>),
    BandCholesky(BandCholesky),
    Dense(Dense),
    Multifrontal(Arc<multifrontal::Symbolic>, multifrontal::Numeric),
}

impl KktError {
    /// The same with the row counted as the system's instead of the storage's.
    fn in_system(mut self, layout: &NodeLayout) -> Self {
        if let Self::Singular { row, dim, .. }
        | Self::NotPositiveDefinite { row, dim, .. }
        | Self::Growth { row, dim, .. }
        | Self::NotFinite { row, dim } = &mut self
        {
            *row = layout.system(*row).unwrap_or(*row);
            *dim = layout.dim();
        }
        self
    }
}

impl Factor {
    /// Memory for factors of matrices described by `symbolic`.
    pub fn new(symbolic: &Symbolic) -> Self {
        let shared = &symbolic.shared;
        let (n, half_width) = (shared.layout.n_nodes(), shared.layout.half_width());
        let kind = match (&shared.multifrontal, shared.method, shared.symmetry, shared.layout.block()) {
            (Some(fronts), ..) => Kind::Multifrontal(Arc::clone(fronts), multifrontal::Numeric::new(fronts)),
            (None, Method::Band, Symmetry::General, 4) => Kind::BandLu4(BandLu::new(n, half_width)),
            (None, Method::Band, Symmetry::General, _) => Kind::BandLu3(BandLu::new(n, half_width)),
            (None, Method::Band, Symmetry::Symmetric, _) => Kind::BandCholesky(BandCholesky::new(n, half_width)),
            (None, ..) => Kind::Dense(Dense::new(shared.symmetry, shared.layout.stored())),
        };
        let coupling = vec![[[0.0; 3]; 3]; shared.coupling.len()];
        Self { symbolic: symbolic.clone(), kind, coupling, ready: false }
    }

    /// The analysis this factor was made for.
    pub fn symbolic(&self) -> &Symbolic {
        &self.symbolic
    }

    /// Number of scalar rows.
    pub fn dim(&self) -> usize {
        self.shared().layout.dim()
    }

    /// Factors `a`, without allocation after the first call (on each thread).
    pub fn refactor(&mut self, a: &NodeMatrix) -> Result<(), KktError> {
        self.ready = false;
        let shared = &*self.symbolic.shared;
        shared.check(a)?;
        let done = match &mut self.kind {
            Kind::BandLu3(f) => f.refactor(a),
            Kind::BandLu4(f) => f.refactor(a),
            Kind::BandCholesky(f) => f.refactor(a, &shared.prescribed),
            Kind::Dense(f) => f.refactor(a, &shared.prescribed),
            Kind::Multifrontal(fronts, f) => f.refactor(a, fronts),
        };
        done.map_err(|error| error.in_system(&shared.layout))?;
        shared.coupling.load(a, &mut self.coupling);
        self.ready = true;
        Ok(())
    }

    /// Whether all pivots are positive, as those of a matrix with a positive definite symmetric part are; not known of dense factors,
    /// which exchange rows.
    pub fn all_positive(&self) -> bool {
        match &self.kind {
            Kind::BandLu3(f) => f.all_positive(),
            Kind::BandLu4(f) => f.all_positive(),
            Kind::Multifrontal(_, f) => f.all_positive(),
            Kind::BandCholesky(_) | Kind::Dense(_) => true,
        }
    }

    /// `b ← A⁻¹ b`.
    pub fn solve(&self, b: &mut [f64]) {
        self.apply(b, 1, false);
    }

    /// `b ← A⁻ᵀ b`.
    pub fn solve_transpose(&self, b: &mut [f64]) {
        self.apply(b, 1, true);
    }

    /// `B ← A⁻¹ B`.
    pub fn solve_many(&self, b: &mut [f64], columns: usize) {
        self.apply(b, columns, false);
    }

    /// `B ← A⁻ᵀ B`.
    pub fn solve_transpose_many(&self, b: &mut [f64], columns: usize) {
        self.apply(b, columns, true);
    }

    /// A⁻¹, row-major; for matrices in fronts at a fraction of the price of its columns' solves.
    pub fn inverse(&self, out: &mut Vec<f64>) {
        let (shared, n) = (self.shared(), self.dim());
        if self.invert_general(&mut [&mut *out]) {
            return;
        }
        out.clear();
        out.resize(n * n, 0.0);
        let (Kind::Multifrontal(fronts, numeric), Symmetry::Symmetric, true) = (&self.kind, shared.symmetry, self.ready) else {
            (0..n).for_each(|k| out[k * n + k] = 1.0);
            return self.solve_many(out, n);
        };
        let mut ordered = Buffer::any(n * n);
        numeric.invert(fronts, &mut ordered);
        // (symmetric systems have no empty rows)
        let into_stored = |r: usize, stored: &mut [f64]| {
            let from = &ordered[fronts.row(shared.layout.storage(r)) * n..][..n];
            for (to, &at) in stored.as_chunks_mut::<3>().0.iter_mut().zip(&fronts.position) {
                *to = [from[3 * at], from[3 * at + 1], from[3 * at + 2]];
            }
            shared.coupling.subtract_from_row(&self.coupling, stored);
        };
        if shared.layout.is_plain() {
            return out.chunks_exact_mut(n).enumerate().for_each(|(r, out)| into_stored(r, out));
        }
        let mut stored = vec![0.0; n];
        for (r, out) in out.chunks_exact_mut(n).enumerate() {
            into_stored(r, &mut stored);
            out.iter_mut().enumerate().for_each(|(c, to)| *to = stored[shared.layout.storage(c)]);
        }
    }

    /// A⁻ᵀ in the first of `columns` (as many as A has, or more), row-major, and zero in the others; NaN if there is no factor.
    pub fn transposed_inverse(&self, columns: usize, out: &mut Vec<f64>) {
        let (layout, n) = (&self.shared().layout, self.dim());
        debug_assert!(columns >= n);
        out.clear();
        out.resize(n * columns, 0.0);
        match &self.kind {
            Kind::BandLu3(f) if self.ready => f.transposed_inverse(layout, out, columns),
            Kind::BandLu4(f) if self.ready => f.transposed_inverse(layout, out, columns),
            _ => {
                (0..n).for_each(|k| out[k * columns + k] = 1.0);
                self.solve_transpose_many(out, columns);
            }
        }
    }

    /// A⁻¹ and A⁻ᵀ, row-major; from fronts without solves.
    pub fn inverse_and_transpose(&self, out: &mut Vec<f64>, transposed: &mut Vec<f64>) {
        let n = self.dim();
        if self.invert_general(&mut [&mut *out, &mut *transposed]) {
            return;
        }
        self.inverse(out);
        transposed.clear();
        transposed.resize(n * n, 0.0);
        for (r, row) in out.chunks_exact(n.max(1)).enumerate() {
            row.iter().zip(transposed[r..].iter_mut().step_by(n)).for_each(|(from, to)| *to = *from);
        }
    }

    /// A⁻¹, and A⁻ᵀ if there is a second, from the fronts of a matrix that is not symmetric; false if this is another one.
    fn invert_general(&self, outs: &mut [&mut Vec<f64>]) -> bool {
        let (shared, n) = (self.shared(), self.dim());
        let (Kind::Multifrontal(fronts, numeric), Symmetry::General, true) = (&self.kind, shared.symmetry, self.ready) else {
            return false;
        };
        let stored = shared.layout.stored();
        let places: Vec<usize> = (0..n).map(|r| fronts.row(shared.layout.storage(r))).collect();
        let mut ordered = [Buffer::any(stored * stored), Buffer::any(stored * stored)];
        let [first, second] = &mut ordered;
        numeric.invert_general(fronts, first, second);
        for (out, ordered) in outs.iter_mut().zip(&ordered) {
            out.clear();
            out.reserve(n * n);
            for row in places.iter().map(|at| &ordered[at * stored..(at + 1) * stored]) {
                out.extend(places.iter().map(|at| row[*at]));
            }
        }
        true
    }

    /// `x ← A⁻¹ b` with `steps` steps of iterative refinement against `a` itself. Returns the size of the last correction
    /// relative to x (largest magnitudes; 0 without steps): the size of the change that further refinement could make.
    pub fn solve_refined(&self, a: &NodeMatrix, b: &[f64], x: &mut [f64], scratch: &mut Vec<f64>, steps: usize) -> f64 {
        self.refine(b, x, scratch, steps, 1, false, |x, r| a.add_mul(-1.0, x, r))
    }

    /// As [`Factor::solve_refined`], `x ← A⁻ᵀ b`.
    pub fn solve_transpose_refined(&self, a: &NodeMatrix, b: &[f64], x: &mut [f64], scratch: &mut Vec<f64>, steps: usize) -> f64 {
        self.refine(b, x, scratch, steps, 1, true, |x, r| a.add_mul_transpose(-1.0, x, r))
    }

    /// As [`Factor::solve_refined`], `X ← A⁻¹ B` with `columns` row-major right-hand sides.
    pub fn solve_many_refined(
        &self,
        a: &NodeMatrix,
        b: &[f64],
        x: &mut [f64],
        scratch: &mut Vec<f64>,
        steps: usize,
        columns: usize,
    ) -> f64 {
        self.refine(b, x, scratch, steps, columns, false, |x, r| a.add_mul_many(-1.0, x, r, columns))
    }

    fn shared(&self) -> &Shared {
        &self.symbolic.shared
    }

    fn apply(&self, b: &mut [f64], columns: usize, transpose: bool) {
        debug_assert_eq!(b.len(), self.dim() * columns);
        if !self.ready {
            b.fill(f64::NAN);
            return;
        }
        let layout = &self.shared().layout;
        if columns > 1 {
            // (general systems have nothing to subtract for prescribed nodes)
            match &self.kind {
                Kind::BandLu3(f) => return f.solve_many(layout, b, columns, transpose),
                Kind::BandLu4(f) => return f.solve_many(layout, b, columns, transpose),
                _ => {}
            }
        }
        if layout.is_plain() {
            return self.apply_stored(b, columns, transpose);
        }
        // one buffer a thread, so that solves neither allocate nor share
        STORED.with_borrow_mut(|stored| {
            layout.gather(b, stored, columns);
            self.apply_stored(stored, columns, transpose);
            layout.scatter(stored, b, columns);
        });
    }

    /// In storage order.
    fn apply_stored(&self, b: &mut [f64], columns: usize, transpose: bool) {
        let shared = self.shared();
        if !transpose {
            shared.coupling.subtract(&self.coupling, b, columns);
        }
        match &self.kind {
            Kind::BandLu3(f) => f.solve(b, columns, transpose),
            Kind::BandLu4(f) => f.solve(b, columns, transpose),
            Kind::BandCholesky(f) => f.solve(b, columns),
            Kind::Dense(f) => f.solve(b, columns, transpose),
            Kind::Multifrontal(fronts, f) => f.solve(fronts, b, columns, transpose),
        }
        if transpose {
            shared.coupling.subtract_transpose(&self.coupling, b, columns);
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn refine(
        &self,
        b: &[f64],
        x: &mut [f64],
        scratch: &mut Vec<f64>,
        steps: usize,
        columns: usize,
        transpose: bool,
        subtract_product: impl Fn(&[f64], &mut [f64]),
    ) -> f64 {
        x.copy_from_slice(b);
        self.apply(x, columns, transpose);
        let mut relative = 0.0;
        for _ in 0..steps {
            scratch.clear();
            scratch.extend_from_slice(b);
            subtract_product(x, scratch);
            self.apply(scratch, columns, transpose);
            let (mut correction, mut size) = (0.0_f64, 0.0_f64);
            for (x, d) in x.iter_mut().zip(scratch.iter()) {
                *x += d;
                correction = correction.max(d.abs());
                size = size.max(x.abs());
            }
            relative = if size > 0.0 { correction / size } else { 0.0 };
        }
        relative
    }
}
