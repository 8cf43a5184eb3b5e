//! Why there is no tube.

use crate::ocp::OcpError;

/// A row of a stage, or a bounded input of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// The row of this number among the stage's rows.
    Row(usize),
    /// The bounds of the input of this number.
    Input(usize),
}

/// Why there is no tube.
#[derive(Clone, Debug, thiserror::Error)]
pub enum TubeError {
    /// An array's size does not fit the problem's.
    #[error("{what}, stage {stage}: {rows} × {columns} where the problem needs {needed_rows} × {needed_columns}")]
    Size {
        /// The array.
        what: &'static str,
        /// Stage k.
        stage: usize,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Rows needed.
        needed_rows: usize,
        /// Columns needed.
        needed_columns: usize,
    },
    /// A number is infinite or NaN.
    #[error("{what}, stage {stage}: a number that is not finite")]
    NotFinite {
        /// The array.
        what: &'static str,
        /// Stage k.
        stage: usize,
    },
    /// R_r + BᵀSB is not positive definite.
    #[error("stage {stage}: the tube's cost is not strictly convex in input {input}")]
    Indefinite {
        /// Stage k.
        stage: usize,
        /// Number of the input.
        input: usize,
    },
    /// Opposed hard rows, or the bounds of an input, leave less room than the tube needs.
    #[error(
        "stage {stage}, {constraint:?}: disturbances need {needed:.6}, the constraints leave {room:.6} ({})",
        if *.any_policy { "under any policy" } else { "under the policies found" }
    )]
    Impossible {
        /// Stage k.
        stage: usize,
        /// The row or input.
        constraint: Constraint,
        /// Width that the disturbances need: the sum of both tightenings of opposed rows, twice that of an input with two bounds.
        needed: f64,
        /// Width that the constraints leave.
        room: f64,
        /// Whether no policy whatever needs less: `needed` is then the part that comes from disturbances which no input can answer in
        /// time.
        any_policy: bool,
    },
    /// Policies are asked stage by stage.
    #[error("the policy was asked for stage {asked}, next is {next} of {horizon}")]
    Order {
        /// The stage asked for.
        asked: usize,
        /// The stage whose turn it is.
        next: usize,
        /// Number of stages.
        horizon: usize,
    },
    /// The nominal problem has no solution.
    #[error("the tightened problem, iteration {iteration}: {source}")]
    Nominal {
        /// Number of the iteration.
        iteration: usize,
        /// The error of its solver.
        source: OcpError,
    },
}
