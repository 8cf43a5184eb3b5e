//! Record-level sign flips: a test that asks of the noise only symmetry between records.
//!
//! Under θ_j = 0 the score s_r of record r on a candidate's directions is as likely as −s_r, whatever the colour and the
//! channels' correlation inside the record. T(ε) = ŝᵀ(Σ_r s_r s_rᵀ)⁻¹ŝ with ŝ = Σ ε_r s_r is compared with its value at
//! ε = 1; the denominator does not change under flips, so this is the studentized form. The maximum over candidates under
//! common flips gives p-values that control the family-wise error without Holm's price for correlated candidates.
//!
//! Limits: the smallest p is 2/2^R with R records (1/2^R for one admissible sign); at least 8 records are asked for.
//! References: Hemerik, Goeman & Finos (2020) for flipped effective scores; Westfall & Young (1993) for the maximum.

use super::constants::STATS;
use super::dist::{f_sf, z_of_two_sided};
use super::error::StatsError;
use super::score::{ScoreTest, Sign};
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;

/// p-values by sign flips, per candidate in the order of the score test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SignFlip {
    /// Raw p; 1 for absorbed candidates and those with more directions than records allow.
    pub p: Vec<f64>,
    /// Adjusted for all candidates by the maximum statistic.
    pub p_adjusted: Vec<f64>,
    /// Patterns tried, the identity included.
    pub patterns: usize,
    /// Whether these were all there are.
    pub exact: bool,
}

/// Runs the sign-flip test; `draws` random patterns beyond 12 records, all of them up to 12.
///
/// # Errors
/// Fewer than eight records.
pub fn sign_flip(test: &ScoreTest, draws: usize, seed: u64) -> Result<SignFlip, StatsError> {
    let records = test.record_scores.first().map_or(0, DMatrix::ncols);
    if records < STATS.flip_records {
        return Err(StatsError::TooFew { what: "records", found: records, needed: STATS.flip_records });
    }
    let statistics: Vec<Statistic> =
        test.record_scores.iter().zip(&test.signs).map(|(scores, sign)| Statistic::new(scores, *sign)).collect();
    let mut signs = vec![1.0; records];
    let observed: Vec<f64> = statistics.iter().map(|s| s.eval(&signs)).collect();
    let exact = records <= STATS.exhaustive_records;
    let patterns = if exact { 1 << records } else { draws + 1 };
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut beaten = vec![(0_usize, 0_usize); observed.len()];
    for pattern in 0..patterns {
        for (r, sign) in signs.iter_mut().enumerate() {
            let flip = if exact { pattern >> r & 1 == 1 } else { pattern > 0 && rng.random_bool(0.5) };
            *sign = if flip { -1.0 } else { 1.0 };
        }
        let values: Vec<f64> = statistics.iter().map(|s| s.eval(&signs)).collect();
        let top = values.iter().copied().fold(0.0, f64::max);
        for ((count, value), seen) in beaten.iter_mut().zip(&values).zip(&observed) {
            // A hair of slack: the mirror pattern gives the same statistic up to round-off.
            let bar = seen * (1.0 - STATS.flip_slack);
            count.0 += usize::from(*value >= bar);
            count.1 += usize::from(top >= bar);
        }
    }
    let share = |n: usize| n as f64 / patterns as f64;
    let p = beaten.iter().map(|c| share(c.0)).collect();
    let p_adjusted = beaten.iter().map(|c| share(c.1)).collect();
    Ok(SignFlip { p, p_adjusted, patterns, exact })
}

/// A candidate's statistic, on a scale common to all: |z| of the Hotelling (t for one direction) tail.
struct Statistic {
    /// L⁻¹ s_r with L Lᵀ = Σ s_r s_rᵀ (rank × records); none where singular.
    whitened: Option<DMatrix<f64>>,
    sign: Sign,
}

impl Statistic {
    fn new(scores: &DMatrix<f64>, sign: Sign) -> Self {
        let usable = scores.nrows() > 0 && scores.ncols() > scores.nrows() + 1;
        let factor = if usable { Cholesky::new(scores * scores.transpose()) } else { None };
        let whitened = factor.and_then(|c| c.l().solve_lower_triangular(scores));
        Self { whitened, sign: if scores.nrows() == 1 { sign } else { Sign::Any } }
    }

    fn eval(&self, signs: &[f64]) -> f64 {
        let Some(scores) = &self.whitened else { return 0.0 };
        let sum = scores * DVector::from_column_slice(signs);
        if !self.sign.admits(sum[0]) {
            return 0.0;
        }
        let (rank, records) = (scores.nrows() as f64, scores.ncols() as f64);
        let squared = sum.norm_squared();
        let f = (records - rank) / rank * squared / (records - squared).max(1e-12);
        let p = f_sf(f, rank, records - rank);
        if p > 0.0 { z_of_two_sided(p) } else { STATS.beyond_z + f.ln() }
    }
}
