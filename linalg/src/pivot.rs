//! Which pivots are trusted.

/// Sum of magnitudes, in sixteen lanes; not finite if any entry is not.
#[inline(always)]
pub(crate) fn sum_abs(row: &[f64]) -> f64 {
    let (pieces, rest) = row.as_chunks::<16>();
    let mut lanes = [0.0; 16];
    for piece in pieces {
        for (lane, x) in lanes.iter_mut().zip(piece) {
            *lane += x.abs();
        }
    }
    for (lane, x) in lanes.iter_mut().zip(rest) {
        *lane += x.abs();
    }
    let mut eight: [f64; 8] = std::array::from_fn(|k| lanes[k] + lanes[k + 8]);
    for half in [4, 2, 1] {
        (0..half).for_each(|k| eight[k] += eight[k + half]);
    }
    eight[0]
}
