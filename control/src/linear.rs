//! Dense products, Cholesky factors and row norms on one thread. Callers run columns side by side, so a product never splits itself.

use std::ops::Range;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve;
use faer::{Accum, Conj, Mat, MatMut, MatRef, Par};

/// Pivot of a Cholesky factor, in the diagonal entry it began as \[-\], below which the matrix counts as singular: rounding of the
/// products that form the matrix.
const PIVOT_FLOOR: f64 = 1e-14;

/// a b.
pub(crate) fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(out.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
    out
}

/// out += alpha a b.
pub(crate) fn add_product(out: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>, alpha: f64) {
    matmul(out, Accum::Add, a, b, alpha, Par::Seq);
}

/// out = a b.
pub(crate) fn set_product(out: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    matmul(out, Accum::Replace, a, b, 1.0, Par::Seq);
}

/// Lower triangle of out += a b, where a b is symmetric.
pub(crate) fn add_symmetric_product(out: MatMut<'_, f64>, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(out, lower, Accum::Add, a, full, b, full, 1.0, Par::Seq);
}

/// Copies the lower triangle into the upper one.
pub(crate) fn mirror(a: &mut Mat<f64>) {
    for c in 0..a.ncols() {
        for r in c + 1..a.nrows() {
            a[(c, r)] = a[(r, c)];
        }
    }
}

/// A x for a vector x.
pub(crate) fn apply(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.nrows()];
    add_applied(&mut out, a, x, 1.0);
    out
}

/// out += alpha A x for vectors.
pub(crate) fn add_applied(out: &mut [f64], a: &Mat<f64>, x: &[f64], alpha: f64) {
    for (c, &x) in x.iter().enumerate() {
        let scaled = alpha * x;
        for (out, &a) in out.iter_mut().zip(a.col_as_slice(c)) {
            *out += scaled * a;
        }
    }
}

/// Sum over the blocks of columns of the Euclidean norm of each row.
pub(crate) fn row_norms(a: &Mat<f64>, blocks: &[Range<usize>]) -> Vec<f64> {
    let mut sums = vec![0.0; a.nrows()];
    let mut squares = vec![0.0; a.nrows()];
    for block in blocks {
        squares.fill(0.0);
        for c in block.clone() {
            for (square, &a) in squares.iter_mut().zip(a.col_as_slice(c)) {
                *square += a * a;
            }
        }
        for (sum, square) in sums.iter_mut().zip(&squares) {
            *sum += square.sqrt();
        }
    }
    sums
}

/// Whether every entry is finite.
pub(crate) fn is_finite(a: &Mat<f64>) -> bool {
    (0..a.ncols()).all(|c| a.col_as_slice(c).iter().all(|a| a.is_finite()))
}

/// Factor L of a symmetric positive definite matrix L Lᵀ.
pub(crate) struct Cholesky {
    l: Mat<f64>,
}

impl Cholesky {
    /// Reads the lower triangle of `a`.
    ///
    /// # Errors
    /// The number of the pivot that is not positive.
    pub(crate) fn new(a: Mat<f64>) -> Result<Self, usize> {
        let n = a.nrows();
        let sizes: Vec<f64> = (0..n).map(|i| a[(i, i)]).collect();
        let mut l = a;
        let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        match llt::factor::cholesky_in_place(l.as_mut(), Default::default(), Par::Seq, stack, Default::default()) {
            Err(llt::factor::LltError::NonPositivePivot { index }) => return Err(index),
            Ok(_) => (),
        }
        // faer accepts pivots that are rounding
        let is_sound = |i: usize| l[(i, i)].powi(2) > PIVOT_FLOOR * sizes[i];
        match (0..n).find(|&i| !is_sound(i)) {
            Some(index) => Err(index),
            None => Ok(Self { l }),
        }
    }

    /// b ← (L Lᵀ)⁻¹ b.
    pub(crate) fn solve(&self, b: MatMut<'_, f64>) {
        let mut memory = MemBuffer::new(llt::solve::solve_in_place_scratch::<f64>(self.l.nrows(), b.ncols(), Par::Seq));
        llt::solve::solve_in_place_with_conj(self.l.as_ref(), Conj::No, b, Par::Seq, MemStack::new(&mut memory));
    }
}

/// Factor L of a symmetric positive semidefinite matrix L Lᵀ, row by row of its largest pivots: what is left below rounding is zero.
pub(crate) struct SemidefiniteCholesky {
    /// Rows in the matrix's order; as many columns as it has rank.
    l: Mat<f64>,
    /// Rows of the pivots.
    order: Vec<usize>,
}

impl SemidefiniteCholesky {
    pub(crate) fn new(a: &Mat<f64>) -> Self {
        let n = a.nrows();
        let mut left: Vec<f64> = (0..n).map(|i| a[(i, i)]).collect();
        let floor = PIVOT_FLOOR * left.iter().fold(0.0_f64, |most, d| most.max(*d));
        let (mut l, mut order) = (Mat::zeros(n, n), Vec::new());
        for k in 0..n {
            let Some((pivot, &largest)) = left.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { break };
            if largest <= floor {
                break;
            }
            let mut column = a.col_as_slice(pivot).to_vec();
            for p in 0..k {
                let by: f64 = l[(pivot, p)];
                column.iter_mut().zip(l.col_as_slice(p)).for_each(|(c, l)| *c -= by * l);
            }
            order.iter().for_each(|&row: &usize| column[row] = 0.0);
            let root = largest.sqrt();
            column.iter_mut().for_each(|c| *c /= root);
            column[pivot] = root;
            left.iter_mut().zip(&column).for_each(|(left, c)| *left -= c * c);
            // taken, whatever rounding leaves
            left[pivot] = f64::NEG_INFINITY;
            l.col_as_slice_mut(k).copy_from_slice(&column);
            order.push(pivot);
        }
        let l = l.as_ref().subcols(0, order.len()).to_owned();
        Self { l, order }
    }

    /// L.
    pub(crate) fn into_factor(self) -> Mat<f64> {
        self.l
    }

    /// X with (L Lᵀ) X = B in the rows of pivots, and zero in the others, which say nothing that these do not.
    pub(crate) fn solve(&self, b: &Mat<f64>) -> Mat<f64> {
        let rank = self.order.len();
        let l = Mat::from_fn(rank, rank, |r, c| self.l[(self.order[r], c)]);
        let mut x = Mat::from_fn(rank, b.ncols(), |r, c| b[(self.order[r], c)]);
        triangular_solve::solve_lower_triangular_in_place(l.as_ref(), x.as_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(l.transpose(), x.as_mut(), Par::Seq);
        let mut out = Mat::zeros(b.nrows(), b.ncols());
        for (r, &row) in self.order.iter().enumerate() {
            (0..b.ncols()).for_each(|c| out[(row, c)] = x[(r, c)]);
        }
        out
    }
}
