//! Stdout and stderr.

use super::failure::Failure;
use serde::Serialize;
use std::io::{ErrorKind, Write};

/// Prints data on stdout. A reader that has left (`pliant … | head`) is no failure.
pub fn data(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout().lock(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::stdout(error)),
        _ => Ok(()),
    }
}

/// Prints an object as JSON on stdout.
pub fn json(value: &impl Serialize) -> Result<(), Failure> {
    match pliant::identify::report::json::text(value) {
        Ok(text) => data(&text),
        Err(error) => Err(Failure::stdout(error.into())),
    }
}

/// Prints a message on stderr; there is no one to tell if that fails.
pub fn message(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
