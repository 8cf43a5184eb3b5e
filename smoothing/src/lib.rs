//! Contact laws at one point, and how sharp they are. No body, no time, no matrix.
//!
//! **The problem.** For one contact with relative normal velocity v_n = gap⁺/h and tangential velocity v_t [m/s], friction
//! coefficient μ, slip factor σ and smoothing κ \[J\], find w = (w₀; w̄) with
//!
//! ```text
//! s ∘ w = κ e,   s, w inside the second-order cone,   s = (v_n + ς; σ v_t),   impulse p = w₀ n + μ w̄   [N·s]
//! ```
//!
//! (s ∘ w = (s·w; s₀ w̄ + w₀ s̄), e = (1; 0)). With ς = |s̄|²/s₀ this is Coulomb's law: any σ > 0 has the same limit κ → 0, and the
//! larger σ, the sharper friction turns from sticking to sliding at the same κ (about v_n/σ). With ς = 0 and σ = μ it is the convex
//! relaxation ([`ContactLaw`]). Tangential vectors are *world* three-vectors, so that nobody has to choose a tangent frame; v_t must come
//! in already projected on the tangent plane, and w̄ lies in that plane at the root.
//!
//! **The flow.**
//! 1. a step offers (v_n, v_t) and its guess of w; κ comes from a scene's rest gap or from a [`Annealing`] schedule;
//! 2. [`linearize`] gives the natural residual F(w, s) and its derivatives, finite everywhere, for a Newton iteration;
//! 3. [`residual`] is the same, generic over the scalar, and [`linearize`] is held equal to it;
//! 4. at the root [`eigenvalues`] of both cone variables tell whether the iteration has settled;
//! 5. [`central`] is the root in closed form, for tests and for explicit use.
//!
//! ```
//! use pliant_smoothing::{ContactLaw, central, residual, slack};
//!
//! // A contact that slides at 0.2 m/s, at κ = 1e-9 J.
//! let (slip, kappa, v_n, v_t) = (2.0, 1e-9, 1e-6, [0.2, 0.0, 0.0]);
//! let w: [f64; 4] = central(ContactLaw::Coulomb, slip, kappa, v_n, v_t);
//! assert!((w[1] + w[0]).abs() < 1e-5 * w[0]); // friction opposes, at μ times the normal impulse
//!
//! let f: [f64; 4] = residual(ContactLaw::Coulomb, slip, kappa, 1e-3, v_n, v_t, w);
//! assert!(f.iter().all(|f| f.abs() < 1e-14));
//! assert!(slack(ContactLaw::Coulomb, slip, v_n, v_t)[0] > slip * 0.2); // inside the cone
//! ```

mod bounded;
mod law;
mod natural;
mod schedule;
mod split;

pub use bounded::{friction_residual, stop_residual};
pub use law::{ContactLaw, UnknownLaw, admissible, central, normal_slack, slack};
pub use natural::{Linearization, eigenvalues, linearize, residual};
pub use schedule::{Annealing, ScheduleError, hover, reach};
pub use split::{SplitPoint, split_linearize, split_residual};
