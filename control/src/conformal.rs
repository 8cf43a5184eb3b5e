//! Bounds of one-step prediction errors from held-out runs, by split conformal prediction.
//!
//! ```text
//! score of a transition      s = |x⁺ − f(x, u)|₂, or |L(x, u)⁻¹ (x⁺ − f(x, u))|₂ for a scale L of the caller's
//! bound                      q = the r-th smallest of n calibration scores, r = ⌈(n + 1)(1 − α)⌉
//! ```
//! A new score exchangeable with the calibration scores is at most q with a probability of at least 1 − α, whatever the law of the scores.
//! The disturbances of a tube are then E = q · 1, or q L(x, u).
//!
//! With too few scores r exceeds n and no finite bound exists: that is an error, never the largest score.
//!
//! References: Vovk, Gammerman and Shafer (2005), "Algorithmic learning in a random world"; Papadopoulos et al. (2002) for the split form.

use faer::Mat;

/// Relative rounding of (n + 1) α, below which it counts as the whole number next to it \[-\]: 20 · 0.05 is one.
const COUNT_ROUNDING: f64 = 1e-12;

/// Which scores are exchangeable, and how they cover the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    /// The score of a run is the largest of its first T transitions; α = δ. Runs need be exchangeable with the new one, transitions
    /// within a run need not be. n ≥ 1/δ − 1 runs.
    Trajectory,
    /// Each transition is a score of its own, the horizon by the union bound, α = δ/T. Every transition of the new run needs be
    /// exchangeable with all those of the calibration, which transitions of one run rarely are. n ≥ T/δ − 1 transitions.
    Transitions,
}

/// Why there is no bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConformalError {
    /// No finite bound holds at this level.
    #[error("{given} {} cannot bound errors over {horizon} steps at a risk of {delta}: {needed} are needed",
        match .coverage { Coverage::Trajectory => "runs", Coverage::Transitions => "transitions" })]
    TooFew {
        /// Scores given.
        given: usize,
        /// Scores needed.
        needed: usize,
        /// δ.
        delta: f64,
        /// T.
        horizon: usize,
        /// Definition of a score.
        coverage: Coverage,
    },
    /// A run is shorter than the horizon.
    #[error("run {run} has {length} transitions, the horizon is {horizon}")]
    Short {
        /// Number of the run.
        run: usize,
        /// Its transitions.
        length: usize,
        /// T.
        horizon: usize,
    },
    /// A score is negative or not a number.
    #[error("run {run}, transition {transition}: a score of {score}")]
    Score {
        /// Number of the run.
        run: usize,
        /// Number of the transition.
        transition: usize,
        /// The score.
        score: f64,
    },
    /// δ outside (0, 1), or a horizon of 0.
    #[error("a risk of {delta} over {horizon} steps")]
    Level {
        /// δ.
        delta: f64,
        /// T.
        horizon: usize,
    },
    /// A scale that is not lower triangular with a positive diagonal, of the residual's size.
    #[error("a scale of {rows} × {columns} for a residual of {size}; entry ({row}, {column}) is {value}")]
    Scale {
        /// Rows of the scale.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Size of the residual.
        size: usize,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The entry.
        value: f64,
    },
}

/// A bound and what it supports.
#[derive(Clone, Debug, PartialEq)]
pub struct ConformalBound {
    /// q, in the unit of the scores. Infinite only if calibration scores are.
    pub radius: f64,
    /// δ: risk that any of the T errors exceeds its bound.
    pub delta: f64,
    /// T.
    pub horizon: usize,
    /// Number n of scores.
    pub scores: usize,
    /// Rank r of the score that is the radius.
    pub rank: usize,
    /// Which scores are exchangeable.
    pub coverage: Coverage,
    /// Whether scores were divided by a scale, which then multiplies the radius.
    pub scaled: bool,
}

/// |r|₂.
pub fn score(residual: &[f64]) -> f64 {
    residual.iter().map(|r| r * r).sum::<f64>().sqrt()
}

