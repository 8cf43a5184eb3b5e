//! Quadratic programs and problems of optimal control, tubes, observers and conformal bounds, against closed forms and Clarabel.

mod conformal;
mod observer;
mod ocp;
mod ocp_cases;
mod ocp_checks;
mod problems;
mod qp;
mod qp_cases;
mod reference;
mod robust;
mod tube;
