//! Dense strictly convex quadratic programs with bounds and rows, each row hard or at an exact L1 price.
//!
//! ```text
//! min  ½ zᵀ H z + gᵀ z + Σ_{i soft} weight_i · max(0, C_i z − c_i)
//! s.t. lower ≤ z ≤ upper,   C_i z ≤ c_i  (i hard: weight_i = ∞)
//! ```
//! H is n × n, symmetric and positive definite; C is m × n. In the dual a soft row is a hard one whose multiplier has the upper limit
//! weight_i: no slack variable is needed, and a soft row costs no more than a hard one. [`ActiveSet`] solves it.
//!
//! The conditions of optimality, with multipliers ν of the bounds (negative at a lower, positive at an upper one) and λ of the rows:
//! H z + g + ν + Cᵀ λ = 0; 0 ≤ λ ≤ weight; λ_i = 0 where C_i z < c_i, and λ_i = weight_i where C_i z > c_i.
//!
//! ```
//! use faer::mat;
//! use pliant_control::qp::{ActiveSet, Qp};
//!
//! let (h, c) = (mat![[2.0, 0.0], [0.0, 2.0]], mat![[1.0, 1.0]]);
//! let qp = Qp {
//!     hessian: h.as_ref(),
//!     gradient: &[-4.0, -4.0],
//!     lower: &[-1.0, -1.0],
//!     upper: &[0.5, 5.0],
//!     rows: c.as_ref(),
//!     limits: &[1.5],
//!     weights: &[f64::INFINITY],
//! };
//! let solution = ActiveSet::new().solve(&qp)?;
//! assert!((solution.z[0] - 0.5).abs() < 1e-12 && (solution.z[1] - 1.0).abs() < 1e-12);
//! assert!((solution.bounds[0] - 1.0).abs() < 1e-12 && (solution.multipliers[0] - 2.0).abs() < 1e-12);
//! # Ok::<(), pliant_control::qp::QpError>(())
//! ```

mod active_set;
mod check;
mod hessian;
mod refine;
mod step;
mod warm;
mod working;

pub use active_set::ActiveSet;

use faer::MatRef;

/// The problem; see the [module](self).
#[derive(Clone, Copy, Debug)]
pub struct Qp<'a> {
    /// H, n × n; its lower triangle is read.
    pub hessian: MatRef<'a, f64>,
    /// g (n).
    pub gradient: &'a [f64],
    /// Lower bounds (n), −∞ where there is none.
    pub lower: &'a [f64],
    /// Upper bounds (n), ∞ where there is none.
    pub upper: &'a [f64],
    /// C, m × n. Rows that lie contiguously in memory (the transpose of a column-major n × m matrix) are read in place, others copied.
    pub rows: MatRef<'a, f64>,
    /// c (m); ∞: no limit.
    pub limits: &'a [f64],
    /// Price of a violation by 1 (m), not negative; ∞: the row is hard.
    pub weights: &'a [f64],
}

/// Its solution.
#[derive(Clone, Debug)]
pub struct QpSolution {
    /// z (n).
    pub z: Vec<f64>,
    /// Multipliers of the bounds (n): negative at a lower bound, positive at an upper one.
    pub bounds: Vec<f64>,
    /// Multipliers of the rows (m), from 0 to the row's weight.
    pub multipliers: Vec<f64>,
    /// Value of the cost, prices of violations included.
    pub cost: f64,
    /// Changes of the working set: rows that entered or left it, those a warm start left out again among them.
    pub iterations: usize,
}

/// A constraint of a problem, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// Lower bound of a variable.
    Lower(usize),
    /// Upper bound of a variable.
    Upper(usize),
    /// A row.
    Row(usize),
}

/// Why a problem has no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QpError {
    /// An array's size does not fit the Hessian's or the number of limits.
    #[error("{array} has {found} {of}, not {expected}")]
    Size {
        /// Name of the array.
        array: &'static str,
        /// The counted thing.
        of: &'static str,
        /// Its number.
        found: usize,
        /// The size that it should have.
        expected: usize,
    },
    /// A number that is not finite, where it has to be.
    #[error("{array} is {value} at row {row}, column {column}")]
    NotFinite {
        /// Name of the array.
        array: &'static str,
        /// Place of the number; of a vector the index.
        row: usize,
        /// 0 of a vector.
        column: usize,
        /// The number.
        value: f64,
    },
    /// A negative price.
    #[error("row {row} has the negative weight {weight}")]
    NegativeWeight {
        /// Number of the row.
        row: usize,
        /// Its weight.
        weight: f64,
    },
    /// A lower bound above the upper one.
    #[error("variable {variable} has the lower bound {lower} above the upper bound {upper}")]
    CrossedBounds {
        /// Number of the variable.
        variable: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The Hessian is not positive definite.
    #[error("the Hessian is not positive definite: pivot {pivot} of the Cholesky factorization vanishes or is negative")]
    NotPositiveDefinite {
        /// Number of the first such pivot.
        pivot: usize,
    },
    /// Hard rows and bounds that no z satisfies.
    #[error("{} hard constraints contradict each other by {by:e}: {constraints:?}", constraints.len())]
    Infeasible {
        /// Constraints that contradict each other; without one of them the others can hold.
        constraints: Vec<Constraint>,
        /// Least violation of the first of them where all the others hold.
        by: f64,
    },
    /// The method did not end, for lack of accuracy: the problem is too badly conditioned.
    #[error("no solution after {changes} changes of the working set")]
    IterationLimit {
        /// Changes made.
        changes: usize,
    },
}
