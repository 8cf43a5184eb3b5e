//! A square matrix of 3 × 3 node blocks within a block band, the storage of every Jacobian of a nodal system.

/// Square block-band matrix: `n_blocks` nodes of three dofs, blocks (i, j) with |i − j| ≤ `half_width` are stored, all else is zero.
///
/// Rows are contiguous: row r of node i holds the columns `3 (i − half_width) ..= 3 (i + half_width) + 2`; the parts that stick
/// out at either end of the matrix are stored and stay zero, so that every row has the same length.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockBand {
    n_blocks: usize,
    half_width: usize,
    data: Vec<f64>,
}

impl BlockBand {
    /// The zero matrix.
    pub fn zeros(n_blocks: usize, half_width: usize) -> Self {
        Self { n_blocks, half_width, data: vec![0.0; 3 * n_blocks * 3 * (2 * half_width + 1)] }
    }

    /// Number of node blocks along the diagonal.
    pub fn n_blocks(&self) -> usize {
        self.n_blocks
    }

    /// Number of rows, three per node.
    pub fn dim(&self) -> usize {
        3 * self.n_blocks
    }

    /// Half width of the band in node blocks.
    pub fn half_width(&self) -> usize {
        self.half_width
    }

    /// Stored entries per row, `3 (2 half_width + 1)`.
    pub fn row_len(&self) -> usize {
        3 * (2 * self.half_width + 1)
    }

    /// Sets every entry to zero and keeps the memory.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Column of the first stored entry of row `r` (negative near the top: those entries are outside the matrix and zero).
    pub fn first_column(&self, r: usize) -> isize {
        3 * ((r / 3) as isize - self.half_width as isize)
    }

    /// The stored entries of row `r`, starting at [`Self::first_column`].
    pub fn row(&self, r: usize) -> &[f64] {
        let len = self.row_len();
        &self.data[r * len..(r + 1) * len]
    }

    /// The stored entries of row `r`, to change.
    pub fn row_mut(&mut self, r: usize) -> &mut [f64] {
        let len = self.row_len();
        &mut self.data[r * len..(r + 1) * len]
    }

    /// All rows in one slice.
    pub fn data(&self) -> &[f64] {
        &self.data
    }

    /// All rows in one slice, to change.
    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// Entry (r, c); zero outside the band.
    pub fn get(&self, r: usize, c: usize) -> f64 {
        match self.position(r, c) {
            Some(k) => self.data[k],
            None => 0.0,
        }
    }

    /// Adds `value` to entry (r, c), which must lie in the band.
    #[inline]
    pub fn add(&mut self, r: usize, c: usize, value: f64) {
        let k = (c + 3 * self.half_width) - 3 * (r / 3);
        let len = self.row_len();
        debug_assert!(k < len);
        self.data[r * len + k] += value;
    }

    /// Adds `scale · block` to the block of nodes (i, j), which must lie in the band. `block[a][b]` is row a, column b.
    #[inline]
    pub fn add_block(&mut self, i: usize, j: usize, scale: f64, block: &[[f64; 3]; 3]) {
        let len = self.row_len();
        let start = 3 * i * len + 3 * (j + self.half_width - i);
        for (a, block_row) in block.iter().enumerate() {
            let row = &mut self.data[start + a * len..start + a * len + 3];
            for (entry, b) in row.iter_mut().zip(block_row) {
                *entry += scale * b;
            }
        }
    }

    /// The block of nodes (i, j), which must lie in the band.
    pub fn block(&self, i: usize, j: usize) -> [[f64; 3]; 3] {
        let start = 3 * (j + self.half_width - i);
        std::array::from_fn(|a| std::array::from_fn(|b| self.row(3 * i + a)[start + b]))
    }

    /// Replaces the block of nodes (i, j), which must lie in the band.
    pub fn set_block(&mut self, i: usize, j: usize, block: &[[f64; 3]; 3]) {
        let start = 3 * (j + self.half_width - i);
        for (a, row) in block.iter().enumerate() {
            self.row_mut(3 * i + a)[start..start + 3].copy_from_slice(row);
        }
    }

    fn position(&self, r: usize, c: usize) -> Option<usize> {
        let k = (c + 3 * self.half_width) as isize - 3 * (r / 3) as isize;
        (c < self.dim() && (0..self.row_len() as isize).contains(&k)).then(|| r * self.row_len() + k as usize)
    }

    /// Range of stored positions in row `r` that lie inside the matrix, and the column of its first.
    #[inline]
    pub fn span(&self, r: usize) -> (std::ops::Range<usize>, usize) {
        let first = self.first_column(r);
        let skip = (-first).max(0) as usize;
        let column = first.max(0) as usize;
        let end = self.row_len().min((self.dim() as isize - first) as usize);
        (skip..end, column)
    }

    /// `y += scale · A x`.
    pub fn add_mul(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        for (r, y_r) in y.iter_mut().enumerate() {
            let (span, column) = self.span(r);
            let row = &self.row(r)[span];
            let sum: f64 = row.iter().zip(&x[column..column + row.len()]).map(|(a, b)| a * b).sum();
            *y_r += scale * sum;
        }
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        for (r, x_r) in x.iter().enumerate() {
            let (span, column) = self.span(r);
            let row = &self.row(r)[span];
            let factor = scale * x_r;
            for (y_c, a) in y[column..column + row.len()].iter_mut().zip(row) {
                *y_c += factor * a;
            }
        }
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`: row r of X is `x[r * columns..(r + 1) * columns]`.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for r in 0..self.dim() {
            let (span, column) = self.span(r);
            let y_row = &mut y[r * columns..(r + 1) * columns];
            for (k, a) in self.row(r)[span].iter().enumerate() {
                let factor = scale * a;
                if factor != 0.0 {
                    let x_row = &x[(column + k) * columns..(column + k + 1) * columns];
                    for (y_c, x_c) in y_row.iter_mut().zip(x_row) {
                        *y_c += factor * x_c;
                    }
                }
            }
        }
    }
}
