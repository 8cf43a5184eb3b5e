//! Tubes of output feedback: an observer, state feedback on its estimate, and what both together reach.
//!
//! ```text
//! x_{k+1} = A x_k + B u_k + E_{k+1} w_{k+1},   y_i = C_i x_i + F_i e_i,   |w_j|₂ ≤ 1,  |e_i|₂ ≤ 1
//! the input of stage k knows y_0 … y_{k−d}: delay d ≥ 0
//! h_{k,i} = Σ_j |g [P_xx; P_ux][k,j] E_j|₂ + |g [P_xy; P_uy][k,j] F_j|₂
//! ```
//! `M = 1 − Z A` takes a trajectory to its increments. State feedback P_xf, P_uf solves M P_xf − Z B P_uf = 1, the observer
//! P_xo M − P_yo Z^d C = 1; their composition is [`Responses`].
//!
//! ```text
//! Observer             one Kalman recursion, in Joseph form, for all rows
//! OutputFeedbackTube   tightenings by rows, weights, gains: a TubeSynthesis
//! JointResponses       gains that columns share: estimate and error in one recursion of 2 nx rows
//! Responses            all blocks, for tests and for looking at
//! OutputPolicy         u of the measurements, stage by stage
//! ```
//! A delay is met by the delayed-measurement form: the filter runs at the time of the measurement, and the inputs applied since carry
//! its estimate to the present. The estimate is that of a filter for the state augmented by its d predecessors, at the cost of d = 0.
//!
//! References: Anderson, Doyle, Low and Matni (2019), "System level synthesis", section on output feedback; Kalman (1960); Bucy and Joseph
//! (1968) for the form of the recursion.

mod error;
mod joint;
mod kalman;
mod policy;
mod responses;
mod rows;
mod synthesis;

pub use error::ObserverError;
pub use joint::JointResponses;
pub(crate) use kalman::{Correction, predict, square};
pub use kalman::{Observer, Sensing};
pub use policy::OutputPolicy;
pub use responses::{Blocks, Responses, feedback_responses, observer_responses};
pub use synthesis::{OutputFeedbackTube, Sharing};
