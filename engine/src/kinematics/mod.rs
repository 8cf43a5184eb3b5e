//! How inputs move the clamped nodes.

mod drive;
pub use drive::{CommandError, Drive, DriveKind, EdgeClamp, Input};
