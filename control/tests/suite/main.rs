//! Tubes, observers and conformal bounds from outside; Clarabel is the reference.
#![allow(clippy::unwrap_used, clippy::panic)]
#![allow(clippy::needless_range_loop)] // loops over stages, rows and columns, written like the sums they are

mod conformal;
mod observer;
mod problems;
mod reference;
mod robust;
mod tube;
