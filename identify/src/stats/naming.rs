//! From test statistics to a name, or to an honest set of rivals.
//!
//! **One-parameter causes.** Best is the largest |t|. Name j only if it is significant after Holm and beats each of its m
//! rivals k:
//!
//!   (|t_j| − |t_k|) / √(2 (1 − |ρ_jk|)) > Φ⁻¹(1 − α/m)
//!
//! Under "j and k explain equally well" t_j ∓ t_k has standard deviation √(2(1 − |ρ|)), and α/m keeps the chance that any
//! one of the rivals, being the truth, is beaten by mistake at α.
//!
//! **Causes of different dimension** (tilt has 2 parameters, a frame 6). LM_j = |p_j|² with p_j = P_j r the fitted
//! contribution. With r = μ + e, LM_j − LM_k = rᵀ(P_j − P_k) r; its mean under equal fit |P_jμ| = |P_kμ| is the difference of
//! the ranks, d_j − d_k, and to first order it varies as 2 eᵀ(P_jμ − P_kμ), hence
//!
//!   z = (LM_j − LM_k − (d_j − d_k)) / (2 |p_j − p_k|) > Φ⁻¹(1 − α/m)
//!
//! (Vuong 1989, in the geometry of a linear model with known noise; the penalty is AIC's.) The plug-in |p_j − p_k|²
//! exceeds |P_jμ − P_kμ|² by d_j + d_k − 2Σρ² on average, which covers the variance 2(d_j + d_k − 2Σρ²) of the quadratic term
//! left out: the rule errs towards ambiguity. For two single directions with t_j ≈ t_k ≈ t it is the first rule: then
//! LM_j − LM_k ≈ 2t (|t_j| − |t_k|) and |p_j − p_k| ≈ t √(2(1 − |ρ|)).
//! Where one cause contains the other (smallest principal cosine ≥ 0.9995), the smaller is never named alone: the larger
//! imitates it exactly.
//!
//! **Separable rivals.** Where j stays significant with k as nuisance *and* k with j, both are present, neither explains the
//! other away, and k does not stand in the way of naming j (forward selection will reach k). This exemption is tested at
//! α/(2m) each way.

use super::constants::STATS;
use super::dist::normal_quantile;
use super::score::ScoreTest;
use serde::Serialize;

/// Settings of [`name`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamingOptions {
    /// α, of Holm and of the comparisons.
    pub level: f64,
    /// |ρ| (or containment) from which two causes are the same for these data.
    pub symmetry: f64,
    /// Whether separable rivals are exempt.
    pub separable: bool,
}

impl Default for NamingOptions {
    fn default() -> Self {
        Self { level: 0.05, symmetry: 0.9995, separable: true }
    }
}

/// Conclusion of the naming rule. Numbers index the candidates of the score test.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Naming {
    /// One cause, beyond its rivals.
    Named(usize),
    /// The best cause first, then those it does not beat, by falling statistic.
    Ambiguous(Vec<usize>),
    /// Nothing is significant.
    None,
}

/// Applies the rule. `adjusted[j]` is the family-wise p of candidate j: Holm's over `p`, or the sign flips' where they decide.
/// Candidates that are absorbed, or whose size has an inadmissible sign, are neither named nor rivals.
pub fn name(test: &ScoreTest, adjusted: &[f64], options: &NamingOptions) -> Naming {
    let in_play: Vec<usize> = test
        .candidates
        .iter()
        .enumerate()
        .filter(|(j, c)| c.rank > 0 && c.admissible && *j < adjusted.len())
        .map(|(j, _)| j)
        .collect();
    let significant = in_play.iter().copied().filter(|&j| adjusted[j] <= options.level);
    let Some(best) = significant.max_by(|&a, &b| test.candidates[a].z.total_cmp(&test.candidates[b].z)) else {
        return Naming::None;
    };
    let rivals: Vec<usize> = in_play.into_iter().filter(|&k| k != best).collect();
    let mut unbeaten: Vec<usize> =
        rivals.iter().copied().filter(|&k| !stands_against(test, best, k, rivals.len(), options)).collect();
    if unbeaten.is_empty() {
        return Naming::Named(best);
    }
    unbeaten.sort_by(|&a, &b| test.candidates[b].z.total_cmp(&test.candidates[a].z));
    Naming::Ambiguous([best].into_iter().chain(unbeaten).collect())
}

fn stands_against(test: &ScoreTest, best: usize, rival: usize, rivals: usize, options: &NamingOptions) -> bool {
    if test.containment[(best, rival)] >= options.symmetry {
        return false;
    }
    let bar = normal_quantile(1.0 - options.level / rivals.max(1) as f64);
    if lead(test, best, rival) > bar {
        return true;
    }
    let alpha = 0.5 * options.level / rivals.max(1) as f64;
    options.separable && test.conditional(best, rival).1 < alpha && test.conditional(rival, best).1 < alpha
}

/// Standardised lead of candidate j over candidate k: the left sides of the two rules.
/// Where robust variances weaken j, its contribution is shrunk by the same factor; k keeps the benefit of the doubt.
pub fn lead(test: &ScoreTest, j: usize, k: usize) -> f64 {
    let (a, b) = (&test.candidates[j], &test.candidates[k]);
    let shrink = a.weakening.min(1.0);
    if !a.t.is_nan() && !b.t.is_nan() {
        return (shrink * a.t.abs() - b.t.abs()) / (2.0 * (1.0 - test.cosines[(j, k)].abs())).sqrt().max(STATS.least_distance);
    }
    let distance = (test.contribution(j) * shrink - test.contribution(k)).norm();
    let penalty = a.rank as f64 - b.rank as f64;
    (a.lm * shrink * shrink - b.lm - penalty) / (2.0 * distance).max(STATS.least_distance)
}
