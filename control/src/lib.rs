//! Decisions from gradients: optimal control through contact, plans, robust MPC.

mod constants;
mod kernels;
pub mod ocp;
pub mod qp;
