//! Fitting common unknowns and every record's initial state by Levenberg–Marquardt on exact tangents.
//!
//! With W the whitening by the noise model (AR coefficients, one σ per channel), minimised is
//! ```text
//! Σ_records |W (y − ŷ(z_r, φ))|² + Σ_r |z_r|² + priors on φ,      subject to bounds on φ
//! ```
//! The normal equations have an arrow's shape: each record's own z couples only to φ, and is eliminated record by record.
//! The noise model is re-estimated from the residual between rounds (feasible generalised least squares).

mod arrow;
mod constants;
mod lm;
mod noise;
mod segments;

pub(crate) use constants::FIT;
pub use lm::{FitOptions, Fitted, evenly, fit};
pub use noise::{first_noise, fit_noise, floors};
pub use segments::{Cut, approach, cut, followable, growth};
