//! The Hessian's Cholesky factor H = L Lᵀ, as L⁻¹.
//!
//! In the variable y = Lᵀ z the cost is ½ |y|² + (L⁻¹ g)ᵀ y and a row a is L⁻¹ a. The inverse costs n³/3 once; after it the row of a
//! bound is one of its columns.

use super::QpError;
use crate::constants::ACTIVE_SET;
use crate::kernels::{Columns, add_product, norm, transposed_product};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::{MatMut, MatRef, Par};

#[derive(Clone, Debug, Default)]
pub(super) struct Hessian {
    n: usize,
    /// H, both triangles, column-major.
    full: Vec<f64>,
    factor: Vec<f64>,
    /// L⁻¹, column-major, with zeros above the diagonal.
    inverse: Vec<f64>,
    /// |L⁻¹ e_j| = sqrt((H⁻¹)_jj).
    norms: Vec<f64>,
}

impl Hessian {
    /// Factors `h`, if it differs from the one before; whether it does.
    ///
    /// # Errors
    /// `h` is not positive definite.
    pub fn refactor(&mut self, h: MatRef<'_, f64>) -> Result<bool, QpError> {
        let n = h.nrows();
        let known = self.n == n && (0..n).all(|j| (j..n).all(|i| self.full[j * n + i] == h[(i, j)]));
        if known {
            return Ok(false);
        }
        self.n = 0;
        for entries in [&mut self.full, &mut self.factor, &mut self.inverse] {
            entries.resize(n * n, 0.0);
        }
        for j in 0..n {
            for i in j..n {
                let entry = h[(i, j)];
                self.full[j * n + i] = entry;
                self.full[i * n + j] = entry;
            }
        }
        self.factor.copy_from_slice(&self.full);
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
        let factor = MatMut::from_column_major_slice_mut(&mut self.factor, n, n);
        cholesky_in_place(factor, Default::default(), Par::Seq, MemStack::new(&mut memory), Default::default())
            .map_err(|LltError::NonPositivePivot { index }| QpError::NotPositiveDefinite { pivot: index })?;
        let vanishes = |j: &usize| self.factor[j * (n + 1)].powi(2) <= ACTIVE_SET.pivot * self.full[j * (n + 1)];
        if let Some(pivot) = (0..n).find(vanishes) {
            return Err(QpError::NotPositiveDefinite { pivot });
        }
        self.inverse.fill(0.0);
        let factor = MatRef::from_column_major_slice(&self.factor, n, n);
        invert_lower_triangular(MatMut::from_column_major_slice_mut(&mut self.inverse, n, n), factor, Par::Seq);
        self.norms = (0..n).map(|j| norm(&self.inverse[j * n + j..(j + 1) * n])).collect();
        self.n = n;
        Ok(true)
    }

    fn inverse(&self) -> Columns<'_> {
        Columns { data: &self.inverse, height: self.n, columns: self.n, lower: true }
    }

    /// `y = L⁻¹ x`.
    pub fn forward(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        add_product(1.0, self.inverse(), x, y);
    }

    /// `z = L⁻ᵀ y`.
    pub fn backward(&self, y: &[f64], z: &mut [f64]) {
        transposed_product(self.inverse(), y, z);
    }

    /// `y = sign · L⁻¹ e_j`.
    pub fn column(&self, j: usize, sign: f64, y: &mut [f64]) {
        for (y, entry) in y.iter_mut().zip(&self.inverse[j * self.n..]) {
            *y = sign * entry;
        }
    }

    /// |L⁻¹ e_j|.
    pub fn norm(&self, j: usize) -> f64 {
        self.norms[j]
    }

    /// About |L⁻¹ a|, at n operations: sqrt(Σ a_j² (H⁻¹)_jj), exact where H is diagonal.
    pub fn estimated_norm(&self, a: &[f64]) -> f64 {
        a.iter().zip(&self.norms).map(|(a, norm)| (a * norm).powi(2)).sum::<f64>().sqrt()
    }

    /// `y = H z`.
    pub fn product(&self, z: &[f64], y: &mut [f64]) {
        let full = Columns { data: &self.full, height: self.n, columns: self.n, lower: false };
        transposed_product(full, z, y);
    }
}
