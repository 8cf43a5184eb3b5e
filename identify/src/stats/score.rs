//! The score (Rao) test of many candidate causes from one linearization.
//!
//! r = N a + S_j θ_j + e, everything whitened, e ~ (0, φ I) with dispersion φ. With M = I − N N⁺ and U_j = M S_j:
//!
//!   LM_j = r ᵀU_j (U_jᵀU_j)⁻¹ U_jᵀ r / φ  ~ χ²_{k_j} at θ_j = 0
//!   θ̂_j = (U_jᵀU_j)⁻¹ U_jᵀ r,   se = √(φ diag (U_jᵀU_j)⁻¹)      one Gauss–Newton step, units of θ_j
//!   absorbed = 1 − |u|²/|s|²,   smallest detectable size = 5 se,   cosines between the U_j
//!
//! Beside the parametric statistic stands one that does not believe the noise model: the variance of U_jᵀr from the scores
//! of time blocks (and of records, where there are enough), each centred on the score that the fitted size predicts and
//! corrected for its leverage, with Satterthwaite degrees of freedom. The weaker of the two counts.
//!
//! References: Rao (1948); Bell & McCaffrey (2002) for the leverage-corrected cluster variance and its degrees of freedom;
//! Self & Liang (1987) for a parameter on its bound (χ̄²).

use super::basis::Basis;
use super::clusters::Clusters;
use super::constants::STATS;
use super::dist::{chi2_sf, normal_sf, t_two_sided, z_of_two_sided};
use super::error::StatsError;
use super::reduced::Reduced;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Which values of a one-parameter cause are physical.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Sign {
    /// Both.
    Any,
    /// θ ≥ 0 (friction, mass, delay).
    NonNegative,
    /// θ ≤ 0.
    NonPositive,
}

impl Sign {
    /// Whether a value of this size is physical.
    pub fn admits(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::NonNegative => value >= 0.0,
            Self::NonPositive => value <= 0.0,
        }
    }
}

/// A candidate cause: global columns, and the admissible sign where it has just one column (ignored otherwise).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Candidate {
    /// Global columns of its parameters.
    pub columns: Vec<usize>,
    /// Admissible sign.
    pub sign: Sign,
}

impl Candidate {
    /// A one-parameter cause of either sign.
    pub fn scalar(column: usize) -> Self {
        Self { columns: vec![column], sign: Sign::Any }
    }
}

/// Settings of [`score_test`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreOptions {
    /// A direction is dead when its part orthogonal to the nuisance is below this share of its norm.
    pub tolerance: f64,
    /// φ: variance of the whitened noise; 1 where the whitening is trusted.
    pub dispersion: f64,
    /// Cluster variances with fewer effective degrees of freedom are not used.
    pub min_cluster_dof: f64,
    /// Records also serve as clusters from this number on.
    pub min_records: usize,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        Self { tolerance: 1e-7, dispersion: 1.0, min_cluster_dof: 4.0, min_records: 10 }
    }
}

/// Result of the test for one candidate. Vectors are in the order of its columns; dead columns hold θ̂ = 0, se = ∞.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CandidateScore {
    /// Independent directions that the nuisance leaves; 0: the cause is absorbed and nothing can be said.
    pub rank: usize,
    /// Positions (within the candidate's columns) without a direction of their own.
    pub dead: Vec<usize>,
    /// LM, ~ χ²_rank.
    pub lm: f64,
    /// The least LM with one of the time blocks left out.
    pub lm_without_any: f64,
    /// u ᵀr / (|u| √φ), with sign, where rank = 1 and the candidate has one column; else NaN.
    pub t: f64,
    /// θ̂: one-step size.
    pub theta: Vec<f64>,
    /// Step of the nuisance parameters beside it, in the order given (0 for dead ones).
    pub beside: Vec<f64>,
    /// Its standard errors under the noise model.
    pub std_error: Vec<f64>,
    /// Share of each column's squared norm that nuisance directions explain.
    pub absorbed: Vec<f64>,
    /// 5 se: the smallest size that would be seen.
    pub detectable: Vec<f64>,
    /// p of LM: χ²_rank, or χ̄² = ½χ²₀ + ½χ²₁ for one admissible sign (1 for the inadmissible one).
    pub p_parametric: f64,
    /// p with the variance from time blocks; none where they are too few.
    pub p_blocks: Option<f64>,
    /// p with the variance from records; none where they are too few.
    pub p_records: Option<f64>,
    /// The largest of these p-values.
    pub p: f64,
    /// |z| of a two-sided normal test as weak as the weakest of these statistics.
    pub z: f64,
    /// z over the |z| of the parametric statistic, ≤ 1: how much the robust variances take back.
    pub weakening: f64,
    /// Per robust variance: its statistic over the parametric one (at most 1), and its degrees of freedom.
    pub caution: Vec<(f64, f64)>,
    /// Whether θ̂ has an admissible sign.
    pub admissible: bool,
}

