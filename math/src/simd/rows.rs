//! Loops over the numbers of rows in the processor's vectors, multiplication and addition fused where it can.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use pulp::Simd;
use std::ops::Range;

/// `y −= Σ_i a_i x_i` for four rows, as long as y at least.
#[inline(always)]
pub fn subtract_four<S: Simd>(simd: S, y: &mut [f64], a: [f64; 4], x: [&[f64]; 4]) {
    let n = y.len();
    let [(x0, t0), (x1, t1), (x2, t2), (x3, t3)] =
        [S::as_simd_f64s(&x[0][..n]), S::as_simd_f64s(&x[1][..n]), S::as_simd_f64s(&x[2][..n]), S::as_simd_f64s(&x[3][..n])];
    let [a0, a1, a2, a3] = [simd.splat_f64s(a[0]), simd.splat_f64s(a[1]), simd.splat_f64s(a[2]), simd.splat_f64s(a[3])];
    let change = |y: S::f64s, x0: S::f64s, x1: S::f64s, x2: S::f64s, x3: S::f64s| {
        let y = simd.negate_mul_add_e_f64s(a0, x0, y);
        let y = simd.negate_mul_add_e_f64s(a1, x1, y);
        let y = simd.negate_mul_add_e_f64s(a2, x2, y);
        simd.negate_mul_add_e_f64s(a3, x3, y)
    };
    let (y, rest) = S::as_mut_simd_f64s(y);
    let n = y.len();
    let (x0, x1, x2, x3) = (&x0[..n], &x1[..n], &x2[..n], &x3[..n]);
    for k in 0..n {
        y[k] = change(y[k], x0[k], x1[k], x2[k], x3[k]);
    }
    if !rest.is_empty() {
        let load = |x| simd.partial_load_f64s(x);
        let changed = change(load(rest), load(t0), load(t1), load(t2), load(t3));
        simd.partial_store_f64s(rest, changed);
    }
}

/// `y += x`, equally long.
#[inline(always)]
pub fn add_row<S: Simd>(simd: S, y: &mut [f64], x: &[f64]) {
    let ((y, y_rest), (x, x_rest)) = (S::as_mut_simd_f64s(y), S::as_simd_f64s(x));
    for (y, x) in y.iter_mut().zip(x) {
        *y = simd.add_f64s(*y, *x);
    }
    if !y_rest.is_empty() {
        let sum = simd.add_f64s(simd.partial_load_f64s(y_rest), simd.partial_load_f64s(x_rest));
        simd.partial_store_f64s(y_rest, sum);
    }
}

/// `y = x`, equally long: for rows so short that a call would take longer than copying.
#[inline(always)]
pub fn copy_row<S: Simd>(simd: S, y: &mut [f64], x: &[f64]) {
    let ((y, y_rest), (x, x_rest)) = (S::as_mut_simd_f64s(y), S::as_simd_f64s(x));
    for (y, x) in y.iter_mut().zip(x) {
        *y = *x;
    }
    if !y_rest.is_empty() {
        simd.partial_store_f64s(y_rest, simd.partial_load_f64s(x_rest));
    }
}

/// `Σ |x_i|`; not finite if any entry is not.
#[inline(always)]
pub fn magnitudes<S: Simd>(simd: S, x: &[f64]) -> f64 {
    let (pairs, rest) = S::as_simd_f64s(x);
    let (pairs, single) = pairs.as_chunks::<2>();
    // two sums, of which none waits for the other
    let mut sums = [simd.splat_f64s(0.0); 2];
    for [a, b] in pairs {
        sums = [simd.add_f64s(sums[0], simd.abs_f64s(*a)), simd.add_f64s(sums[1], simd.abs_f64s(*b))];
    }
    for a in single {
        sums[0] = simd.add_f64s(sums[0], simd.abs_f64s(*a));
    }
    if !rest.is_empty() {
        sums[1] = simd.add_f64s(sums[1], simd.abs_f64s(simd.partial_load_f64s(rest)));
    }
    simd.reduce_sum_f64s(simd.add_f64s(sums[0], sums[1]))
}

