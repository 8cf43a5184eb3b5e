//! Contact laws at one point, and how sharp they are. No body, no time, no matrix.
//!
//! **The problem.** For one contact with relative normal velocity v_n = gap⁺/h and tangential velocity v_t [m/s], friction
//! coefficient μ and smoothing κ \[J\], find w = (w₀; w̄) with
//!
//! ```text
//! s ∘ w = κ e,   s, w inside the second-order cone,   s = (v_n + ς; μ v_t),   impulse p = w₀ n + μ w̄   [N·s]
//! ```
//!
//! (s ∘ w = (s·w; s₀ w̄ + w₀ s̄), e = (1; 0)). With ς = |s̄|²/s₀ this is Coulomb's law, with ς = 0 its convex relaxation
//! ([`ContactLaw`]). Tangential vectors are *world* three-vectors, so that nobody has to choose a tangent frame; v_t must come
//! in already projected on the tangent plane, and w̄ lies in that plane at the root.
//!
//! **The flow.**
//! 1. a step offers (v_n, v_t) and its guess of w; κ comes from a scene's rest gap or from a [`Annealing`] schedule;
//! 2. [`linearize`] gives the natural residual F(w, s) and its derivatives, finite everywhere, for a Newton iteration;
//! 3. [`residual`] is the same, generic over the scalar, and [`linearize`] is held equal to it;
//! 4. at the root [`eigenvalues`] of both cone variables tell whether the iteration has settled;
//! 5. [`impulse`] is the root in closed form, for tests and for explicit use.
//!
//! ```
//! use pliant_smoothing::{ContactLaw, impulse, residual, slack};
//!
//! // A contact that slides at 0.2 m/s with μ = 0.5, at κ = 1e-9 J.
//! let (mu, kappa, v_n, v_t) = (0.5, 1e-9, 1e-6, [0.2, 0.0, 0.0]);
//! let (gamma_n, gamma_t): (f64, _) = impulse(ContactLaw::Coulomb, mu, kappa, v_n, v_t);
//! assert!((gamma_t[0] + mu * gamma_n).abs() < 1e-4 * gamma_n); // friction opposes, at μ times the normal impulse
//!
//! let w = [gamma_n, gamma_t[0] / mu, 0.0, 0.0];
//! let f: [f64; 4] = residual(ContactLaw::Coulomb, mu, kappa, 1e-3, v_n, v_t, w);
//! assert!(f.iter().all(|f| f.abs() < 1e-15));
//! assert!(slack(ContactLaw::Coulomb, mu, v_n, v_t)[0] > mu * 0.2); // inside the cone
//! ```

mod bounded;
mod law;
mod natural;
mod schedule;
mod split;

pub use bounded::{friction_residual, stop_residual};
pub use law::{ContactLaw, UnknownLaw, admissible, impulse, normal_slack, slack};
pub use natural::{Linearization, eigenvalues, linearize, residual};
pub use schedule::{Annealing, ScheduleError, hover, reach};
pub use split::{SplitPoint, split_linearize, split_residual};
