//! Normal equations with one block per record and a common border.

use nalgebra::{Cholesky, DMatrix, DVector};

/// One record's share: `[own | common]` blocks of JᵀJ and Jᵀr.
#[derive(Clone, Debug)]
pub(crate) struct Share {
    pub own: DMatrix<f64>,
    pub border: DMatrix<f64>,
    pub common: DMatrix<f64>,
    pub own_rhs: DVector<f64>,
    pub common_rhs: DVector<f64>,
}

impl Share {
    /// From whitened rows: residual, own (rows × m) and common (rows × k) derivatives; a standard normal prior on own unknowns
    /// at `z` is included.
    pub(crate) fn new(residual: &[f64], own: &[f64], m: usize, common: &[f64], k: usize, z: &[f64]) -> Self {
        let rows = residual.len();
        let mut j = DMatrix::zeros(rows, m + k);
        for r in 0..rows {
            for c in 0..m {
                j[(r, c)] = own[r * m + c];
            }
            for c in 0..k {
                j[(r, m + c)] = common[r * k + c];
            }
        }
        let r = DVector::from_column_slice(residual);
        let gram = j.tr_mul(&j);
        let rhs = j.tr_mul(&r);
        let mut own = gram.view((0, 0), (m, m)).into_owned();
        let mut own_rhs = rhs.rows(0, m).into_owned();
        for c in 0..m {
            own[(c, c)] += 1.0;
            own_rhs[c] -= z[c];
        }
        Self {
            own,
            border: gram.view((0, m), (m, k)).into_owned(),
            common: gram.view((m, m), (k, k)).into_owned(),
            own_rhs,
            common_rhs: rhs.rows(m, k).into_owned(),
        }
    }

    /// The share of a measured record, from those of its pieces: `[own of each piece | own of all | common]`. The last of the pieces' own unknowns are
    /// the same in all: the record's sizes, now at `z`, whose prior counts once.
    pub(crate) fn joined(pieces: &[Self], z: &[f64]) -> Self {
        if let [one] = pieces {
            return one.clone();
        }
        let n = z.len();
        let starts: Vec<usize> = pieces.iter().map(|p| p.own_rhs.len() - n).collect();
        let all: usize = starts.iter().sum();
        let k = pieces[0].common_rhs.len();
        let mut out = Self {
            own: DMatrix::zeros(all + n, all + n),
            border: DMatrix::zeros(all + n, k),
            common: DMatrix::zeros(k, k),
            own_rhs: DVector::zeros(all + n),
            common_rhs: DVector::zeros(k),
        };
        let mut first = 0;
        for (piece, m) in pieces.iter().zip(&starts) {
            let place = |c: usize| if c < *m { first + c } else { all + c - m };
            for i in 0..m + n {
                for j in 0..m + n {
                    out.own[(place(i), place(j))] += piece.own[(i, j)];
                }
                for j in 0..k {
                    out.border[(place(i), j)] += piece.border[(i, j)];
                }
                out.own_rhs[place(i)] += piece.own_rhs[i];
            }
            out.common += &piece.common;
            out.common_rhs += &piece.common_rhs;
            first += m;
        }
        let again = pieces.len() as f64 - 1.0;
        for (c, z) in z.iter().enumerate() {
            out.own[(all + c, all + c)] -= again;
            out.own_rhs[all + c] += again * z;
        }
        out
    }

    /// Factor of the own block with its diagonal raised by the part `damping`.
    fn factor(&self, damping: f64) -> Option<Cholesky<f64, nalgebra::Dyn>> {
        let mut own = self.own.clone();
        for c in 0..own.nrows() {
            own[(c, c)] *= 1.0 + damping;
        }
        Cholesky::new(own)
    }
}

/// Solves for the common change and every record's own, all diagonals raised by the part `damping`; `held` common unknowns do
/// not move, nor do those that nothing depends on, as a limit that is not reached. `prior` adds (weight, weighted pull) on the common diagonal. `None`
/// if the system is singular.
pub(crate) fn solve(
    shares: &[Share],
    damping: f64,
    prior: &[(f64, f64)],
    held: &[bool],
) -> Option<(DVector<f64>, Vec<DVector<f64>>)> {
    let k = held.len();
    let mut schur = DMatrix::zeros(k, k);
    let mut rhs = DVector::zeros(k);
    let mut factors = Vec::with_capacity(shares.len());
    for share in shares {
        let factor = share.factor(damping)?;
        let gain = factor.solve(&share.border);
        schur += &share.common - share.border.tr_mul(&gain);
        rhs += &share.common_rhs - gain.tr_mul(&share.own_rhs);
        factors.push((factor, gain));
    }
    for (c, (weight, pull)) in prior.iter().enumerate() {
        schur[(c, c)] += weight;
        rhs[c] += pull;
    }
    let silent = |c: usize| prior[c].0 == 0.0 && shares.iter().all(|share| share.common[(c, c)] == 0.0);
    for c in 0..k {
        schur[(c, c)] *= 1.0 + damping;
        if held[c] || silent(c) {
            schur.row_mut(c).fill(0.0);
            schur.column_mut(c).fill(0.0);
            schur[(c, c)] = 1.0;
            rhs[c] = 0.0;
        }
    }
    let common = if k == 0 { DVector::zeros(0) } else { Cholesky::new(schur)?.solve(&rhs) };
    let own = shares.iter().zip(&factors).map(|(s, (f, gain))| f.solve(&s.own_rhs) - gain * &common).collect();
    Some((common, own))
}

