//! Columns of a matrix, 64 at a time, which one pass over a factor changes in registers.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use pulp::Simd;

/// Columns of a panel, which one pass over a matrix changes in registers.
pub(crate) const PANEL: usize = 64;

/// Some of the columns of a row-major matrix, a row after the other, those that are missing zero.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel(Vec<[f64; PANEL]>);

impl Panel {
    /// Columns `first` to `first + PANEL` of the row-major `b`, as far as they exist.
    #[inline(always)]
    pub(crate) fn load(&mut self, b: &[f64], columns: usize, first: usize) {
        let count = (columns - first).min(PANEL);
        self.0.resize(b.len() / columns, [0.0; PANEL]);
        for (row, b) in self.0.iter_mut().zip(b.chunks_exact(columns)) {
            match b[first..first + count].first_chunk() {
                Some(whole) => *row = *whole,
                None => {
                    row[..count].copy_from_slice(&b[first..first + count]);
                    row[count..].fill(0.0);
                }
            }
        }
    }

    /// Writes the columns back.
    #[inline(always)]
    pub(crate) fn store(&self, b: &mut [f64], columns: usize, first: usize) {
        let count = (columns - first).min(PANEL);
        for (row, b) in self.0.iter().zip(b.chunks_exact_mut(columns)) {
            match b[first..first + count].first_chunk_mut() {
                Some(whole) => *whole = *row,
                None => b[first..first + count].copy_from_slice(&row[..count]),
            }
        }
    }

    #[inline(always)]
    pub(crate) fn rows(&mut self) -> &mut [[f64; PANEL]] {
        &mut self.0
    }
}

/// `y ← (y − Σ_k factors_k x_k) scale` in the first `used` numbers of the rows, rounded up to whole vectors.
#[inline(always)]
pub(crate) fn reduce_row<S: Simd>(simd: S, y: &mut [f64; PANEL], factors: &[f64], x: &[[f64; PANEL]], scale: f64, used: usize) {
    match used.div_ceil(S::F64_LANES) {
        0 => {}
        1 => reduce_part::<S, 1>(simd, y, factors, x, scale, 0),
        2 => reduce_part::<S, 2>(simd, y, factors, x, scale, 0),
        3..=4 => reduce_part::<S, 4>(simd, y, factors, x, scale, 0),
        5..=8 => reduce_part::<S, 8>(simd, y, factors, x, scale, 0),
        n => {
            // narrow vectors: eight at a time
            for first in (0..n).step_by(8) {
                reduce_part::<S, 8>(simd, y, factors, x, scale, first);
            }
        }
    }
}

/// [`reduce_row`] for `N` vectors from number `first` on.
#[inline(always)]
fn reduce_part<S: Simd, const N: usize>(
    simd: S,
    y: &mut [f64; PANEL],
    factors: &[f64],
    x: &[[f64; PANEL]],
    scale: f64,
    first: usize,
) {
    let y = &mut S::as_mut_simd_f64s(y).0[first..first + N];
    let mut sums = [simd.splat_f64s(0.0); N];
    sums.copy_from_slice(y);
    for (factor, x) in factors.iter().zip(x) {
        let (factor, x) = (simd.splat_f64s(*factor), &S::as_simd_f64s(x).0[first..first + N]);
        for k in 0..N {
            sums[k] = simd.negate_mul_add_e_f64s(factor, x[k], sums[k]);
        }
    }
    let scale = simd.splat_f64s(scale);
    for k in 0..N {
        y[k] = simd.mul_f64s(sums[k], scale);
    }
}
