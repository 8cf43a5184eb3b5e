//! LU factorization inside a block band, without pivoting.

use crate::band::many::Triangles;
use crate::band::sweep::Band;
use crate::constants::LINALG;
use crate::pivot::sum_abs;
use crate::{KktError, NodeLayout, NodeMatrix};
use pulp::{Arch, Simd, WithSimd};

/// A = L U with U unit upper (Crout's form), in the row storage of [`crate::band::sweep`].
///
/// Without pivoting there is no fill outside the block band. That is safe for matrices near a positive definite one, which a
/// step's are; each row's pivot and growth are checked, and one step of refinement restores full accuracy.
#[derive(Clone, Debug)]
pub(crate) struct BandLu<const B: usize> {
    band: Band<B>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    inverse: Vec<f64>,
    work: Vec<f64>,
}

impl<const B: usize> BandLu<B> {
    pub fn new(n_blocks: usize, half_width: usize) -> Self {
        let band = Band { n_blocks, half_width };
        let triangle = vec![0.0; band.dim() * band.width()];
        let work = vec![0.0; B * B * (2 * half_width + 1)];
        Self { band, lower: triangle.clone(), upper: triangle, inverse: vec![0.0; band.dim()], work }
    }

    pub fn refactor(&mut self, a: &NodeMatrix) -> Result<(), KktError> {
        struct Run<'a, const B: usize>(&'a mut BandLu<B>, &'a NodeMatrix);
        impl<const B: usize> WithSimd for Run<'_, B> {
            type Output = Result<(), KktError>;
            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> Self::Output {
                let Self(factor, a) = self;
                let band = factor.band;
                // not by a closure, which would be compiled without the wide vectors
                match band.half_width {
                    2 => factor.eliminate(Band { half_width: 2, ..band }, a),
                    1 => factor.eliminate(Band { half_width: 1, ..band }, a),
                    _ => factor.eliminate(band, a),
                }
            }
        }
        Arch::new().dispatch(Run(self, a))
    }

    /// Node by node: the rows of node i are reduced by all earlier rows of the band, then by one another.
    #[inline(always)]
    fn eliminate(&mut self, band: Band<B>, a: &NodeMatrix) -> Result<(), KktError> {
        let (width, half) = (band.width(), B * band.half_width);
        let row_len = 2 * half + B;
        for i in 0..band.n_blocks {
            self.work.copy_from_slice(&a.data()[B * i * row_len..(B * i + B) * row_len]);
            let size: [f64; B] = std::array::from_fn(|b| sum_abs(&self.work[b * row_len..(b + 1) * row_len]));
            for j in i.saturating_sub(band.half_width)..i {
                let first = half - B * (i - j); // where node j's columns start in node i's rows
                let upper = &self.upper[B * j * width..(B * j + B) * width];
                for row in self.work.chunks_exact_mut(row_len) {
                    reduce_by_node::<B>(&mut row[first..], width, upper);
                }
            }
            for c in 0..B {
                self.pivot(band, B * i + c, size[c])?;
                let upper = &self.upper[(B * i + c) * width..(B * i + c + 1) * width];
                for row in self.work.chunks_exact_mut(row_len).skip(c + 1) {
                    let factor = row[half + c];
                    subtract(&mut row[half + 1..], factor, upper);
                }
            }
            for c in 0..B {
                let lower = &mut self.lower[(B * i + c) * width..(B * i + c + 1) * width];
                lower.copy_from_slice(&self.work[c * row_len..c * row_len + width]);
                lower[half + c..].fill(0.0);
            }
        }
        Ok(())
    }

    /// Checks the pivot of the reduced row `r`, and stores its reciprocal and the row of U.
    #[inline(always)]
    fn pivot(&mut self, band: Band<B>, r: usize, size: f64) -> Result<(), KktError> {
        let (width, half, c) = (band.width(), B * band.half_width, r % B);
        let row_len = 2 * half + B;
        let row = &self.work[c * row_len + half..(c + 1) * row_len]; // from the own node's first column on
        let pivot = row[c];
        let grown = sum_abs(&row[c..]);
        // written so that NaN fails
        let sound = pivot.abs() > LINALG.pivot_floor * size && grown <= LINALG.growth_limit * size;
        if !sound {
            return Err(breakdown(r, band.dim(), pivot, size, grown));
        }
        let inverse = 1.0 / pivot;
        self.inverse[r] = inverse;
        let upper = &mut self.upper[r * width..(r + 1) * width];
        for (u, x) in upper.iter_mut().zip(&row[1..]) {
            *u = x * inverse;
        }
        upper[..c].fill(0.0);
        Ok(())
    }

    /// Whether all pivots are.
    pub fn all_positive(&self) -> bool {
        self.inverse.iter().all(|x| *x > 0.0)
    }

    /// Both triangles, for many right-hand sides in the system's order.
    fn triangles(&self) -> Triangles<'_, B> {
        Triangles { band: self.band, lower: &self.lower, inverse: &self.inverse, upper: &self.upper }
    }

    /// `B ← A⁻¹ B` or `A⁻ᵀ B` for `B` in the system's order, row-major with `columns`.
    pub fn solve_many(&self, layout: &NodeLayout, b: &mut [f64], columns: usize, transpose: bool) {
        self.triangles().solve(layout, b, columns, transpose);
    }

    /// Writes A⁻ᵀ into the first of `columns` of `out`, row-major in the system's order, and zero into the others.
    pub fn transposed_inverse(&self, layout: &NodeLayout, out: &mut [f64], columns: usize) {
        self.triangles().transposed_inverse(layout, out, columns);
    }

    /// For right-hand sides in storage order.
    pub fn solve(&self, b: &mut [f64], columns: usize, transpose: bool) {
        if transpose {
            self.band.solve_upper_transpose(&self.upper, b, columns);
            self.band.solve_lower_transpose(&self.lower, &self.inverse, b, columns);
        } else {
            self.band.solve_lower(&self.lower, &self.inverse, b, columns);
            self.band.solve_upper(&self.upper, b, columns);
        }
    }
}

