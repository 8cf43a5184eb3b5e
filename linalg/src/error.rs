//! Why a system could not be set up or factored.

use thiserror::Error;

/// Why a system could not be set up or factored. Rows count scalar rows: three per node, then one per twist.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum KktError {
    /// A pivot vanished beside the size of its row (with row pivoting: of the unknown `row`).
    #[error("singular matrix: pivot {pivot:e} in row {row} of {dim} is nothing beside its size {size:e}")]
    Singular {
        /// Scalar row.
        row: usize,
        /// Rows of the matrix.
        dim: usize,
        /// The pivot found.
        pivot: f64,
        /// Size of the entries it should be compared with.
        size: f64,
    },
    /// A symmetric matrix has a direction of negative or zero curvature.
    #[error("matrix is not positive definite: pivot {pivot:e} in row {row} of {dim}, size {size:e}")]
    NotPositiveDefinite {
        /// Scalar row.
        row: usize,
        /// Rows of the matrix.
        dim: usize,
        /// The pivot found.
        pivot: f64,
        /// The diagonal entry before elimination.
        size: f64,
    },
    /// Elimination without pivoting made the entries of a row too large to be trusted.
    #[error("entries of row {row} of {dim} grew by a factor {growth:e} in elimination without pivoting")]
    Growth {
        /// Scalar row.
        row: usize,
        /// Rows of the matrix.
        dim: usize,
        /// Sum of the row's magnitudes after elimination over that before.
        growth: f64,
    },
    /// A row holds an infinite or undefined number.
    #[error("row {row} of {dim} is not finite")]
    NotFinite {
        /// Scalar row.
        row: usize,
        /// Rows of the matrix.
        dim: usize,
    },
    /// A matrix or flag list does not have the size of the model.
    #[error("{what}: expected {expected}, got {found}")]
    Shape {
        /// The compared quantity.
        what: &'static str,
        /// The size of the model.
        expected: usize,
        /// The size given.
        found: usize,
    },
    /// A node is not there, or has two places where it may have one.
    #[error("node {node} is missing, there twice, or beyond the {n_nodes} nodes of the matrix")]
    Order {
        /// Node.
        node: usize,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// Symmetric factorizations have no place for twists.
    #[error("matrices with twists are not factored as symmetric ones: frames carried along a bent rod break the symmetry")]
    Twists,
    /// A sparse layout was to be factored in a band.
    #[error("matrices of a sparse layout are not factored in a band")]
    NoBand,
    /// The analysis of a sparse pattern failed.
    #[error("analysis of a sparse {dim} × {dim} pattern failed: {source}")]
    Analysis {
        /// Rows of the matrix.
        dim: usize,
        /// The library's reason.
        source: faer::sparse::FaerError,
    },
}
