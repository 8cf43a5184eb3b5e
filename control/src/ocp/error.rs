//! Why a problem of optimal control has no solution.

use crate::qp::QpError;

/// A constraint of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OcpConstraint {
    /// Lower bound of an input.
    Lower {
        /// Stage.
        stage: usize,
        /// Number of the input.
        input: usize,
    },
    /// Upper bound of an input.
    Upper {
        /// Stage.
        stage: usize,
        /// Number of the input.
        input: usize,
    },
    /// A row; that of x_N at stage N.
    Row {
        /// Stage.
        stage: usize,
        /// Number of the row.
        row: usize,
    },
}

/// Why a problem has no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OcpError {
    /// No stages, or no inputs.
    #[error("a problem of {stages} stages and {inputs} inputs decides nothing")]
    Empty {
        /// Number of stages.
        stages: usize,
        /// Number of inputs.
        inputs: usize,
    },
    /// An array's size does not fit nx (length of x₀), nu (columns of the first B) or the number of the stage's limits.
    #[error("{array} of stage {stage} is {} × {}, not {} × {}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Name of the array.
        array: &'static str,
        /// Stage.
        stage: usize,
        /// Rows and columns; a vector has one column.
        found: (usize, usize),
        /// The rows and columns that it should have.
        expected: (usize, usize),
    },
    /// A number that is not finite, where it has to be.
    #[error("{array} of stage {stage} is {value} at row {row}, column {column}")]
    NotFinite {
        /// Name of the array.
        array: &'static str,
        /// Stage.
        stage: usize,
        /// Place of the number; of a vector the index.
        row: usize,
        /// 0 of a vector.
        column: usize,
        /// The number.
        value: f64,
    },
    /// A negative price.
    #[error("row {row} of stage {stage} has the negative weight {weight}")]
    NegativeWeight {
        /// Stage.
        stage: usize,
        /// Number of the row.
        row: usize,
        /// Its weight.
        weight: f64,
    },
    /// A lower bound above the upper one.
    #[error("input {input} of stage {stage} has the lower bound {lower} above the upper bound {upper}")]
    CrossedBounds {
        /// Stage.
        stage: usize,
        /// Number of the input.
        input: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The problem is not strictly convex in u.
    #[error("the cost is not strictly convex in u: the pivot of input {input} of stage {stage} vanishes or is negative")]
    NotConvex {
        /// Stage.
        stage: usize,
        /// Number of the input.
        input: usize,
    },
    /// Hard rows that no inputs within their bounds satisfy.
    #[error("hard constraints contradict each other by {by:e}: {constraints:?}")]
    Infeasible {
        /// Constraints that contradict each other.
        constraints: Vec<OcpConstraint>,
        /// Violation of the first of them. Condensed: the least where all the others hold. Riccati: where the sum of all violations of
        /// hard rows is least.
        by: f64,
    },
    /// The method did not end, for lack of accuracy: the problem is too badly conditioned.
    #[error("no solution after {iterations} iterations; relative error of the conditions of optimality {error:e}")]
    IterationLimit {
        /// Iterations made.
        iterations: usize,
        /// Error of the conditions of optimality; not known of a condensed problem: NaN.
        error: f64,
    },
    /// The condensed problem was refused: its numbers overflow, as those of an unstable system over a long horizon do.
    #[error("the condensed problem: {0}")]
    Condensed(#[source] QpError),
}
