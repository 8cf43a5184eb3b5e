//! Quadratic programs and problems of optimal control: conditions of optimality, agreement with Clarabel, the odd cases.
#![allow(clippy::unwrap_used, clippy::panic)]

mod ocp;
mod ocp_cases;
mod ocp_checks;
mod qp;
mod qp_cases;