/// The test of all candidates on one set of nuisance directions.
#[derive(Debug, Clone)]
pub struct ScoreTest {
    /// Per candidate, in the order given.
    pub candidates: Vec<CandidateScore>,
    /// ρ_jk: signed cosine of two one-direction causes, else the largest principal cosine; 0 where one is absorbed.
    pub cosines: DMatrix<f64>,
    /// Smallest principal cosine over the lesser rank: 1 means that the larger cause contains the smaller one.
    pub containment: DMatrix<f64>,
    /// Nuisance columns (of the list given) that are dead.
    pub dead_nuisance: Vec<usize>,
    /// Squared norm of the residual that the nuisance leaves.
    pub rss: f64,
    /// Rows less all nuisance directions.
    pub dof: f64,
    /// Orthonormal directions of each candidate in the coordinates of the reduced triangle ((k+1) × rank).
    pub(crate) bases: Vec<DMatrix<f64>>,
    /// The residual in the same coordinates, divided by √φ.
    pub(crate) residual: DVector<f64>,
    /// Per candidate: scores of each record on its orthonormal directions (rank × records), divided by √φ.
    pub(crate) record_scores: Vec<DMatrix<f64>>,
    pub(crate) signs: Vec<Sign>,
}

impl ScoreTest {
    /// Fitted contribution of a candidate, P_j r / √φ, in the coordinates of the reduced triangle.
    pub(crate) fn contribution(&self, j: usize) -> DVector<f64> {
        &self.bases[j] * (self.bases[j].transpose() * &self.residual)
    }

    /// LM and p of candidate j with candidate k as additional nuisance; p = 1 where nothing of j is left.
    pub fn conditional(&self, j: usize, k: usize) -> (f64, f64) {
        let mut left = self.bases[j].clone();
        let other = &self.bases[k];
        left -= other * (other.transpose() * &left);
        let basis = Basis::new(&left, &vec![1.0; left.ncols()], STATS.conditional);
        let lm = (basis.q.transpose() * &self.residual).norm_squared();
        (lm, if basis.rank() == 0 { 1.0 } else { chi2_sf(lm, basis.rank() as f64) })
    }
}

/// One candidate's orthonormal directions, and how they are made of global columns.
pub(super) struct Directions {
    pub basis: Basis,
    /// k × rank: directions = G̃ · weights.
    pub weights: DMatrix<f64>,
}

/// Tests every candidate with the nuisance columns (and the records' own nuisance) projected out.
///
/// To test a cause in the presence of accepted ones, add their columns to `nuisance`.
///
/// # Errors
/// A column out of range, a column both nuisance and candidate, or a dispersion that is not positive.
pub fn score_test(
    reduced: &Reduced,
    nuisance: &[usize],
    candidates: &[Candidate],
    options: &ScoreOptions,
) -> Result<ScoreTest, StatsError> {
    check(reduced, nuisance, candidates, options)?;
    let linear = Linear::new(reduced, nuisance, options);
    let scale = options.dispersion.sqrt();
    let mut out = ScoreTest {
        candidates: Vec::with_capacity(candidates.len()),
        cosines: DMatrix::zeros(0, 0),
        containment: DMatrix::zeros(0, 0),
        dead_nuisance: linear.nuisance.dead.iter().map(|&p| nuisance[p]).collect(),
        rss: linear.residual.norm_squared(),
        dof: reduced.rows() as f64 - (reduced.own_rank() + linear.nuisance.rank()) as f64,
        bases: Vec::with_capacity(candidates.len()),
        residual: &linear.residual / scale,
        record_scores: Vec::with_capacity(candidates.len()),
        signs: candidates.iter().map(|c| c.sign).collect(),
    };
    for candidate in candidates {
        let directions = linear.directions(candidate);
        out.record_scores.push(linear.clusters.by_record(&directions) / scale);
        out.candidates.push(linear.score(nuisance, candidate, &directions));
        out.bases.push(directions.basis.q);
    }
    (out.cosines, out.containment) = principal_cosines(&out.bases);
    Ok(out)
}

