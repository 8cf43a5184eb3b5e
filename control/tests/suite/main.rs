//! Quadratic programs, problems of optimal control, tubes, observers, conformal bounds and plans, against closed forms, differences and
//! Clarabel.
#![allow(clippy::unwrap_used, clippy::panic)]
#![allow(clippy::needless_range_loop)] // loops over stages, rows and columns, written like the sums they are

mod conformal;
mod observer;
mod ocp;
mod ocp_cases;
mod ocp_checks;
mod output;
mod plan;
mod problems;
mod qp;
mod qp_cases;
mod reference;
mod robust;
mod tube;
