//! The linear systems of a step behind one face: storage, factorization, solve, transposed solve, refinement.

mod matrix;
pub use matrix::BlockBand;
