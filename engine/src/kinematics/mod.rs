//! How inputs move the clamped nodes.

mod constants;
mod drive;
mod hold;
pub use drive::{CommandError, Drive, DriveKind, EdgeClamp};
pub use hold::HeldEdge;
