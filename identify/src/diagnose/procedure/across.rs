//! The errors of a model on records left out.
//!
//! They come from one linearization at the optimum. With a record's whitened sensitivities G_r (its own starting state projected off), its
//! residual r_r, s_r = G_rᵀr_r, s = Σ s_r (zero where the fit has ended) and G = Σ G_rᵀG_r, the estimates without record r move by
//! δ = (G − G_rᵀG_r)⁻¹ (s − s_r), and its squares are then |r_r − G_r δ|².

use super::super::policy::POLICY;
use super::super::scores::reduce;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::Plan;
use crate::stats::reduced::Reduced;
use nalgebra::{DMatrix, DVector};

/// Sums of one measured record.
struct Sums {
    gram: DMatrix<f64>,
    score: DVector<f64>,
    square: f64,
}

fn by_record(reduced: &Reduced) -> Vec<Sums> {
    let k = reduced.columns();
    let none = || Sums { gram: DMatrix::zeros(k, k), score: DVector::zeros(k), square: 0.0 };
    let mut out: Vec<Sums> = (0..reduced.records()).map(|_| none()).collect();
    for block in reduced.blocks() {
        let sums = &mut out[block.record];
        sums.gram += &block.gram;
        sums.score += &block.score;
        sums.square += block.square;
    }
    out
}

/// A⁺ b with the coordinates made of equal influence first.
pub(in super::super) fn solved(a: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = b.len();
    if n == 0 {
        return DVector::zeros(0);
    }
    let lengths = DVector::from_fn(n, |j, _| a[(j, j)].max(0.0).sqrt());
    let largest = lengths.max();
    let length = |j: usize| if lengths[j] > POLICY.no_column * largest { lengths[j] } else { f64::INFINITY };
    let unit = DMatrix::from_fn(n, n, |i, j| a[(i, j)] / (length(i) * length(j)));
    let right = DVector::from_fn(n, |j, _| b[j] / length(j));
    let x = unit.svd(true, true).solve(&right, POLICY.undetermined).unwrap_or_else(|_| DVector::zeros(n));
    DVector::from_fn(n, |j, _| x[j] / length(j))
}

/// Whitened squares of every measured record of a fit under the estimates of all others.
pub(super) fn left_out(plan: &Plan, fitted: &Fitted) -> Result<Vec<f64>, IdentifyError> {
    let reduced = reduce(plan, fitted, &fitted.unknowns)?;
    Ok(of_sums(&reduced.gram(), &by_record(&reduced)))
}

/// Squares of every record under the estimates of all others; `whole`: the sum of all curvatures.
fn of_sums(whole: &DMatrix<f64>, records: &[Sums]) -> Vec<f64> {
    let score = records.iter().fold(DVector::zeros(whole.nrows()), |sum, r| sum + &r.score);
    let one = |r: &Sums| {
        let moved = solved(&(whole - &r.gram), &(&score - &r.score));
        r.square - 2.0 * moved.dot(&r.score) + moved.dot(&(&r.gram * &moved))
    };
    records.iter().map(one).collect()
}

/// Whether the second list of squares is smaller by one standard error of the differences between records, of which those below `nothing` are none.
/// With one record, whether it is smaller. A gain on one record that no other contradicts is one standard error: an effect that a single record
/// shows, as a limit that only its commands reach.
pub(super) fn better(before: &[f64], after: &[f64], nothing: f64) -> bool {
    let counts = |d: f64| if d.abs() < nothing { 0.0 } else { d };
    let d: Vec<f64> = before.iter().zip(after).map(|(b, a)| counts(b - a)).collect();
    let n = d.len() as f64;
    let mean = d.iter().sum::<f64>() / n;
    let variance = d.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    mean > 0.0 && mean * (1.0 + POLICY.rounding) >= (variance / n).sqrt()
}

/// Part of the squares that the second list leaves away.
pub(super) fn share(before: &[f64], after: &[f64]) -> f64 {
    1.0 - after.iter().sum::<f64>() / before.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a linear law the squares on a record left out are those of a fit of the others, whether the fit of all has ended or not.
    #[test]
    fn a_linear_law_left_out_is_refitted_exactly() {
        let noise = crate::stats::testing::gaussians(40, 3);
        let record = |r: usize| -> Vec<[f64; 3]> {
            (0..10)
                .map(|t| {
                    let x = 0.3 * t as f64 + r as f64;
                    [x.sin(), x, 2.0 * x.sin() - 0.5 * x + noise[10 * r + t]]
                })
                .collect()
        };
        let fit = |rows: &[[f64; 3]]| {
            let a = DMatrix::from_fn(rows.len(), 2, |i, j| rows[i][j]);
            let b = DVector::from_fn(rows.len(), |i, _| rows[i][2]);
            (a.transpose() * &a).cholesky().map(|c| c.solve(&(a.transpose() * b))).unwrap_or_default()
        };
        let left = |rows: &[[f64; 3]], by: &DVector<f64>| -> Vec<f64> {
            rows.iter().map(|r| r[2] - r[0] * by[0] - r[1] * by[1]).collect()
        };
        let records: Vec<Vec<[f64; 3]>> = (0..4).map(record).collect();
        let best = fit(&records.concat()) + DVector::from_vec(vec![0.3, -0.2]);
        let sums: Vec<Sums> = records
            .iter()
            .map(|rows| {
                let (g, e) = (DMatrix::from_fn(10, 2, |i, j| rows[i][j]), DVector::from_vec(left(rows, &best)));
                Sums { gram: g.transpose() * &g, score: g.transpose() * &e, square: e.norm_squared() }
            })
            .collect();
        let whole = sums.iter().fold(DMatrix::zeros(2, 2), |sum, r| sum + &r.gram);
        for (r, found) in of_sums(&whole, &sums).into_iter().enumerate() {
            let others: Vec<[f64; 3]> =
                records.iter().enumerate().filter(|(k, _)| *k != r).flat_map(|(_, rows)| rows.clone()).collect();
            let truth: f64 = left(&records[r], &fit(&others)).iter().map(|e| e * e).sum();
            assert!((found / truth - 1.0).abs() < 1e-9, "{found} {truth}");
        }
    }

    /// A gain on one record alone is none if others lose, be it little; if they stay what they were, but for less than a unit, it is one.
    #[test]
    fn a_gain_on_one_record_is_none_where_others_lose() {
        assert!(better(&[50.0, 60.0, 70.0], &[30.0, 40.0, 60.0], 1.0));
        assert!(!better(&[50.0, 60.0, 700.0], &[51.0, 61.0, 55.0], 1.0));
        assert!(better(&[50.0, 60.0, 700.0], &[50.9, 60.0 + 1e-7, 55.0], 1.0));
        assert!(!better(&[50.0, 60.0, 700.0], &[50.9, 60.0 + 1e-7, 55.0], 0.0));
        assert!(better(&[2.0], &[1.0], 0.0) && !better(&[1.0], &[1.0], 0.0) && !better(&[2.0, 3.0], &[1.5, 2.5], 1.0));
        assert!((share(&[2.0, 2.0], &[1.0, 2.0]) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn a_coordinate_without_influence_does_not_move() {
        let a = DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 0.0]);
        assert_eq!(solved(&a, &DVector::from_vec(vec![2.0, 1.0])).as_slice(), [0.5, 0.0]);
    }
}
