//! Decisions from gradients: optimal control through contact, plans, robust MPC.
//!
//! ```text
//! ocp         linear time-varying problems of optimal control, and the trait of what solves them
//! tube        tubes about a nominal trajectory under bounded disturbances, and the policy that keeps them
//! observer    the same with measurements instead of states: noise, delay
//! conformal   bounds of one-step prediction errors from held-out runs: the disturbances of a tube
//! ```

pub mod conformal;
mod linear;
pub mod observer;
pub mod ocp;
pub mod tube;
