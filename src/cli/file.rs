//! Output files, and why they cannot be written.

use super::failure::Failure;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

/// Writes a file that is there complete, or not at all.
pub fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> Result<(), Failure> {
    pliant::file::write(path, fill).map_err(|error| Failure::write(path, error))
}

/// Refuses a place that cannot be written to, before anything is computed.
pub fn check(path: &Path) -> Result<(), Failure> {
    pliant::file::check(path).map_err(|error| Failure::write(path, error))
}
