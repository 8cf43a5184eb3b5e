//! A full square matrix: the block of the bodies' degrees of freedom.

use super::KktError;
use super::dense_small::DenseLu;
use super::wide::wide;

/// A full matrix by rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Square {
    dim: usize,
    data: Vec<f64>,
}

impl Square {
    /// The zero matrix.
    pub fn zeros(dim: usize) -> Self {
        Self { dim, data: vec![0.0; dim * dim] }
    }

    /// Number of rows.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Entry (r, c).
    pub fn get(&self, r: usize, c: usize) -> f64 {
        self.data[r * self.dim + c]
    }

    /// Replaces entry (r, c).
    pub fn set(&mut self, r: usize, c: usize, value: f64) {
        self.data[r * self.dim + c] = value;
    }

    /// Adds to entry (r, c).
    #[inline]
    pub fn add(&mut self, r: usize, c: usize, value: f64) {
        self.data[r * self.dim + c] += value;
    }

    /// All rows in one slice.
    pub fn data(&self) -> &[f64] {
        &self.data
    }

    /// All rows in one slice, to change.
    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`. Rows of X that are zero but for a few columns (the unit columns of
    /// a Jacobian) cost only those.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        if self.dim == 0 || columns == 0 {
            return;
        }
        wide(
            #[inline(always)]
            || self.add_mul_kernel(scale, x, y, columns),
        );
    }

    #[inline(always)]
    fn add_mul_kernel(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for (k, x) in x.chunks_exact(columns).enumerate() {
            let Some(first) = x.iter().position(|x| *x != 0.0) else { continue };
            let last = x.iter().rposition(|x| *x != 0.0).unwrap_or(first);
            let x = &x[first..=last];
            for (r, y) in y.chunks_exact_mut(columns).enumerate() {
                let factor = scale * self.data[r * self.dim + k];
                if factor != 0.0 {
                    y[first..=last].iter_mut().zip(x).for_each(|(y, x)| *y += factor * x);
                }
            }
        }
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        if self.dim == 0 {
            return;
        }
        for (row, x) in self.data.chunks_exact(self.dim).zip(x) {
            let factor = scale * x;
            y.iter_mut().zip(row).for_each(|(y, a)| *y += factor * a);
        }
    }
}

/// LU of a [`Square`] with row pivoting.
#[derive(Clone, Debug)]
pub(super) struct SquareLu {
    entries: Vec<f64>,
    lu: DenseLu,
}

impl SquareLu {
    pub fn new(dim: usize) -> Self {
        Self { entries: vec![0.0; dim * dim], lu: DenseLu::new(dim) }
    }

    pub fn refactor(&mut self, a: &Square, first_row: usize) -> Result<(), KktError> {
        if let Some(k) = a.data.iter().position(|x| !x.is_finite()) {
            return Err(KktError::NotFinite { row: first_row + k / a.dim, dim: first_row + a.dim });
        }
        self.entries.copy_from_slice(&a.data);
        if a.dim == 0 {
            return Ok(());
        }
        self.lu.factor(&mut self.entries).map_err(|error| match error {
            KktError::Singular { row, dim, pivot, size } => {
                KktError::Singular { row: first_row + row, dim: first_row + dim, pivot, size }
            }
            other => other,
        })
    }

    pub fn solve(&self, b: &mut [f64], columns: usize, transpose: bool) {
        self.lu.solve(&self.entries, b, columns, transpose);
    }
}