/// Reduces a row, given from the first column of an earlier node on, by the rows of U of that node. They start at the
/// node's second column, and are zero up to their own.
#[inline(always)]
fn reduce_by_node<const B: usize>(row: &mut [f64], width: usize, upper: &[f64]) {
    match width {
        8 => reduce_by_fixed::<B, 8>(row, upper),
        5 => reduce_by_fixed::<B, 5>(row, upper),
        11 => reduce_by_fixed::<B, 11>(row, upper),
        7 => reduce_by_fixed::<B, 7>(row, upper),
        _ => {
            for (c, upper) in upper.chunks_exact(width).enumerate() {
                let factor = row[c];
                subtract(&mut row[1..], factor, upper);
            }
        }
    }
}

/// The same with the row in registers.
#[inline(always)]
fn reduce_by_fixed<const B: usize, const W: usize>(row: &mut [f64], upper: &[f64]) {
    let (mut factor, rest) = (row[0], &mut row[1..]);
    let (Some(target), Some(upper)) = (rest.first_chunk_mut::<W>(), upper.as_chunks::<W>().0.first_chunk::<B>()) else { return };
    let mut x = *target;
    for c in 0..B {
        for k in 0..W {
            x[k] -= factor * upper[c][k];
        }
        factor = x[c];
    }
    *target = x;
}

/// `row −= factor · upper`, as long as `upper` is.
#[inline(always)]
fn subtract(row: &mut [f64], factor: f64, upper: &[f64]) {
    for (x, u) in row.iter_mut().zip(upper) {
        *x -= factor * u;
    }
}

#[cold]
fn breakdown(row: usize, dim: usize, pivot: f64, size: f64, grown: f64) -> KktError {
    if !size.is_finite() {
        KktError::NotFinite { row, dim }
    } else if pivot.abs() > LINALG.pivot_floor * size || !grown.is_finite() {
        KktError::Growth { row, dim, growth: grown / size }
    } else {
        KktError::Singular { row, dim, pivot, size }
    }
}
