//! How inputs move the clamped nodes.

mod drive;
mod hold;
pub(crate) use drive::{Dual, differentiate};
pub use drive::{CommandError, Drive, DriveKind, EdgeClamp, Input};
pub use hold::HeldEdge;