/// Rows that [`subtract_from_four`] changes together: each load of x serves them all.
pub const ROWS: usize = 4;

/// `y_r −= Σ_i a_ri x_i` for four rows y, equally long; the first `P` of the factors, x as long as y at least.
#[inline(always)]
pub fn subtract_from_four<S: Simd, const P: usize>(simd: S, y: [&mut [f64]; ROWS], a: &[[f64; 4]; ROWS], x: [&[f64]; P]) {
    let n = y[0].len();
    let mut factors = [[simd.splat_f64s(0.0); P]; ROWS];
    for r in 0..ROWS {
        for i in 0..P {
            factors[r][i] = simd.splat_f64s(a[r][i]);
        }
    }
    let [y0, y1, y2, y3] = y;
    let ((y0, t0), (y1, t1)) = (S::as_mut_simd_f64s(&mut y0[..n]), S::as_mut_simd_f64s(&mut y1[..n]));
    let ((y2, t2), (y3, t3)) = (S::as_mut_simd_f64s(&mut y2[..n]), S::as_mut_simd_f64s(&mut y3[..n]));
    let whole = y0.len();
    let (y1, y2, y3) = (&mut y1[..whole], &mut y2[..whole], &mut y3[..whole]);
    // rows of x that there are not stand for the first, not read; slices of their own are read unchecked
    let wide = |i: usize| &S::as_simd_f64s(&x[i.min(P - 1)][..n]).0[..whole];
    let (x0, x1, x2, x3) = (wide(0), wide(1), wide(2), wide(3));
    for k in 0..whole {
        let mut sums = [y0[k], y1[k], y2[k], y3[k]];
        for (i, x) in [x0[k], x1[k], x2[k], x3[k]].into_iter().enumerate().take(P) {
            for r in 0..ROWS {
                sums[r] = simd.negate_mul_add_e_f64s(factors[r][i], x, sums[r]);
            }
        }
        (y0[k], y1[k], y2[k], y3[k]) = (sums[0], sums[1], sums[2], sums[3]);
    }
    if t0.is_empty() {
        return;
    }
    let mut sums =
        [simd.partial_load_f64s(t0), simd.partial_load_f64s(t1), simd.partial_load_f64s(t2), simd.partial_load_f64s(t3)];
    for i in 0..P {
        let x = simd.partial_load_f64s(S::as_simd_f64s(&x[i][..n]).1);
        for r in 0..ROWS {
            sums[r] = simd.negate_mul_add_e_f64s(factors[r][i], x, sums[r]);
        }
    }
    simd.partial_store_f64s(t0, sums[0]);
    simd.partial_store_f64s(t1, sums[1]);
    simd.partial_store_f64s(t2, sums[2]);
    simd.partial_store_f64s(t3, sums[3]);
}

/// `y ← Σ_i a_i x_i` over rows x of a table, the one numbered `FIRST` and those after it; table and y in pieces of [`PADDING`] columns.
#[inline(always)]
pub fn combine<S: Simd, const K: usize, const FIRST: usize, const ROWS: usize>(
    simd: S,
    y: &mut [[f64; PADDING]],
    a: &[f64; K],
    table: &[[[f64; PADDING]; ROWS]],
) {
    let mut factors = [simd.splat_f64s(0.0); K];
    for (factor, a) in factors.iter_mut().zip(a) {
        *factor = simd.splat_f64s(*a);
    }
    for (y, x) in y.iter_mut().zip(table) {
        let y = S::as_mut_simd_f64s(y).0;
        for (v, y) in y.iter_mut().enumerate() {
            // two sums, of which none waits for the other
            let mut sums = [simd.splat_f64s(0.0); 2];
            for i in 0..K {
                sums[i % 2] = simd.mul_add_e_f64s(factors[i], S::as_simd_f64s(&x[FIRST + i]).0[v], sums[i % 2]);
            }
            *y = simd.add_f64s(sums[0], sums[1]);
        }
    }
}