/// Decrease of the sum of squares that the linearization foretells of these changes: 2 bᵀδ − δᵀAδ.
pub(crate) fn decrease(shares: &[Share], prior: &[(f64, f64)], common: &DVector<f64>, own: &[DVector<f64>]) -> f64 {
    let one = |(s, z): (&Share, &DVector<f64>)| {
        let curved = z.dot(&(&s.own * z)) + 2.0 * z.dot(&(&s.border * common)) + common.dot(&(&s.common * common));
        2.0 * (s.own_rhs.dot(z) + s.common_rhs.dot(common)) - curved
    };
    let of_prior = prior.iter().zip(common.iter()).map(|((weight, pull), d)| 2.0 * pull * d - weight * d * d);
    shares.iter().zip(own).map(one).sum::<f64>() + of_prior.sum::<f64>()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn rows(piece: usize, columns: usize) -> Vec<f64> {
        (0..12 * columns).map(|k| ((k * (piece + 2)) as f64 * 0.7).sin() + 0.1 * (k % columns) as f64).collect()
    }

    /// What no row depends on stays where it is, and the rest is solved as without it.
    #[test]
    fn an_unknown_without_influence_does_not_move() {
        let both: Vec<f64> = rows(9, 1).into_iter().flat_map(|x| [x, 0.0]).collect();
        let with = [Share::new(&rows(0, 1), &rows(5, 2), 2, &both, 2, &[0.3, -0.2])];
        let without = [Share::new(&rows(0, 1), &rows(5, 2), 2, &rows(9, 1), 1, &[0.3, -0.2])];
        let none = (0.0, 0.0);
        let (common, own) = solve(&with, 1e-6, &[none; 2], &[false; 2]).unwrap();
        let (alone, known) = solve(&without, 1e-6, &[none], &[false]).unwrap();
        assert!((common[0] - alone[0]).abs() < 1e-12 && common[1] == 0.0 && (&own[0] - &known[0]).abs().max() < 1e-12);
    }

    /// Two pieces with a start of their own (2 and 1 numbers) and a size that they share give the equations of all their rows together.
    #[test]
    fn pieces_share_what_is_the_records_own() {
        let (k, z, size) = (2, [[0.3, -0.2], [0.5, 0.0]], 0.4);
        let starts = [2, 1];
        let piece = |p: usize| {
            let m = starts[p] + 1;
            let own = [&z[p][..starts[p]], &[size]].concat();
            Share::new(&rows(p, 1), &rows(p + 5, m), m, &rows(p + 9, k), k, &own)
        };
        let joined = Share::joined(&[piece(0), piece(1)], &[size]);
        // the same by one record whose columns are those of both
        let mut own = vec![0.0; 24 * 4];
        for p in 0..2 {
            let (m, of) = (starts[p] + 1, rows(p + 5, starts[p] + 1));
            for r in 0..12 {
                for c in 0..m {
                    let column = if c == m - 1 { 3 } else { 2 * p + c };
                    own[(12 * p + r) * 4 + column] = of[r * m + c];
                }
            }
        }
        let both = |of: usize, columns: usize| [rows(of, columns), rows(of + 1, columns)].concat();
        let truth = Share::new(&both(0, 1), &own, 4, &both(9, k), k, &[0.3, -0.2, 0.5, size]);
        for (a, b) in [(&joined.own, &truth.own), (&joined.border, &truth.border), (&joined.common, &truth.common)] {
            assert!((a - b).abs().max() < 1e-12);
        }
        assert!((&joined.own_rhs - &truth.own_rhs).abs().max() < 1e-12);
        assert!((&joined.common_rhs - &truth.common_rhs).abs().max() < 1e-12);
        assert_eq!(Share::joined(&[piece(0)], &[size]).own, piece(0).own);
    }
}
