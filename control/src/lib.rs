//! Decisions from gradients: optimal control through contact, plans, robust MPC.

pub mod ocp;
