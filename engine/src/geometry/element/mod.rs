//! Gaps between a *contact element* (an edge of a rope or sheet, or a triangle of a sheet) and features of fixed shapes, in closed form and
//! generic over the scalar, so that all their derivatives are automatic.
//!
//! The point of the contact element that is nearest to the feature is p = Σ β_i x_i, with weights β ≥ 0 that sum to 1 and depend on the nodes. By
//! the envelope theorem ∂gap/∂x_i = β_i n all the same, and the Hessian of the gap is ∂(β_i n)/∂x_j. Beyond its ends the nearest point
//! is an end: the gap is C¹ there, β only continuous.
//! Sign: gap < 0 penetrates; n points out of the shape, towards the contact element.

mod candidates;
mod nearest;

pub(crate) use candidates::{Candidates, candidates};
pub(crate) use nearest::{Nearest, Region, nearest};

#[cfg(test)]
mod tests;
