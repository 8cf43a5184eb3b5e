//! The problem of a tube: dynamics and rows of a nominal one, what disturbs them, what deviations cost.

use std::ops::Range;

use faer::Mat;

use super::error::TubeError;
use super::rows::StageRows;
use crate::linear::{apply, is_finite};
use crate::ocp::Ocp;

/// A ball of disturbances shift + columns · w, |w|₂ ≤ 1, of the state at one time.
#[derive(Clone, Debug)]
pub struct Ball {
    /// E, nx × nw, of any rank.
    pub columns: Mat<f64>,
    /// Its centre in state space (nx); empty: the origin.
    pub shift: Vec<f64>,
}

impl Ball {
    /// A ball about the origin.
    pub fn new(columns: Mat<f64>) -> Self {
        Self { columns, shift: Vec::new() }
    }

    /// The states that smoothing hides: x_true = x_κ + Σ_j columns_j w_j with every w_j in [1, 2], enclosed by the ball about the centre of that cube
    /// through its corners, of radius ½ √nw.
    ///
    /// Column j is −P⁻¹ J_jᵀ (dλ_j/dκ) κ, the first-order effect of the smoothing κ of contact j on the step.
    ///
    /// Reference: Li and Chou (2026), arXiv 2602.09368.
    pub fn of_smoothing(columns: &Mat<f64>) -> Self {
        let count = columns.ncols();
        let radius = 0.5 * (count as f64).sqrt();
        Self { columns: faer::Scale(radius) * columns, shift: apply(columns, &vec![1.5; count]) }
    }
}

/// Disturbances of the state: balls at times 0 … N, independent of each other; those of time 0 are the uncertainty of x₀.
#[derive(Clone, Debug)]
pub struct Disturbance {
    /// Balls of each time.
    pub balls: Vec<Vec<Ball>>,
}

impl Disturbance {
    /// One ball a time, E_0 … E_N.
    pub fn new(columns: impl IntoIterator<Item = Mat<f64>>) -> Self {
        Self { balls: columns.into_iter().map(|columns| vec![Ball::new(columns)]).collect() }
    }

    /// The problem whose nominal trajectory meets the balls' centres: d_k += shifts of time k + 1, x₀ += shifts of time 0.
    ///
    /// With a policy of responses Φ, nominal rows get + g · Φ_{k,j} shift_j where the nominal trajectory is that without shifts. Counting
    /// the shifts into the nominal trajectory is the same set of trajectories (v' = v + Φ_u shift is as free as v), and leaves responses
    /// without a linear term in their cost: [`shifted rows`](super::Tube::shifts) are the difference of the two.
    pub fn recentre(&self, ocp: &Ocp) -> Ocp {
        let mut centred = ocp.clone();
        for (j, ball) in self.balls.iter().enumerate().flat_map(|(j, balls)| balls.iter().map(move |ball| (j, ball))) {
            let target = if j == 0 { &mut centred.x0 } else { &mut centred.stages[j - 1].d };
            for (target, shift) in target.iter_mut().zip(&ball.shift) {
                *target += shift;
            }
        }
        centred
    }

    /// Sum of the shifts of time j (nx).
    pub(crate) fn shift(&self, j: usize, nx: usize) -> Vec<f64> {
        let mut sum = vec![0.0; nx];
        for ball in &self.balls[j] {
            for (sum, shift) in sum.iter_mut().zip(&ball.shift) {
                *sum += shift;
            }
        }
        sum
    }
}

/// Cost Σ_{j,k} |Q_r^{1/2} Φ_x\[k,j\] E_j|² + |R_r^{1/2} Φ_u\[k,j\] E_j|² of deviations, without a factor ½.
#[derive(Clone, Debug)]
pub struct TubeCost {
    /// Q_r, nx × nx, symmetric, positive semidefinite.
    pub q: Mat<f64>,
    /// R_r, nu × nu, symmetric, positive definite.
    pub r: Mat<f64>,
    /// Q_r of the last stage, nx × nx.
    pub q_final: Mat<f64>,
}

