//! The linear systems of a step behind one face: storage, factorization, solve, transposed solve, refinement.
//!
//! A [`NodeMatrix`] holds K. A [`Symbolic`] is made once per model: which [`Method`], which [`Symmetry`], which nodes are prescribed,
//! and all that is analysed before the numbers are known. A [`Factor`] holds the numbers: `refactor` at every Newton
//! iteration, then as many `solve`s and `solve_transpose`s as wanted, with `_many` for right-hand sides side by side and
//! `_refined` against the unregularized matrix. A factor can be cloned into a step's record and owns all it needs.
//!
//! **Prescribed nodes.** A node clamped by a gripper has identity rows. [`Symmetry::General`] takes them as they are. With
//! [`Symmetry::Symmetric`], K = [[K_ff, K_fp], [0, 1]] with K_ff symmetric: K_ff is factored alone, and K_fp enters the solves.
//!
//! **Storage** is the [`matrix`](NodeMatrix) with its products, where a [`layout`](NodeLayout) has room; `buffer` keeps the memory of matrices
//! that are dropped. **Methods** are `band`, `dense` and `multifrontal`. Beside the nodes' block a [`System`] has a full one for bodies
//! ([`Square`]) and the coupling of the two ([`Coupling`]), eliminated by its Schur complement.
//!
//! ```
//! use pliant_linalg::{NodeMatrix, Factor, Method, Symbolic, Symmetry};
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
//! # Ok::<(), pliant_linalg::KktError>(())
//! ```

mod band;
mod buffer;
mod constants;
mod coupling;
mod dense;
mod error;
mod factor;
mod layout;
mod matrix;
mod method;
mod multifrontal;
mod panel;
mod pivot;
mod prescribed;
mod products;
mod square;
mod symbolic;
mod system;
#[cfg(test)]
mod tests;

pub use coupling::Coupling;
pub use error::KktError;
pub use factor::Factor;
pub use layout::NodeLayout;
pub use matrix::{CarriedPlace, NodeMatrix, Place, Places};
pub use method::{Method, Symmetry};
pub use products::Sums;
pub use square::Square;
pub use symbolic::Symbolic;
pub use system::{System, SystemFactor};
