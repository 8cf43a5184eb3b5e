//! Variances that do not believe the noise model: scores of time blocks and of records.
//!
//! In a candidate's orthonormal coordinates the scores s_b of the clusters sum to ŝ and their informations I_b to the
//! identity. d_b = (1 − I_b)^{−½}(s_b − I_b ŝ) has E d_b d_bᵀ = I_b under white noise, so V = Σ d_b d_bᵀ is unbiased for Var ŝ;
//! centring on I_b ŝ, the score that the fitted size predicts for the block, keeps a true effect out of the variance.
//! Reference: Bell & McCaffrey (2002).

use super::constants::STATS;
use super::dist::{f_sf, t_two_sided};
use super::reduced::Reduced;
use super::score::{Directions, Evidence, ScoreOptions};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// Sums of gram and residual score over one cluster.
pub(super) struct Cluster {
    gram: DMatrix<f64>,
    /// G̃_bᵀ (r̃_b − G̃_b step)
    score: DVector<f64>,
}

/// Clusters of both kinds, with the residual after the nuisance step.
pub(super) struct Clusters {
    pub blocks: Vec<Cluster>,
    pub records: Vec<Cluster>,
}

impl Clusters {
    pub fn new(reduced: &Reduced, step: &DVector<f64>) -> Self {
        let blocks: Vec<Cluster> =
            reduced.blocks().iter().map(|b| Cluster { score: &b.score - &b.gram * step, gram: b.gram.clone() }).collect();
        let k = reduced.columns();
        let empty = || Cluster { gram: DMatrix::zeros(k, k), score: DVector::zeros(k) };
        let mut records: Vec<Cluster> = (0..reduced.records()).map(|_| empty()).collect();
        for (block, cluster) in reduced.blocks().iter().zip(&blocks) {
            records[block.record].gram += &cluster.gram;
            records[block.record].score += &cluster.score;
        }
        Self { blocks, records }
    }

    /// Scores of the records on a candidate's directions (rank × records).
    pub fn by_record(&self, directions: &Directions) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = self.records.iter().map(|c| directions.weights.transpose() * &c.score).collect();
        DMatrix::from_fn(directions.basis.rank(), columns.len(), |i, j| columns[j][i])
    }

    /// The least of ŝᵀ(1 − I_b)⁻¹ŝ over the blocks, each left out of ŝ in turn: what hangs on one of them has none.
    pub fn without_any(&self, directions: &Directions, local: &DVector<f64>) -> f64 {
        let rank = directions.basis.rank();
        let without = |block: &Cluster| {
            let score = local - directions.weights.tr_mul(&block.score);
            let rest = DMatrix::identity(rank, rank) - information(&directions.weights, &block.gram);
            Cholesky::new(rest).map_or(0.0, |rest| score.dot(&rest.solve(&score)))
        };
        self.blocks.iter().map(without).fold(local.norm_squared(), f64::min)
    }

    /// Wald-type tests with the variance from time blocks and, where there are enough, from records.
    pub fn evidence(
        &self,
        directions: &Directions,
        local: &DVector<f64>,
        options: &ScoreOptions,
    ) -> (Option<Evidence>, Option<Evidence>) {
        let records = if self.records.len() >= options.min_records { self.records.as_slice() } else { &[] };
        let wald = |clusters: &[Cluster]| wald(clusters, directions, local, options.min_cluster_dof);
        (wald(&self.blocks), wald(records))
    }
}

/// w G wᵀ of a cluster's gram G, in a candidate's coordinates. Most columns are other candidates': their weights w are zero.
fn information(weights: &DMatrix<f64>, gram: &DMatrix<f64>) -> DMatrix<f64> {
    let (w, rank) = (weights, weights.ncols());
    let support: Vec<usize> = (0..w.nrows()).filter(|&i| w.row(i).iter().any(|x| *x != 0.0)).collect();
    DMatrix::from_fn(rank, rank, |a, b| {
        let inner = |j: usize| support.iter().map(|&i| w[(i, a)] * gram[(i, j)]).sum::<f64>();
        support.iter().map(|&j| inner(j) * w[(j, b)]).sum()
    })
}

/// ŝᵀV⁻¹ŝ against t (one direction) or F; none where the clusters carry too few degrees of freedom.
fn wald(clusters: &[Cluster], directions: &Directions, local: &DVector<f64>, min_dof: f64) -> Option<Evidence> {
    let rank = directions.basis.rank();
    if rank == 0 {
        return None;
    }
    let w = &directions.weights;
    let mut variance = DMatrix::zeros(rank, rank);
    let mut shares = Vec::with_capacity(clusters.len());
    for cluster in clusters {
        let information = information(w, &cluster.gram);
        shares.push((information.trace() / rank as f64).clamp(0.0, 1.0));
        let centred = w.tr_mul(&cluster.score) - &information * local;
        let corrected = inverse_root_of_complement(information) * centred;
        variance += &corrected * corrected.transpose();
    }
    let dof = satterthwaite(&shares);
    let usable = dof - rank as f64 + 1.0;
    if dof < min_dof || usable < 1.0 {
        return None;
    }
    let squared = local.dot(&Cholesky::new(variance)?.solve(local));
    let statistic = squared.sqrt();
    let p = match rank {
        1 => t_two_sided(statistic, dof),
        _ => f_sf(squared * usable / (dof * rank as f64), rank as f64, usable),
    };
    Some(Evidence { p, statistic, dof })
}

/// (1 − I)^{−½} of a symmetric I with eigenvalues in [0, 1].
fn inverse_root_of_complement(information: DMatrix<f64>) -> DMatrix<f64> {
    if information.nrows() == 1 {
        return information.map(|l| (1.0 - l.clamp(0.0, STATS.leverage_limit)).powf(-0.5));
    }
    let eigen = SymmetricEigen::new((&information + information.transpose()) * 0.5);
    let roots = eigen.eigenvalues.map(|l| (1.0 - l.clamp(0.0, STATS.leverage_limit)).powf(-0.5));
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// Degrees of freedom 2 E(V)²/Var(V) of V = Σ d_b² for information shares a_b (Σ a_b = 1) and white Gaussian noise:
/// cov(d_b, d_c) = −a_b a_c/√((1−a_b)(1−a_c)), var(d_b) = a_b.
fn satterthwaite(shares: &[f64]) -> f64 {
    let mean: f64 = shares.iter().sum();
    let leak = |a: f64| a * a / (1.0 - a.min(STATS.leverage_limit));
    // Σ_{b≠c} a_b² a_c² /((1−a_b)(1−a_c)) = (Σ leak)² − Σ leak²
    let (sum, squares): (f64, f64) = shares.iter().fold((0.0, 0.0), |(s, q), &a| (s + leak(a), q + leak(a).powi(2)));
    let total = shares.iter().map(|a| a * a).sum::<f64>() + sum * sum - squares;
    if total > 0.0 { mean * mean / total } else { 0.0 }
}
