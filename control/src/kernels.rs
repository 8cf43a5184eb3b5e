//! Products of a column-major matrix with a vector, vectorised, four columns at a time.

use faer::MatRef;
use pulp::{Arch, Simd, WithSimd};

/// The first `columns` columns of a matrix stored with `height` numbers a column.
///
/// Of a lower triangle, whose entries above the diagonal are zeros, blocks of four columns start at their first diagonal entry.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub data: &'a [f64],
    pub height: usize,
    pub columns: usize,
    pub lower: bool,
}

impl<'a> Columns<'a> {
    fn block(self, first: usize, from: usize) -> [&'a [f64]; 4] {
        std::array::from_fn(|i| &self.data[(first + i) * self.height + from..(first + i + 1) * self.height])
    }

    fn one(self, column: usize, from: usize) -> &'a [f64] {
        &self.data[column * self.height + from..(column + 1) * self.height]
    }
}

/// `y += scale · A x`.
pub(crate) fn add_product(scale: f64, a: Columns<'_>, x: &[f64], y: &mut [f64]) {
    Arch::new().dispatch(AddProduct { scale, a, x, y });
}

struct AddProduct<'a> {
    scale: f64,
    a: Columns<'a>,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for AddProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { scale, a, x, y } = self;
        let whole = a.columns / 4 * 4;
        for first in (0..whole).step_by(4) {
            let factors: [f64; 4] = std::array::from_fn(|i| scale * x[first + i]);
            if factors == [0.0; 4] {
                continue;
            }
            let from = if a.lower { first } else { 0 };
            let [(c0, t0), (c1, t1), (c2, t2), (c3, t3)] = a.block(first, from).map(S::as_simd_f64s);
            let (body, tail) = S::as_mut_simd_f64s(&mut y[from..a.height]);
            let f = factors.map(|factor| simd.splat_f64s(factor));
            for ((((y, c0), c1), c2), c3) in body.iter_mut().zip(c0).zip(c1).zip(c2).zip(c3) {
                let left = simd.mul_add_f64s(f[0], *c0, simd.mul_add_f64s(f[1], *c1, *y));
                *y = simd.mul_add_f64s(f[2], *c2, simd.mul_add_f64s(f[3], *c3, left));
            }
            for ((((y, c0), c1), c2), c3) in tail.iter_mut().zip(t0).zip(t1).zip(t2).zip(t3) {
                *y += (factors[0] * c0 + factors[1] * c1) + (factors[2] * c2 + factors[3] * c3);
            }
        }
        for (column, x) in x.iter().enumerate().take(a.columns).skip(whole) {
            let from = if a.lower { column } else { 0 };
            let factor = scale * x;
            for (y, c) in y[from..a.height].iter_mut().zip(a.one(column, from)) {
                *y += factor * c;
            }
        }
    }
}

/// `y = Aᵀ x`.
pub(crate) fn transposed_product(a: Columns<'_>, x: &[f64], y: &mut [f64]) {
    Arch::new().dispatch(TransposedProduct { a, x, y });
}

struct TransposedProduct<'a> {
    a: Columns<'a>,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for TransposedProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { a, x, y } = self;
        let whole = a.columns / 4 * 4;
        for first in (0..whole).step_by(4) {
            let from = if a.lower { first } else { 0 };
            let [(c0, t0), (c1, t1), (c2, t2), (c3, t3)] = a.block(first, from).map(S::as_simd_f64s);
            let (body, tail) = S::as_simd_f64s(&x[from..a.height]);
            let mut sums = [simd.splat_f64s(0.0); 4];
            for ((((x, c0), c1), c2), c3) in body.iter().zip(c0).zip(c1).zip(c2).zip(c3) {
                sums[0] = simd.mul_add_f64s(*x, *c0, sums[0]);
                sums[1] = simd.mul_add_f64s(*x, *c1, sums[1]);
                sums[2] = simd.mul_add_f64s(*x, *c2, sums[2]);
                sums[3] = simd.mul_add_f64s(*x, *c3, sums[3]);
            }
            let rest = [t0, t1, t2, t3].map(|t| t.iter().zip(tail).map(|(c, x)| c * x).sum::<f64>());
            for i in 0..4 {
                y[first + i] = simd.reduce_sum_f64s(sums[i]) + rest[i];
            }
        }
        for (column, y) in y.iter_mut().enumerate().take(a.columns).skip(whole) {
            let from = if a.lower { column } else { 0 };
            *y = dot_with(simd, a.one(column, from), &x[from..a.height]);
        }
    }
}

#[inline(always)]
fn dot_with<S: Simd>(simd: S, a: &[f64], b: &[f64]) -> f64 {
    let ((a, ta), (b, tb)) = (S::as_simd_f64s(a), S::as_simd_f64s(b));
    let sum = a.iter().zip(b).fold(simd.splat_f64s(0.0), |sum, (a, b)| simd.mul_add_f64s(*a, *b, sum));
    simd.reduce_sum_f64s(sum) + ta.iter().zip(tb).map(|(a, b)| a * b).sum::<f64>()
}

