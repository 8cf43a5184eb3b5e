//! Tests of the crate's public interface.

mod conformal;
mod observer;
mod problems;
mod reference;
mod robust;
mod tube;
