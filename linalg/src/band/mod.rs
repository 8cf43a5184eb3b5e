//! Matrices in a block band, factored without pivoting: linear in the number of nodes.

pub(crate) mod cholesky;
pub(crate) mod lu;
mod many;
pub(crate) mod sweep;
