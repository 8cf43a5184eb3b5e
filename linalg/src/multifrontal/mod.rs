//! Sparse matrices, front by front: the multifrontal method (Duff and Reid 1983).
//!
//! [`symbolic`] analyses a pattern in the order that [`order`] or [`dissection`] finds; [`factor`] eliminates without pivoting; [`solve`]
//! substitutes, and [`inverse`] finds the whole inverse.

mod dissection;
mod factor;
mod inverse;
mod order;
mod solve;
mod symbolic;

pub(crate) use factor::Numeric;
pub(crate) use symbolic::Symbolic;
