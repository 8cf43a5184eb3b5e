//! Decisions from gradients: optimal control through contact, plans, robust MPC.

pub mod closed_loop;
pub mod conformal;
mod constants;
mod kernels;
mod linear;
pub mod mpc;
pub mod mppi;
pub mod observer;
pub mod ocp;
pub mod plan;
pub mod problem;
pub mod qp;
pub mod robust;
pub mod task;
pub mod tube;
