//! How inputs move the clamped nodes.

mod drive;
mod hold;
pub use drive::{CommandError, Drive, DriveKind, EdgeClamp, Input};
pub(crate) use drive::{Dual, differentiate};
pub use hold::HeldEdge;
