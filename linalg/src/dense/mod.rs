//! Dense factorizations: own kernels for small systems, faer's for large ones.

use crate::constants::LINALG;

pub(crate) mod cholesky;
pub(crate) mod lu;

use self::cholesky::DenseCholesky;
use self::lu::DenseLu;
use crate::pivot::sum_abs;
use crate::{KktError, NodeMatrix, Symmetry};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::lu::partial_pivoting as faer_lu;
use faer::perm::PermRef;
use faer::{Conj, MatMut, MatRef, Par};

/// A full matrix, row-major, factored in place.
#[derive(Clone, Debug)]
pub(crate) struct Dense {
    symmetry: Symmetry,
    dim: usize,
    entries: Vec<f64>,
    /// Row permutation of a large LU, and its inverse.
    permutation: [Vec<usize>; 2],
    small_lu: DenseLu,
    small_cholesky: DenseCholesky,
}

impl Dense {
    pub fn new(symmetry: Symmetry, dim: usize) -> Self {
        let permutation = [vec![0; dim], vec![0; dim]];
        let entries = vec![0.0; dim * dim];
        let small_lu = DenseLu::new(if symmetry == Symmetry::General && dim < LINALG.blocked { dim } else { 0 });
        Self { symmetry, dim, entries, permutation, small_lu, small_cholesky: DenseCholesky::new(dim) }
    }

    pub fn refactor(&mut self, a: &NodeMatrix, prescribed: &[bool]) -> Result<(), KktError> {
        self.load(a)?;
        if self.symmetry == Symmetry::Symmetric {
            self.uncouple(prescribed);
        }
        match (self.symmetry, self.dim < LINALG.blocked) {
            (Symmetry::General, true) => self.small_lu.factor(&self.entries),
            (Symmetry::Symmetric, true) => self.small_cholesky.factor(&mut self.entries),
            (Symmetry::General, false) => self.large_lu(),
            (Symmetry::Symmetric, false) => self.large_cholesky(),
        }
    }

    fn load(&mut self, a: &NodeMatrix) -> Result<(), KktError> {
        self.entries.fill(0.0);
        for r in 0..self.dim {
            if !sum_abs(a.row(r)).is_finite() {
                return Err(KktError::NotFinite { row: r, dim: self.dim });
            }
            let row = &mut self.entries[r * self.dim..(r + 1) * self.dim];
            a.for_row(r, |c, place| row[c] = a.data()[place]);
        }
        Ok(())
    }

    /// Makes rows and columns of prescribed nodes those of the identity.
    fn uncouple(&mut self, prescribed: &[bool]) {
        let dim = self.dim;
        for p in (0..dim).filter(|p| prescribed[p / 3]) {
            self.entries[p * dim..(p + 1) * dim].fill(0.0);
            for r in 0..dim {
                self.entries[r * dim + p] = 0.0;
            }
            self.entries[p * dim + p] = 1.0;
        }
    }

    fn large_lu(&mut self) -> Result<(), KktError> {
        let dim = self.dim;
        let mut sizes = vec![0.0_f64; dim];
        for row in self.entries.chunks_exact(dim) {
            for (size, x) in sizes.iter_mut().zip(row) {
                *size = size.max(x.abs());
            }
        }
        let mut memory =
            MemBuffer::new(faer_lu::factor::lu_in_place_scratch::<usize, f64>(dim, dim, Par::Seq, Default::default()));
        let entries = MatMut::from_row_major_slice_mut(&mut self.entries, dim, dim);
        let [forward, inverse] = &mut self.permutation;
        faer_lu::factor::lu_in_place(entries, forward, inverse, Par::Seq, MemStack::new(&mut memory), Default::default());
        for (row, &size) in sizes.iter().enumerate() {
            let pivot = self.entries[row * dim + row];
            let sound = pivot.abs() > LINALG.pivot_floor * size;
            if !sound {
                return Err(KktError::Singular { row, dim, pivot, size });
            }
        }
        Ok(())
    }

    fn large_cholesky(&mut self) -> Result<(), KktError> {
        let dim = self.dim;
        let sizes: Vec<f64> = (0..dim).map(|r| self.entries[r * dim + r]).collect();
        let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(dim, Par::Seq, Default::default()));
        let entries = MatMut::from_column_major_slice_mut(&mut self.entries, dim, dim);
        let stack = MemStack::new(&mut memory);
        let done = llt::factor::cholesky_in_place(entries, Default::default(), Par::Seq, stack, Default::default());
        // faer reports where it stopped, not the pivot; vanishing pivots it accepts are found below
        let stopped = match done {
            Ok(_) => None,
            Err(llt::factor::LltError::NonPositivePivot { index }) => Some((index, f64::NAN)),
        };
        let vanished = || {
            let pivots = (0..dim).map(|r| (r, self.entries[r * dim + r].powi(2)));
            pivots.zip(&sizes).find(|((_, pivot), size)| *pivot <= LINALG.pivot_floor * *size).map(|(found, _)| found)
        };
        match stopped.or_else(vanished) {
            Some((row, pivot)) => Err(KktError::NotPositiveDefinite { row, dim, pivot, size: sizes[row] }),
            None => Ok(()),
        }
    }

    pub fn solve(&self, b: &mut [f64], columns: usize, transpose: bool) {
        match (self.symmetry, self.dim < LINALG.blocked) {
            (Symmetry::General, true) => self.small_lu.solve(b, columns, transpose),
            (Symmetry::Symmetric, true) => self.small_cholesky.solve(&self.entries, b, columns),
            (Symmetry::General, false) => self.solve_large_lu(MatMut::from_row_major_slice_mut(b, self.dim, columns), transpose),
            (Symmetry::Symmetric, false) => {
                let l = MatRef::from_column_major_slice(&self.entries, self.dim, self.dim);
                let b = MatMut::from_row_major_slice_mut(b, self.dim, columns);
                let mut memory = MemBuffer::new(llt::solve::solve_in_place_scratch::<f64>(self.dim, columns, Par::Seq));
                llt::solve::solve_in_place_with_conj(l, Conj::No, b, Par::Seq, MemStack::new(&mut memory));
            }
        }
    }

    fn solve_large_lu(&self, b: MatMut<'_, f64>, transpose: bool) {
        let m = MatRef::from_row_major_slice(&self.entries, self.dim, self.dim);
        let [forward, inverse] = &self.permutation;
        let permutation = PermRef::new_checked(forward, inverse, self.dim);
        let request = faer_lu::solve::solve_in_place_scratch::<usize, f64>(self.dim, b.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(request);
        let stack = MemStack::new(&mut memory);
        if transpose {
            faer_lu::solve::solve_transpose_in_place_with_conj(m, m, permutation, Conj::No, b, Par::Seq, stack);
        } else {
            faer_lu::solve::solve_in_place_with_conj(m, m, permutation, Conj::No, b, Par::Seq, stack);
        }
    }
}
