//! Forces of sheets: triangles that stretch, fold, dissipate and meet the air.
//!
//! ```text
//! membrane           stretching and shearing of a triangle              (area, E, ν, t)
//! membrane_damping   viscous resistance to it                           (area, η, t)
//! plate              bending, from the folds at a triangle's edges      (D, ν)
//! plate_damping      viscous resistance to it                           (c, ν)
//! face_drag          air against a triangle, along its normal           (drag, wind)
//! ```
//! The weight of a sheet's vertices is that of a rope's nodes, [`Gravity`](super::Gravity), with area for length. The rest shape is
//! constant but for its size: the parameter *area* scales all of it.

mod element;
mod face_drag;
mod fold;
mod membrane;
mod membrane_damping;
mod membrane_simd;
mod patch;
mod plate;
mod plate_damping;
mod plate_simd;
mod seams;
mod triangle;

pub use element::{bend_element, face_constants};
pub use face_drag::{FaceDrag, FaceDragLaw};
pub use membrane::{Membrane, MembraneLaw};
pub use membrane_damping::{MembraneDamping, MembraneDampingLaw};
pub use plate::{Plate, PlateLaw};
pub use plate_damping::{PlateDamping, PlateDampingLaw};
