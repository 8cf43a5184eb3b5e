//! Tests of the crate's public interface.

mod problems;
mod reference;
mod robust;
mod tube;
