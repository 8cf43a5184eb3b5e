//! Identify.

pub mod causes;
pub mod error;
pub mod fit;
pub mod log;
pub mod sensor;
pub mod shoot;
pub mod stats;
pub mod unknown;

pub use error::IdentifyError;