fn check(reduced: &Reduced, nuisance: &[usize], candidates: &[Candidate], options: &ScoreOptions) -> Result<(), StatsError> {
    let k = reduced.columns();
    let all = nuisance.iter().chain(candidates.iter().flat_map(|c| &c.columns));
    if let Some(&column) = all.clone().find(|c| **c >= k) {
        return Err(StatsError::OutOfRange { what: "column", value: column as f64, range: "0..global columns" });
    }
    let mut seen = vec![false; k];
    nuisance.iter().for_each(|&c| seen[c] = true);
    if let Some(&column) = candidates.iter().flat_map(|c| &c.columns).find(|c| seen[**c]) {
        return Err(StatsError::OutOfRange {
            what: "candidate column",
            value: column as f64,
            range: "columns outside the nuisance",
        });
    }
    if !(options.dispersion > 0.0 && options.dispersion.is_finite()) {
        return Err(StatsError::OutOfRange { what: "dispersion", value: options.dispersion, range: "positive" });
    }
    Ok(())
}

/// The reduced problem with its nuisance projected out.
struct Linear<'a> {
    reduced: &'a Reduced,
    options: &'a ScoreOptions,
    nuisance: Basis,
    /// The triangle with the nuisance projected out of every column.
    projected: DMatrix<f64>,
    /// k × (k+1): projected = triangle − G̃ · coefficients.
    coefficients: DMatrix<f64>,
    residual: DVector<f64>,
    clusters: Clusters,
}

impl<'a> Linear<'a> {
    fn new(reduced: &'a Reduced, nuisance: &[usize], options: &'a ScoreOptions) -> Self {
        let k = reduced.columns();
        let factor = reduced.factor();
        let norms: Vec<f64> = nuisance.iter().map(|&c| reduced.raw_norm(c)).collect();
        let basis = Basis::new(&factor.select_columns(nuisance), &norms, options.tolerance);
        let mut projected = factor.clone();
        basis.project_out(&mut projected);
        let mut coefficients = DMatrix::zeros(k, k + 1);
        let solved = basis.solve_r(&(basis.q.transpose() * factor));
        for (row, &place) in basis.kept.iter().enumerate() {
            coefficients.row_mut(nuisance[place]).copy_from(&solved.row(row));
        }
        let residual = projected.column(k).into_owned();
        let clusters = Clusters::new(reduced, &coefficients.column(k).into_owned());
        Self { reduced, options, nuisance: basis, projected, coefficients, residual, clusters }
    }

    fn directions(&self, candidate: &Candidate) -> Directions {
        let norm = |&c: &usize| Some(self.reduced.raw_norm(c)).filter(|n| *n > STATS.rounding).unwrap_or(0.0);
        let norms: Vec<f64> = candidate.columns.iter().map(norm).collect();
        let basis = Basis::new(&self.projected.select_columns(&candidate.columns), &norms, self.options.tolerance);
        let kept: Vec<usize> = basis.kept.iter().map(|&p| candidate.columns[p]).collect();
        let mut raw = -self.coefficients.select_columns(&kept);
        kept.iter().enumerate().for_each(|(i, &c)| raw[(c, i)] += 1.0);
        // directions = (G̃ raw) R⁻¹
        let weights = raw * basis.solve_r(&DMatrix::identity(basis.rank(), basis.rank()));
        Directions { basis, weights }
    }

    fn score(&self, nuisance: &[usize], candidate: &Candidate, directions: &Directions) -> CandidateScore {
        let basis = &directions.basis;
        let local = basis.q.transpose() * &self.residual;
        let (theta, std_error) = self.sizes(candidate, basis, &local);
        let taken =
            |n: usize| candidate.columns.iter().zip(&theta).map(|(&c, size)| self.coefficients[(n, c)] * size).sum::<f64>();
        let beside: Vec<f64> = nuisance.iter().map(|&n| self.coefficients[(n, self.reduced.columns())] - taken(n)).collect();
        let absorbed = candidate.columns.iter().map(|&c| {
            let (left, raw) = (self.projected.column(c).norm(), self.reduced.raw_norm(c));
            if raw > 0.0 { (1.0 - (left / raw).powi(2)).clamp(0.0, 1.0) } else { 1.0 }
        });
        let scalar = candidate.columns.len() == 1 && basis.rank() == 1;
        let sign = if scalar { candidate.sign } else { Sign::Any };
        let admissible = !scalar || sign.admits(theta[0]);
        let lm = local.norm_squared() / self.options.dispersion;
        // The basis direction of a single column is that column normalised: t has the sign of θ̂.
        let t = if scalar { theta[0] / std_error[0] } else { f64::NAN };
        let parametric = Evidence::parametric(lm, t, basis.rank());
        let (by_blocks, by_records) = self.clusters.evidence(directions, &local, self.options);
        let all = [Some(parametric), by_blocks, by_records];
        let z = all.iter().flatten().map(Evidence::z).fold(f64::INFINITY, f64::min);
        let one_sided = |e: Evidence| match (sign, admissible) {
            (_, false) => 1.0,
            (Sign::Any, _) => e.p,
            _ => 0.5 * e.p,
        };
        CandidateScore {
            rank: basis.rank(),
            dead: basis.dead.clone(),
            lm,
            lm_without_any: self.clusters.without_any(directions, &local) / self.options.dispersion,
            t,
            theta,
            beside,
            detectable: std_error.iter().map(|s| STATS.detectable * s).collect(),
            std_error,
            absorbed: absorbed.collect(),
            p_parametric: one_sided(parametric),
            p_blocks: by_blocks.map(one_sided),
            p_records: by_records.map(one_sided),
            p: all.iter().flatten().map(|e| one_sided(*e)).fold(0.0, f64::max),
            z,
            weakening: z / parametric.z().max(f64::MIN_POSITIVE),
            caution: caution(parametric, &[by_blocks, by_records]),
            admissible,
        }
    }