/// Columns of a piece of the arguments and results of [`combine`]: the longest vectors of a processor.
pub const PADDING: usize = 8;

/// Where a row is not zero: from its first such number to its last, in whole pieces of [`PADDING`] as far as the row goes.
#[inline(always)]
pub fn support(row: &[f64]) -> Range<usize> {
    let nonzero = |piece: &[f64]| piece.iter().fold(false, |some, x| some | (*x != 0.0));
    let mut pieces = row.chunks(PADDING).enumerate().filter(|(_, piece)| nonzero(piece)).map(|(k, _)| k);
    match pieces.next() {
        Some(first) => first * PADDING..((pieces.next_back().unwrap_or(first) + 1) * PADDING).min(row.len()),
        None => 0..0,
    }
}

/// The shortest range that holds both.
pub fn joined(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b.clone(),
        (_, true) => a.clone(),
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

/// Four rows times a column.
#[inline(always)]
pub fn products<S: Simd>(simd: S, rows: [&[f64]; 4], x: &[f64]) -> [f64; 4] {
    let n = x.len();
    let (x, rest) = S::as_simd_f64s(x);
    let [(a, ta), (b, tb), (c, tc), (d, td)] = [
        S::as_simd_f64s(&rows[0][..n]),
        S::as_simd_f64s(&rows[1][..n]),
        S::as_simd_f64s(&rows[2][..n]),
        S::as_simd_f64s(&rows[3][..n]),
    ];
    let zero = simd.splat_f64s(0.0);
    let (mut s, mut t, mut u, mut v) = (zero, zero, zero, zero);
    let n = x.len();
    let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
    for k in 0..n {
        s = simd.mul_add_e_f64s(a[k], x[k], s);
        t = simd.mul_add_e_f64s(b[k], x[k], t);
        u = simd.mul_add_e_f64s(c[k], x[k], u);
        v = simd.mul_add_e_f64s(d[k], x[k], v);
    }
    let mut sums = [simd.reduce_sum_f64s(s), simd.reduce_sum_f64s(t), simd.reduce_sum_f64s(u), simd.reduce_sum_f64s(v)];
    for (k, x) in rest.iter().enumerate() {
        sums[0] += ta[k] * x;
        sums[1] += tb[k] * x;
        sums[2] += tc[k] * x;
        sums[3] += td[k] * x;
    }
    sums
}

/// [`products`] with the numbers beyond whole vectors in one more vector.
#[inline(always)]
pub fn products_in_vectors<S: Simd>(simd: S, rows: [&[f64]; 4], x: &[f64]) -> [f64; 4] {
    let n = x.len();
    let (x, rest) = S::as_simd_f64s(x);
    let [(a, ta), (b, tb), (c, tc), (d, td)] = [
        S::as_simd_f64s(&rows[0][..n]),
        S::as_simd_f64s(&rows[1][..n]),
        S::as_simd_f64s(&rows[2][..n]),
        S::as_simd_f64s(&rows[3][..n]),
    ];
    let zero = simd.splat_f64s(0.0);
    let (mut s, mut t, mut u, mut v) = (zero, zero, zero, zero);
    let n = x.len();
    let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
    for k in 0..n {
        s = simd.mul_add_e_f64s(a[k], x[k], s);
        t = simd.mul_add_e_f64s(b[k], x[k], t);
        u = simd.mul_add_e_f64s(c[k], x[k], u);
        v = simd.mul_add_e_f64s(d[k], x[k], v);
    }
    if !rest.is_empty() {
        let x = simd.partial_load_f64s(rest);
        s = simd.mul_add_e_f64s(simd.partial_load_f64s(ta), x, s);
        t = simd.mul_add_e_f64s(simd.partial_load_f64s(tb), x, t);
        u = simd.mul_add_e_f64s(simd.partial_load_f64s(tc), x, u);
        v = simd.mul_add_e_f64s(simd.partial_load_f64s(td), x, v);
    }
    [simd.reduce_sum_f64s(s), simd.reduce_sum_f64s(t), simd.reduce_sum_f64s(u), simd.reduce_sum_f64s(v)]
}
