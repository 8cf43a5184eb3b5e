//! Decisions from gradients: optimal control through contact, plans, robust MPC.

pub mod conformal;
mod linear;
pub mod observer;
pub mod ocp;
pub mod tube;