/// `x ← R⁻¹ x`, or R⁻ᵀ x, of an upper triangle R with as many columns as x has numbers.
pub(crate) fn solve_upper(r: &[f64], height: usize, transposed: bool, x: &mut [f64]) {
    struct Solve<'a>(&'a [f64], usize, bool, &'a mut [f64]);
    impl WithSimd for Solve<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let Self(r, height, transposed, x) = self;
            let column = |j: usize| &r[j * height..j * height + j + 1];
            if transposed {
                for j in 0..x.len() {
                    let (above, column) = (&x[..j], column(j));
                    x[j] = (x[j] - dot_with(simd, &column[..j], above)) / column[j];
                }
                return;
            }
            for j in (0..x.len()).rev() {
                let (column, (above, at)) = (column(j), x.split_at_mut(j));
                at[0] /= column[j];
                let (body, tail) = S::as_mut_simd_f64s(above);
                let (of_body, of_tail) = S::as_simd_f64s(&column[..j]);
                let factor = simd.splat_f64s(-at[0]);
                for (x, r) in body.iter_mut().zip(of_body) {
                    *x = simd.mul_add_f64s(factor, *r, *x);
                }
                for (x, r) in tail.iter_mut().zip(of_tail) {
                    *x -= at[0] * r;
                }
            }
        }
    }
    Arch::new().dispatch(Solve(r, height, transposed, x));
}

/// aᵀ b.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    struct Dot<'a>(&'a [f64], &'a [f64]);
    impl WithSimd for Dot<'_> {
        type Output = f64;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> f64 {
            dot_with(simd, self.0, self.1)
        }
    }
    Arch::new().dispatch(Dot(a, b))
}

/// Place of a number that is not finite. The sum of squares of a column that lies contiguously is finite if its numbers are, but for
/// overflow: only where it is not are they looked at one by one.
pub(crate) fn not_finite(m: MatRef<'_, f64>) -> Option<(usize, usize)> {
    (0..m.ncols()).find_map(|j| {
        let column = m.col(j);
        let sound = column.try_as_col_major().is_some_and(|column| dot(column.as_slice(), column.as_slice()).is_finite());
        if sound { None } else { column.iter().position(|value| !value.is_finite()).map(|i| (i, j)) }
    })
}

/// |a|₂.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Largest |aᵢ|; 0 of no numbers.
pub(crate) fn largest(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |most, a| f64::max(most, a.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_inverted() {
        let (n, height) = (21, 25);
        let entry = |i: usize, j: usize| if i == j { 8.0 } else { ((5 * i + 3 * j) % 7) as f64 - 3.0 };
        let r: Vec<f64> = (0..n).flat_map(|j| (0..height).map(move |i| if i <= j { entry(i, j) } else { f64::NAN })).collect();
        let b: Vec<f64> = (0..n).map(|i| i as f64 - 7.0).collect();
        for transposed in [false, true] {
            let mut x = b.clone();
            solve_upper(&r, height, transposed, &mut x);
            for (i, b) in b.iter().enumerate() {
                let term = |j: usize| if transposed { entry(j, i) * x[j] } else { entry(i, j) * x[j] };
                let sum: f64 = if transposed { (0..=i).map(term).sum() } else { (i..n).map(term).sum() };
                assert!((sum - b).abs() < 1e-11, "{transposed} {i} {sum}");
            }
        }
    }

    /// Both products against plain sums, at heights and widths that leave rests beside vectors and blocks of columns.
    #[test]
    fn products_agree_with_plain_sums() {
        for (height, columns, lower) in [(1, 1, false), (7, 5, false), (19, 8, false), (23, 23, true), (9, 9, true)] {
            let entry = |i: usize, j: usize| if lower && i < j { 0.0 } else { ((3 * i + 7 * j) % 11) as f64 - 4.0 };
            let data: Vec<f64> = (0..columns).flat_map(|j| (0..height).map(move |i| entry(i, j))).collect();
            let a = Columns { data: &data, height, columns, lower };
            let x: Vec<f64> = (0..columns).map(|j| j as f64 - 2.5).collect();
            let mut y: Vec<f64> = (0..height).map(|i| i as f64).collect();
            add_product(-2.0, a, &x, &mut y);
            for (i, y) in y.iter().enumerate() {
                let sum: f64 = (0..columns).map(|j| entry(i, j) * x[j]).sum();
                assert_eq!(*y, i as f64 - 2.0 * sum);
            }
            let w: Vec<f64> = (0..height).map(|i| 1.5 - i as f64).collect();
            let mut back = vec![f64::NAN; columns];
            transposed_product(a, &w, &mut back);
            for (j, back) in back.iter().enumerate() {
                assert_eq!(*back, (0..height).map(|i| entry(i, j) * w[i]).sum::<f64>());
            }
        }
    }
}
