//! The linear systems of a step behind one face: storage, factorization, solve, transposed solve, refinement.
//!
//! A [`NodeMatrix`] holds K. A [`Symbolic`] is made once per model: which [`Method`], which [`Symmetry`], which nodes are driven,
//! and whatever can be analysed before the numbers are known. A [`Factor`] holds the numbers: `refactor` at every Newton
//! iteration, then as many `solve`s and `solve_transpose`s as wanted, with `_many` for right-hand sides side by side and
//! `_refined` against the unregularized matrix. A factor can be cloned into a step's record and owns all it needs.
//!
//! **Driven nodes.** A node clamped by a gripper has identity rows. [`Symmetry::General`] takes them as they are. With
//! [`Symmetry::Symmetric`], K = [[K_ff, K_fp], [0, 1]] with K_ff symmetric: K_ff is factored alone, and K_fp enters the solves.
//!
//! ```
//! use pliant_engine::kkt::{NodeMatrix, Factor, Method, Symbolic, Symmetry};
//!
//! let mut k = NodeMatrix::band(3, 1);
//! for i in 0..3 {
//!     k.add_block(i, i, 4.0, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
//! }
//! k.add_block(0, 1, -1.0, &[[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
//! let symbolic = Symbolic::new(Method::Band, Symmetry::General, k.layout(), &[false; 3])?;
//! let mut factor = Factor::new(&symbolic);
//! factor.refactor(&k)?;
//! let mut x = vec![1.0; 9];
//! factor.solve(&mut x);
//! let mut back = vec![0.0; 9];
//! k.add_mul(1.0, &x, &mut back);
//! assert!(back.iter().all(|b| (b - 1.0).abs() < 1e-15));
//! # Ok::<(), pliant_engine::kkt::KktError>(())
//! ```

mod band_cholesky;
mod band_lu;
mod band_many;
mod band_sweep;
mod buffer;
mod coupling;
mod dense;
mod dense_cholesky;
mod dense_lu;
mod dissection;
mod driven;
mod factor;
mod frontal;
mod frontal_inverse;
mod frontal_solve;
mod fronts;
pub(crate) mod lanes;
mod layout;
mod matrix;
mod order;
mod products;
mod square;
mod symbolic;
mod system;
#[cfg(test)]
mod tests;

pub use coupling::Coupling;
pub use factor::Factor;
pub use layout::NodeLayout;
pub use matrix::NodeMatrix;
pub(crate) use matrix::{CarriedPlace, Place, Places};
pub use square::Square;
pub use symbolic::Symbolic;
pub use system::{System, SystemFactor};

use thiserror::Error;

/// How a matrix is factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Inside the block band, without pivoting: linear in the number of nodes. The way for ropes.
    Band,
    /// As a full matrix, with row pivoting (general) or Cholesky (symmetric).
    Dense,
    /// Front by front in a fill-reducing order, without pivoting: the way for sheets.
    Sparse,
}

/// What may be assumed of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Symmetry {
    /// Symmetric positive definite apart from the identity rows of driven nodes; anything else is an error. Of the free part
    /// one triangle is read.
    Symmetric,
    /// Nothing.
    General,
}

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
        /// What was compared.
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

impl KktError {
    /// The same with the row counted as the system's instead of the storage's.
    fn in_system(mut self, layout: &NodeLayout) -> Self {
        if let Self::Singular { row, dim, .. }
        | Self::NotPositiveDefinite { row, dim, .. }
        | Self::Growth { row, dim, .. }
        | Self::NotFinite { row, dim } = &mut self
        {
            *row = layout.system(*row).unwrap_or(*row);
            *dim = layout.dim();
        }
        self
    }
}

/// A pivot below this part of its row's size is rounding noise.
const PIVOT_FLOOR: f64 = 16.0 * f64::EPSILON;

/// Larger growth leaves too few digits for refinement to start from.
const GROWTH_LIMIT: f64 = 1e8;

/// Sum of magnitudes, in sixteen lanes; not finite if any entry is not.
#[inline(always)]
fn sum_abs(row: &[f64]) -> f64 {
    let (pieces, rest) = row.as_chunks::<16>();
    let mut lanes = [0.0; 16];
    for piece in pieces {
        for (lane, x) in lanes.iter_mut().zip(piece) {
            *lane += x.abs();
        }
    }
    for (lane, x) in lanes.iter_mut().zip(rest) {
        *lane += x.abs();
    }
    let mut eight: [f64; 8] = std::array::from_fn(|k| lanes[k] + lanes[k + 8]);
    for half in [4, 2, 1] {
        (0..half).for_each(|k| eight[k] += eight[k + half]);
    }
    eight[0]
}
