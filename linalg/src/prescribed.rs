//! The columns K_fp by which free rows feel prescribed nodes, kept beside a symmetric factor of K_ff.

use crate::band::sweep::two_rows;
use crate::{NodeLayout, NodeMatrix};

/// Blocks (free i, prescribed j) of K_fp in slots, and where they start in a [`NodeMatrix`].
#[derive(Clone, Debug, Default)]
pub(crate) struct CouplingPattern {
    blocks: Vec<(usize, usize)>,
    places: Vec<(usize, usize)>,
}

impl CouplingPattern {
    pub fn new(layout: &NodeLayout, prescribed: &[bool]) -> Self {
        let free_rows = (0..layout.n_nodes()).filter(|&i| !prescribed[i]);
        let blocks: Vec<_> = free_rows.flat_map(|i| layout.row(i).filter(|&j| prescribed[j]).map(move |j| (i, j))).collect();
        let places = blocks.iter().filter_map(|&(i, j)| layout.place(i, j)).collect();
        Self { blocks, places }
    }

    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Copies the blocks' values.
    pub fn load(&self, a: &NodeMatrix, values: &mut [[[f64; 3]; 3]]) {
        for (&(start, down), block) in self.places.iter().zip(values) {
            for (b, row) in block.iter_mut().enumerate() {
                row.copy_from_slice(&a.data()[start + b * down..][..3]);
            }
        }
    }

    /// `b_f −= K_fp b_p`, row-major with `columns` right-hand sides.
    pub fn subtract(&self, values: &[[[f64; 3]; 3]], b: &mut [f64], columns: usize) {
        self.for_pairs(values, |r, c, k| axpy_rows(b, columns, r, c, k));
    }

    /// `x_p −= K_fpᵀ x_f`.
    pub fn subtract_transpose(&self, values: &[[[f64; 3]; 3]], x: &mut [f64], columns: usize) {
        self.for_pairs(values, |r, c, k| axpy_rows(x, columns, c, r, k));
    }

    /// `row_p −= row_f K_fp`, of a row as long as the matrix.
    pub fn subtract_from_row(&self, values: &[[[f64; 3]; 3]], row: &mut [f64]) {
        self.for_pairs(values, |r, c, k| row[c] -= row[r] * k);
    }

    fn for_pairs(&self, values: &[[[f64; 3]; 3]], mut visit: impl FnMut(usize, usize, f64)) {
        for (&(i, j), block) in self.blocks.iter().zip(values) {
            for (b, row) in block.iter().enumerate() {
                for (c, &k) in row.iter().enumerate() {
                    visit(3 * i + b, 3 * j + c, k);
                }
            }
        }
    }
}

/// Row `target` −= factor · row `source` of a row-major matrix with `columns` columns.
#[inline(always)]
pub(crate) fn axpy_rows(b: &mut [f64], columns: usize, target: usize, source: usize, factor: f64) {
    let (to, from) = two_rows(b, columns, target, source);
    for (t, s) in to.iter_mut().zip(from) {
        *t -= factor * s;
    }
}
