//! Articulated bodies: what hangs on what, where it is, and what its inertia asks for.
//!
//! **The problem.** Coordinates q of joints (a quaternion for every ball), velocities v; the step needs τ = ID(q̄, v̄, ā; θ), the
//! forces that the joints must exert, and ∂τ/∂(q̄, v̄, ā) in O(n · depth).
//!
//! **The flow.** 1. [`Tree`] is built once; 2. [`Frames`] places its bodies and axes; 3. [`dynamics`] turns them into τ and its
//! partials, which `spread` multiplies out into a matrix.

mod assemble;
pub mod drag;
pub mod dynamics;
mod energy;
pub mod frames;
pub mod operational;
pub mod tangent_maps;
#[cfg(test)]
mod tests;
mod tree;

pub use frames::{Frame, Frames};
pub use tangent_maps::TangentMaps;
pub use tree::{Body, Dof, Joint, JointKind, Tree, quaternion};
