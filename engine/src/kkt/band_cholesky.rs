//! Cholesky factorization inside a block band.

use super::band_sweep::Band;
use super::{BlockBand, KktError, PIVOT_FLOOR};

/// K_ff = Uᵀ D U with U unit upper in the row storage of [`super::band_sweep`], D > 0 (the square-root-free form of L Lᵀ,
/// L = Uᵀ √D); driven nodes are identity rows and columns. Reads the upper triangle.
#[derive(Clone, Debug)]
pub(super) struct BandCholesky {
    band: Band,
    upper: Vec<f64>,
    inverse: Vec<f64>,
}

impl BandCholesky {
    pub fn new(n_blocks: usize, half_width: usize) -> Self {
        let band = Band { n_blocks, half_width };
        Self { band, upper: vec![0.0; band.dim() * band.width()], inverse: vec![0.0; band.dim()] }
    }

    pub fn refactor(&mut self, a: &BlockBand, driven: &[bool]) -> Result<(), KktError> {
        self.load(a, driven);
        self.band.specialised(|band| self.eliminate(band, a, driven))
    }

    /// Copies the strict upper triangle of K_ff to `upper` and the diagonal to `inverse`.
    fn load(&mut self, a: &BlockBand, driven: &[bool]) {
        let (width, half) = (self.band.width(), 3 * self.band.half_width);
        for r in 0..self.band.dim() {
            let (i, c) = (r / 3, r % 3);
            let upper = &mut self.upper[r * width..(r + 1) * width];
            if driven[i] {
                upper.fill(0.0);
                self.inverse[r] = 1.0;
                continue;
            }
            let row = a.row(r);
            upper.copy_from_slice(&row[half + 1..]);
            upper[..c].fill(0.0);
            self.inverse[r] = row[half + c];
            for (d, _) in driven[i + 1..].iter().take(self.band.half_width).enumerate().filter(|(_, driven)| **driven) {
                upper[3 * d + 2..3 * d + 5].fill(0.0);
            }
        }
    }

    /// Row by row, each reduces the rows below it.
    #[inline(always)]
    fn eliminate(&mut self, band: Band, a: &BlockBand, driven: &[bool]) -> Result<(), KktError> {
        let (width, dim) = (band.width(), band.dim());
        for r in 0..dim {
            let (i, c) = (r / 3, r % 3);
            let pivot = self.inverse[r];
            let size = if driven[i] { 1.0 } else { a.row(r)[3 * band.half_width + c] };
            // written so that NaN fails
            let sound = pivot > PIVOT_FLOOR * size && pivot < f64::INFINITY;
            if !sound {
                return Err(breakdown(a.row(r), r, dim, pivot, size));
            }
            let inverse = 1.0 / pivot;
            self.inverse[r] = inverse;
            let (done, below) = self.upper.split_at_mut((r + 1) * width);
            let row = &mut done[r * width..];
            // row[k] is column 3i + 1 + k; entries up to k = c − 1 are zero
            for k in c..width.min(dim - 3 * i - 1) {
                let factor = row[k] * inverse;
                let t = 3 * i + 1 + k;
                let target = &mut below[(t - r - 1) * width + t % 3..(t - r) * width];
                for (x, u) in target.iter_mut().zip(&row[k + 1..]) {
                    *x -= factor * u;
                }
                self.inverse[t] -= factor * row[k];
                row[k] = factor;
            }
        }
        Ok(())
    }

    /// The matrix is symmetric: the same for its transpose.
    pub fn solve(&self, b: &mut [f64], columns: usize) {
        self.band.solve_upper_transpose(&self.upper, b, columns);
        for (row, inverse) in b.chunks_exact_mut(columns.max(1)).zip(&self.inverse) {
            for x in row {
                *x *= inverse;
            }
        }
        self.band.solve_upper(&self.upper, b, columns);
    }
}

#[cold]
fn breakdown(entries: &[f64], row: usize, dim: usize, pivot: f64, size: f64) -> KktError {
    if entries.iter().all(|x| x.is_finite()) && pivot.is_finite() {
        KktError::NotPositiveDefinite { row, dim, pivot, size }
    } else {
        KktError::NotFinite { row, dim }
    }
}
