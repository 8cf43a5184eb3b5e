//! The page of a simulation.

use super::failure::Failure;
use super::{file, print};
use pliant::Rollout;
use pliant::view::{Caption, is_page, page};
use std::io::Write;
use std::path::Path;

/// Refuses a file that is not .html.
pub fn check_kind(path: &Path) -> Result<(), Failure> {
    if is_page(path) { Ok(()) } else { Err(Failure::PageKind { path: path.to_owned() }) }
}

/// Writes the page of a run, and says on stderr if it does not show every state.
pub fn write(path: &Path, scene: &Path, run: &Rollout) -> Result<(), Failure> {
    let name = |part: Option<&std::ffi::OsStr>| part.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let caption = Caption {
        title: name(scene.file_stem()),
        scene: name(scene.file_name()),
        command: std::env::args_os().skip(1).fold("pliant".to_owned(), |line, argument| line + " " + &argument.to_string_lossy()),
    };
    let page = page(run, &caption).map_err(|source| Failure::View { path: path.to_owned(), source })?;
    if let Some(note) = page.left_out() {
        print::message(&format!("{}: {note}", path.display()));
    }
    file::write(path, |out| out.write_all(page.html.as_bytes()))
}
