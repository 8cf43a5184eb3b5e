//! Decisions from gradients: optimal control through contact, plans, robust MPC.

mod constants;
mod kernels;
pub mod mpc;
pub mod mppi;
pub mod ocp;
pub mod plan;
pub mod problem;
pub mod qp;
pub mod task;
