//! The mathematics that every layer shares: no physics, no scene, no solver.
//!
//! ```text
//! scalars     f64 and dual numbers over it (Real), three-vectors (Vec3)
//! geometry    rotation (unit quaternions), spatial (six-vectors), inertia (ten numbers of a rigid body), transport along curves,
//!             dihedral (angles of folds)
//! SIMD        simd (kernels over eight elements at a time), simd::rows (kernels over rows of matrices)
//! quantities  params (θ), state (x = (q, v, z)), input (arguments that a map is differentiated by)
//! texts       formula (expressions that somebody writes into a scene)
//! ```
//!
//! A law is written once, for any scalar; its derivative comes from dual numbers:
//! ```
//! use num_dual::Dual64;
//! use pliant_math::{Real, Vec3};
//!
//! fn length<S: Real>(x: &Vec3<S>) -> S {
//!     x.dot(x).sqrt()
//! }
//!
//! let x = Vec3::new(Dual64::new(3.0, 1.0), Dual64::from(4.0), Dual64::from(0.0));
//! assert_eq!(length(&x).re, 5.0);
//! assert!((length(&x).eps - 0.6).abs() < 1e-15); // ∂|x|/∂x₀ = x₀/|x|
//! ```

pub mod dihedral;
pub mod formula;
pub mod inertia;
pub mod input;
pub mod params;
pub mod rotation;
pub mod simd;
pub mod spatial;
pub mod state;
pub mod transport;

pub use input::Input;
pub use state::State;

use nalgebra::Vector3;
use num_dual::DualNum;

/// Scalars a law may be evaluated with: `f64` and dual numbers over it.
pub trait Real: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Real for T {}

/// A three-vector of any [`Real`].
pub type Vec3<S> = Vector3<S>;
