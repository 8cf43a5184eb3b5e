//! Methods of factorization, and symmetry of matrices.

/// Method by which a matrix is factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Inside the block band, without pivoting: linear in the number of nodes. The way for ropes.
    Band,
    /// As a full matrix, with row pivoting (general) or Cholesky (symmetric).
    Dense,
    /// Front by front in a fill-reducing order, without pivoting: the way for sheets.
    Sparse,
}

/// Symmetry that may be assumed of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Symmetry {
    /// Symmetric positive definite apart from the identity rows of prescribed nodes; anything else is an error. Of the free part
    /// one triangle is read.
    Symmetric,
    /// Nothing.
    General,
}