/// A problem of a tube, its sizes checked.
#[derive(Clone, Debug)]
pub struct TubeProblem<'a> {
    pub(crate) ocp: &'a Ocp,
    pub(crate) cost: &'a TubeCost,
    pub(crate) disturbance: &'a Disturbance,
    /// E_0 … E_N with the columns of a time's balls side by side.
    pub(crate) columns: Vec<Mat<f64>>,
    /// Which columns of E_j belong to which ball.
    pub(crate) balls: Vec<Vec<Range<usize>>>,
    pub(crate) rows: Vec<StageRows>,
    pub(crate) nx: usize,
    pub(crate) nu: usize,
}

impl<'a> TubeProblem<'a> {
    /// Checks sizes; rows and dynamics are those of `ocp`, its cost and d play no part.
    ///
    /// # Errors
    /// [`TubeError::Size`], [`TubeError::NotFinite`].
    pub fn new(ocp: &'a Ocp, disturbance: &'a Disturbance, cost: &'a TubeCost) -> Result<Self, TubeError> {
        let nx = ocp.x0.len();
        let nu = ocp.stages.first().map_or(0, |stage| stage.b.ncols());
        let horizon = ocp.stages.len();
        for (k, stage) in ocp.stages.iter().enumerate() {
            check("A", k, &stage.a, nx, nx)?;
            check("B", k, &stage.b, nx, nu)?;
            check("G_x", k, &stage.rows.gx, stage.rows.len(), nx)?;
            check("G_u", k, &stage.rows.gu, stage.rows.len(), nu)?;
        }
        check("G_x", horizon, &ocp.rows_final.gx, ocp.rows_final.len(), nx)?;
        check("Q_r", 0, &cost.q, nx, nx)?;
        check("R_r", 0, &cost.r, nu, nu)?;
        check("Q_r", horizon, &cost.q_final, nx, nx)?;
        if disturbance.balls.len() != horizon + 1 {
            let (rows, needed_rows) = (disturbance.balls.len(), horizon + 1);
            return Err(TubeError::Size { what: "times of E", stage: 0, rows, columns: 1, needed_rows, needed_columns: 1 });
        }
        let mut columns = Vec::with_capacity(horizon + 1);
        let mut balls = Vec::with_capacity(horizon + 1);
        for (j, of_time) in disturbance.balls.iter().enumerate() {
            let (side_by_side, ranges) = concatenate(j, of_time, nx)?;
            columns.push(side_by_side);
            balls.push(ranges);
        }
        let rows = (0..=horizon).map(|k| StageRows::new(ocp, k)).collect();
        Ok(Self { ocp, cost, disturbance, columns, balls, rows, nx, nu })
    }

    /// Number of stages N.
    pub(crate) fn horizon(&self) -> usize {
        self.ocp.stages.len()
    }
}

fn concatenate(j: usize, balls: &[Ball], nx: usize) -> Result<(Mat<f64>, Vec<Range<usize>>), TubeError> {
    let mut ranges = Vec::with_capacity(balls.len());
    let mut all = Mat::zeros(nx, balls.iter().map(|ball| ball.columns.ncols()).sum());
    let mut first = 0;
    for ball in balls {
        check("E", j, &ball.columns, nx, ball.columns.ncols())?;
        if !ball.shift.is_empty() && ball.shift.len() != nx {
            let rows = ball.shift.len();
            return Err(TubeError::Size { what: "shift", stage: j, rows, columns: 1, needed_rows: nx, needed_columns: 1 });
        }
        if ball.shift.iter().any(|s| !s.is_finite()) {
            return Err(TubeError::NotFinite { what: "shift", stage: j });
        }
        let count = ball.columns.ncols();
        all.as_mut().subcols_mut(first, count).copy_from(&ball.columns);
        if count > 0 {
            ranges.push(first..first + count);
        }
        first += count;
    }
    Ok((all, ranges))
}

pub(crate) fn check(what: &'static str, stage: usize, a: &Mat<f64>, rows: usize, columns: usize) -> Result<(), TubeError> {
    if a.nrows() != rows || a.ncols() != columns {
        return Err(TubeError::Size {
            what,
            stage,
            rows: a.nrows(),
            columns: a.ncols(),
            needed_rows: rows,
            needed_columns: columns,
        });
    }
    if is_finite(a) { Ok(()) } else { Err(TubeError::NotFinite { what, stage }) }
}