    /// θ̂ and its standard errors in the order of the candidate's columns.
    fn sizes(&self, candidate: &Candidate, basis: &Basis, local: &DVector<f64>) -> (Vec<f64>, Vec<f64>) {
        let (width, rank) = (candidate.columns.len(), basis.rank());
        let (mut theta, mut std_error) = (vec![0.0; width], vec![f64::INFINITY; width]);
        let solved = basis.solve_r(&DMatrix::from_column_slice(rank, 1, local.as_slice()));
        let inverse = basis.solve_r(&DMatrix::identity(rank, rank));
        for (row, &place) in basis.kept.iter().enumerate() {
            theta[place] = solved[(row, 0)];
            std_error[place] = inverse.row(row).norm() * self.options.dispersion.sqrt();
        }
        (theta, std_error)
    }
}

/// One statistic's two-sided p, and the statistic itself for where the tail underflows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    pub p: f64,
    pub statistic: f64,
    /// Degrees of freedom of the variance; infinite where it is taken as known.
    pub dof: f64,
}

impl Evidence {
    fn parametric(lm: f64, t: f64, rank: usize) -> Self {
        match rank {
            0 => Self { p: 1.0, statistic: 0.0, dof: f64::INFINITY },
            _ if t.is_nan() => Self { p: chi2_sf(lm, rank as f64), statistic: lm.sqrt(), dof: f64::INFINITY },
            _ => Self { p: 2.0 * normal_sf(t.abs()), statistic: t.abs(), dof: f64::INFINITY },
        }
    }

    fn z(&self) -> f64 {
        if self.p > STATS.least_p { z_of_two_sided(self.p) } else { self.statistic }
    }
}

fn caution(parametric: Evidence, robust: &[Option<Evidence>]) -> Vec<(f64, f64)> {
    let scale = |e: &Evidence| (e.statistic / parametric.statistic.max(f64::MIN_POSITIVE)).min(1.0);
    robust.iter().flatten().map(|e| (scale(e), e.dof)).collect()
}

impl CandidateScore {
    /// Standard normal statistic as rare as `z`, shrunk by the ratio of the robust to the parametric variance, is under Student's t; the
    /// least over the robust variances.
    pub fn credible(&self, z: f64) -> f64 {
        let worth = |&(scale, dof): &(f64, f64)| z_of_two_sided(t_two_sided(z * scale, dof));
        if z <= 0.0 { z } else { self.caution.iter().map(worth).fold(z, f64::min) }
    }
}

/// Largest (signed where both have one direction) and smallest principal cosines between all pairs of orthonormal bases.
fn principal_cosines(bases: &[DMatrix<f64>]) -> (DMatrix<f64>, DMatrix<f64>) {
    let m = bases.len();
    let (mut largest, mut smallest) = (DMatrix::zeros(m, m), DMatrix::zeros(m, m));
    for i in 0..m {
        for j in i..m {
            let overlap = bases[i].transpose() * &bases[j];
            let (top, bottom) = match overlap.shape() {
                (0, _) | (_, 0) => (0.0, 0.0),
                (1, 1) => (overlap[0].clamp(-1.0, 1.0), overlap[0].abs().min(1.0)),
                _ => {
                    let values = overlap.singular_values();
                    (values.max().min(1.0), values.min().min(1.0))
                }
            };
            (largest[(i, j)], largest[(j, i)]) = (top, top);
            (smallest[(i, j)], smallest[(j, i)]) = (bottom, bottom);
        }
    }
    (largest, smallest)
}