/// |L⁻¹ r|₂ for a lower-triangular L with a positive diagonal; σ · 1 for a scalar scale σ.
///
/// # Errors
/// [`ConformalError::Scale`].
pub fn scaled_score(residual: &[f64], scale: &Mat<f64>) -> Result<f64, ConformalError> {
    let (rows, columns, size) = (scale.nrows(), scale.ncols(), residual.len());
    let refuse = |row, column, value| Err(ConformalError::Scale { rows, columns, size, row, column, value });
    if rows != size || columns != size {
        return refuse(0, 0, f64::NAN);
    }
    let mut solved = residual.to_vec();
    for r in 0..size {
        for c in 0..size {
            let value = scale[(r, c)];
            let sound = value.is_finite() && if c == r { value > 0.0 } else { c < r || value == 0.0 };
            if !sound {
                return refuse(r, c, value);
            }
        }
        let known: f64 = (0..r).map(|c| scale[(r, c)] * solved[c]).sum();
        solved[r] = (solved[r] - known) / scale[(r, r)];
    }
    Ok(score(&solved))
}

/// The bound of scores by run and transition, at a risk of `delta` over `horizon` steps.
///
/// `scaled` says whether the scores are those of [`scaled_score`]; it enters the statement alone.
///
/// # Errors
/// [`ConformalError::TooFew`] with the number needed; [`ConformalError::Short`], [`ConformalError::Score`], [`ConformalError::Level`].
pub fn conformal_bound(
    runs: &[Vec<f64>],
    delta: f64,
    horizon: usize,
    coverage: Coverage,
    scaled: bool,
) -> Result<ConformalBound, ConformalError> {
    if !(delta > 0.0 && delta < 1.0) || horizon == 0 {
        return Err(ConformalError::Level { delta, horizon });
    }
    for (run, scores) in runs.iter().enumerate() {
        if let Some((transition, &score)) = scores.iter().enumerate().find(|(_, score)| score.is_nan() || **score < 0.0) {
            return Err(ConformalError::Score { run, transition, score });
        }
        if coverage == Coverage::Trajectory && scores.len() < horizon {
            return Err(ConformalError::Short { run, length: scores.len(), horizon });
        }
    }
    let (mut scores, alpha): (Vec<f64>, f64) = match coverage {
        Coverage::Trajectory => {
            let largest = |scores: &Vec<f64>| scores[..horizon].iter().fold(0.0, |a: f64, b| a.max(*b));
            (runs.iter().map(largest).collect(), delta)
        }
        Coverage::Transitions => (runs.iter().flatten().copied().collect(), delta / horizon as f64),
    };
    let given = scores.len();
    // r = ⌈(n + 1)(1 − α)⌉ = n + 1 − ⌊(n + 1) α⌋
    let above = ((given + 1) as f64 * alpha * (1.0 + COUNT_ROUNDING)).floor() as usize;
    if above == 0 {
        return Err(ConformalError::TooFew { given, needed: needed_scores(alpha), delta, horizon, coverage });
    }
    scores.sort_by(f64::total_cmp);
    let rank = (given + 1).saturating_sub(above).max(1);
    Ok(ConformalBound { radius: scores[rank - 1], delta, horizon, scores: given, rank, coverage, scaled })
}

/// Least n with (n + 1) α ≥ 1.
fn needed_scores(alpha: f64) -> usize {
    (((1.0 - COUNT_ROUNDING) / alpha).ceil() as usize).saturating_sub(1)
}

impl ConformalBound {
    /// E = q · 1, nx × nx.
    pub fn columns(&self, nx: usize) -> Mat<f64> {
        Mat::from_fn(nx, nx, |r, c| if r == c { self.radius } else { 0.0 })
    }

    /// E = q L for the scale of a state and input.
    pub fn scaled_columns(&self, scale: &Mat<f64>) -> Mat<f64> {
        faer::Scale(self.radius) * scale
    }

    /// The statement that the bound supports, with its condition.
    pub fn statement(&self) -> String {
        let size = if self.scaled { "|L(x, u)⁻¹ (x⁺ − f(x, u))|₂" } else { "|x⁺ − f(x, u)|₂" };
        let (count, of, condition) = match self.coverage {
            Coverage::Trajectory => (
                self.scores,
                "runs, each by its largest score",
                "the new run is exchangeable with them: same scenes, same policy, same sensors".to_owned(),
            ),
            Coverage::Transitions => (
                self.scores,
                "transitions, with the union bound over steps",
                "each transition of the new run is exchangeable with all of them, which transitions within one run in general are not"
                    .to_owned(),
            ),
        };
        format!(
            "With a probability of at least {} over calibration and new run, all {} errors {size} are at most {:.6e} (score {} of {count} \
             {of}), if {condition}. The errors are those of the perceived state; a bound of the sensor's error comes on top.",
            1.0 - self.delta,
            self.horizon,
            self.radius,
            self.rank,
        )
    }
}
