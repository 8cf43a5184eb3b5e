//! How inputs move the clamped nodes.

mod drive;
mod hold;
pub use drive::{CommandError, Drive, DriveKind, EdgeClamp};
pub use hold::HeldEdge;
