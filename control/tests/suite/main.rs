//! Quadratic programs and problems of optimal control: conditions of optimality, agreement with Clarabel, the odd cases.

mod qp;
mod qp_cases;
