//! Linear time-varying problems of optimal control, quadratic in cost, with linear rows.
//!
//! ```text
//! min  Σ_{k<N} ½ x_kᵀ Q_k x_k + u_kᵀ S_k x_k + ½ u_kᵀ R_k u_k + q_kᵀ x_k + r_kᵀ u_k  +  ½ x_Nᵀ Q_N x_N + q_Nᵀ x_N
//! s.t. x_{k+1} = A_k x_k + B_k u_k + d_k,   x_0 given
//!      lower_k ≤ u_k ≤ upper_k
//!      G_x x_k + G_u u_k ≤ limit            row by row: hard, or at the price weight · max(0, G_x x_k + G_u u_k − limit)
//! ```
//! A soft row of a finite weight has an exact (L1) penalty: it holds wherever it can hold at a multiplier of at most its weight, and a
//! problem whose rows of states are all soft always has a solution.
//!
//! Two methods: [`Condensed`] eliminates the states and solves a dense quadratic program of N · nu inputs, warm-started; [`Riccati`] is an
//! interior-point method whose work grows with N (nx³ + nu³). [`choose`] takes the one that is faster.

mod check;
mod condensed;
mod error;
mod evaluate;
mod products;
mod riccati;
mod snapshot;

pub use condensed::Condensed;
pub use error::{OcpConstraint, OcpError};
pub use riccati::Riccati;

use crate::constants::OCP;
use faer::Mat;

/// Rows G_x x + G_u u ≤ limit of one stage; without columns of u at the last.
#[derive(Clone, Debug)]
pub struct Rows {
    /// G_x, m × nx.
    pub gx: Mat<f64>,
    /// G_u, m × nu.
    pub gu: Mat<f64>,
    /// Right-hand sides (m).
    pub limits: Vec<f64>,
    /// Price of a violation by 1 (m); infinite: the row is hard.
    pub weights: Vec<f64>,
}

impl Rows {
    /// No rows.
    pub fn none(nx: usize, nu: usize) -> Self {
        Self { gx: Mat::zeros(0, nx), gu: Mat::zeros(0, nu), limits: Vec::new(), weights: Vec::new() }
    }

    /// Number of rows m.
    pub fn len(&self) -> usize {
        self.limits.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.limits.is_empty()
    }
}

/// One of the N stages. All arrays of the sizes nx and nu of the problem.
#[derive(Clone, Debug)]
pub struct Stage {
    /// A, nx × nx.
    pub a: Mat<f64>,
    /// B, nx × nu.
    pub b: Mat<f64>,
    /// d (nx).
    pub d: Vec<f64>,
    /// Q, nx × nx, symmetric, positive semidefinite.
    pub q: Mat<f64>,
    /// S, nu × nx.
    pub s: Mat<f64>,
    /// R, nu × nu, symmetric; the problem is strictly convex in u.
    pub r: Mat<f64>,
    /// q (nx).
    pub q_linear: Vec<f64>,
    /// r (nu).
    pub r_linear: Vec<f64>,
    /// Lower bounds of u (nu), −∞ where there is none.
    pub lower: Vec<f64>,
    /// Upper bounds of u (nu), ∞ where there is none.
    pub upper: Vec<f64>,
    /// Rows of x_k and u_k.
    pub rows: Rows,
}

/// The problem.
#[derive(Clone, Debug)]
pub struct Ocp {
    /// x₀ (nx).
    pub x0: Vec<f64>,
    /// Stages 0 … N−1.
    pub stages: Vec<Stage>,
    /// Q_N, nx × nx.
    pub q_final: Mat<f64>,
    /// q_N (nx).
    pub q_final_linear: Vec<f64>,
    /// Rows of x_N.
    pub rows_final: Rows,
}

/// Its solution.
#[derive(Clone, Debug)]
pub struct OcpSolution {
    /// x_0 … x_N.
    pub x: Vec<Vec<f64>>,
    /// u_0 … u_{N−1}.
    pub u: Vec<Vec<f64>>,
    /// Multipliers of the rows of stages 0 … N, not negative.
    pub multipliers: Vec<Vec<f64>>,
    /// Multipliers of the bounds of u, stage by stage: negative at a lower bound, positive at an upper one.
    pub bounds: Vec<Vec<f64>>,
    /// Violations of the rows, max(0, G x + G u − limit), of stages 0 … N.
    pub violations: Vec<Vec<f64>>,
    /// Value of the cost, prices of violations included.
    pub cost: f64,
    /// Iterations of the method.
    pub iterations: usize,
}

/// Solves problems, from the last one's solution if they are alike.
pub trait OcpSolver {
    /// # Errors
    /// Sizes that do not belong together, numbers that are not finite, hard rows that contradict each other, a Hessian that is not
    /// positive definite in u.
    fn solve(&mut self, ocp: &Ocp) -> Result<OcpSolution, OcpError>;
}

/// The method that is faster for problems of N stages, nx states and nu inputs: [`Condensed`] for few inputs in all, [`Riccati`] for
/// long horizons.
pub fn choose(stages: usize, nx: usize, nu: usize) -> Box<dyn OcpSolver> {
    if (stages * nu) as f64 <= OCP.condensed_inputs * (nx + OCP.least_states) as f64 {
        Box::new(Condensed::new())
    } else {
        Box::new(Riccati::new())
    }
}
