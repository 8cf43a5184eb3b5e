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
/// not move. `prior` adds (weight, weighted pull) on the common diagonal. `None` if the system is singular.
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
    for c in 0..k {
        schur[(c, c)] *= 1.0 + damping;
        if held[c] {
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
