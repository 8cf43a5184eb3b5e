//! Decisions from gradients: optimal control through contact, plans, robust MPC.
//!
//! ```text
//! ocp         linear time-varying problems of optimal control, and the trait of what solves them
//! tube        tubes about a nominal trajectory under bounded disturbances, and the policy that keeps them
//! observer    the same with measurements instead of states: noise, delay
//! sensing     sensors, and estimates of the state from late, noisy readings
//! output      the controller of such an estimate
//! conformal   bounds of one-step prediction errors from held-out runs: the disturbances of a tube
//! ```

pub mod closed_loop;
pub mod conformal;
mod constants;
mod kernels;
mod linear;
pub mod mpc;
pub mod mppi;
pub mod observer;
pub mod ocp;
pub mod output;
pub mod plan;
pub mod problem;
pub mod qp;
pub mod robust;
pub mod sensing;
#[allow(rustdoc::broken_intra_doc_links)] // `[m]` is a unit here, and its escape would be read in the schema's descriptions
pub mod task;
pub mod tube;
