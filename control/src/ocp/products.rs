//! Products of faer's matrices, on one thread.

use faer::linalg::matmul::matmul;
use faer::{Accum, ColMut, ColRef, MatMut, MatRef, Par};

/// `c += A B` or `c = A B`.
pub(super) fn multiply(c: MatMut<'_, f64>, accum: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    if a.ncols() > 0 || accum == Accum::Replace {
        matmul(c, accum, a, b, 1.0, Par::Seq);
    }
}

/// `y += scale · A x`.
pub(super) fn add_to(y: &mut [f64], scale: f64, a: MatRef<'_, f64>, x: &[f64]) {
    if a.nrows() > 0 && a.ncols() > 0 {
        matmul(ColMut::from_slice_mut(y), Accum::Add, a, ColRef::from_slice(x), scale, Par::Seq);
    }
}
