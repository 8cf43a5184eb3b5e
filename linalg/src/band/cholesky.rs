//! Cholesky factorization inside a block band.

use crate::band::sweep::Band;
use crate::constants::LINALG;
use crate::{KktError, NodeMatrix};

/// K_ff = Uᵀ D U with U unit upper in the row storage of [`crate::band::sweep`], D > 0 (the square-root-free form of L Lᵀ,
/// L = Uᵀ √D); prescribed nodes are identity rows and columns. Reads the upper triangle.
#[derive(Clone, Debug)]
pub(crate) struct BandCholesky {
    band: Band<3>,
    upper: Vec<f64>,
    /// D and 1/D.
    pivots: Vec<f64>,
    inverse: Vec<f64>,
    /// A node's three rows from its own first column on.
    work: Vec<f64>,
}

impl BandCholesky {
    pub fn new(n_blocks: usize, half_width: usize) -> Self {
        let band = Band { n_blocks, half_width };
        let (dim, row_len) = (band.dim(), 3 * half_width + 3);
        let upper = vec![0.0; dim * band.width()];
        Self { band, upper, pivots: vec![0.0; dim], inverse: vec![0.0; dim], work: vec![0.0; 3 * row_len] }
    }

    pub fn refactor(&mut self, a: &NodeMatrix, prescribed: &[bool]) -> Result<(), KktError> {
        self.band.specialised(|band| self.eliminate(band, a, prescribed))
    }

    /// Node by node: the three rows of node i are reduced by all earlier rows of the band, then by one another.
    #[inline(always)]
    fn eliminate(&mut self, band: Band<3>, a: &NodeMatrix, prescribed: &[bool]) -> Result<(), KktError> {
        let width = band.width();
        for i in 0..band.n_blocks {
            if prescribed[i] {
                self.upper[3 * i * width..(3 * i + 3) * width].fill(0.0);
                self.pivots[3 * i..3 * i + 3].fill(1.0);
                self.inverse[3 * i..3 * i + 3].fill(1.0);
                continue;
            }
            self.load(band, a, prescribed, i);
            for distance in 1..=band.half_width.min(i) {
                self.reduce_by_node(band, i - distance, distance);
            }
            for c in 0..3 {
                self.pivot(band, a, i, c)?;
            }
        }
        Ok(())
    }

    /// Copies the rows of free node `i` from its own first column on, without the columns of prescribed nodes.
    #[inline(always)]
    fn load(&mut self, band: Band<3>, a: &NodeMatrix, prescribed: &[bool], i: usize) {
        let half = 3 * band.half_width;
        for (c, row) in self.work.chunks_exact_mut(half + 3).enumerate() {
            row.copy_from_slice(&a.row(3 * i + c)[half..]);
            for (d, _) in prescribed[i + 1..].iter().take(band.half_width).enumerate().filter(|(_, prescribed)| **prescribed) {
                row[3 * d + 3..3 * d + 6].fill(0.0);
            }
        }
    }

    /// Subtracts the contribution of the three rows of node `j`, `distance` before, from the rows at work.
    #[inline(always)]
    fn reduce_by_node(&mut self, band: Band<3>, j: usize, distance: usize) {
        let (width, row_len) = (band.width(), 3 * band.half_width + 3);
        let from = 3 * distance - 1; // where the columns of the node at work start in node j's rows
        for c in 0..3 {
            let row = &self.upper[(3 * j + c) * width + from..(3 * j + c + 1) * width];
            let pivot = self.pivots[3 * j + c];
            for (a, target) in self.work.chunks_exact_mut(row_len).enumerate() {
                let factor = pivot * row[a];
                for (x, u) in target[..row.len()].iter_mut().zip(row) {
                    *x -= factor * u;
                }
            }
        }
    }

    /// Checks the pivot of row `c` of node `i`, stores it and the row of U, and reduces the node's rows below by it.
    #[inline(always)]
    fn pivot(&mut self, band: Band<3>, a: &NodeMatrix, i: usize, c: usize) -> Result<(), KktError> {
        let (width, row_len, r) = (band.width(), 3 * band.half_width + 3, 3 * i + c);
        let (done, below) = self.work.split_at_mut((c + 1) * row_len);
        let row = &done[c * row_len..];
        let (pivot, size) = (row[c], a.row(r)[3 * band.half_width + c]);
        // written so that NaN fails
        let sound = pivot > LINALG.pivot_floor * size && pivot < f64::INFINITY;
        if !sound {
            return Err(breakdown(a.row(r), r, band.dim(), pivot, size));
        }
        let inverse = 1.0 / pivot;
        self.pivots[r] = pivot;
        self.inverse[r] = inverse;
        let upper = &mut self.upper[r * width..(r + 1) * width];
        for (u, x) in upper.iter_mut().zip(&row[1..]) {
            *u = x * inverse;
        }
        upper[..c].fill(0.0);
        for (b, target) in below.chunks_exact_mut(row_len).enumerate() {
            let factor = row[c + 1 + b];
            for (x, u) in target[1..].iter_mut().zip(upper.iter()) {
                *x -= factor * u;
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
