//! A folder that is there complete, or not at all.

use super::error::ReportError;
use crate::journal::{PART, PROGRESS};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Everything a report may hold; a folder with anything else is somebody's.
const OURS: [&str; 5] = ["report.html", "diagnosis.json", "scene_extended.toml", "reproduce.toml", "example"];
/// Those of a diagnosis that is not finished, in a folder of their own or in that of an older report, with which they go.
const UNFINISHED: [&str; 2] = [PROGRESS, PART];
/// Every report has this file, so a folder without it is not a report.
const MARK: &str = "reproduce.toml";

/// Refuses a place for the report before anything is computed.
///
/// # Errors
/// A folder that is not a report, or a place that cannot be written to.
pub fn check_folder(path: &Path) -> Result<(), ReportError> {
    check_ours(path)?;
    beside(path).map(drop).map_err(|error| ReportError::write(path, error))
}

/// Writes the files, and those of `example` into a folder of that name.
pub(super) fn write(path: &Path, files: &[(&str, String)], example: &[(String, Vec<u8>)]) -> Result<(), ReportError> {
    check_ours(path)?;
    let at = |error| ReportError::write(path, error);
    let new = beside(path).map_err(at)?;
    fill(new.path(), files, example).map_err(at)?;
    replace(path, new).map_err(at)
}

fn fill(folder: &Path, files: &[(&str, String)], example: &[(String, Vec<u8>)]) -> io::Result<()> {
    for (name, text) in files {
        write_file(&folder.join(name), text.as_bytes())?;
    }
    if !example.is_empty() {
        let folder = folder.join("example");
        std::fs::create_dir(&folder)?;
        example.iter().try_for_each(|(name, bytes)| write_file(&folder.join(name), bytes))?;
    }
    Ok(())
}

fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = std::fs::File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// Moves the new folder into place, the old one away; puts the old one back if that fails.
fn replace(path: &Path, new: TempDir) -> io::Result<()> {
    let old = beside(path)?;
    let aside = old.path().join("old");
    let existed = path.exists();
    if existed {
        std::fs::rename(path, &aside)?;
    }
    if let Err(error) = std::fs::rename(new.path(), path) {
        if existed {
            std::fs::rename(&aside, path)?;
        }
        return Err(error);
    }
    // Renamed, so there is nothing left for it to remove.
    let _ = new.keep();
    Ok(())
}

fn check_ours(path: &Path) -> Result<(), ReportError> {
    let at = |error| ReportError::write(path, error);
    if !path.exists() {
        return Ok(());
    }
    let mut names = Vec::new();
    for entry in std::fs::read_dir(path).map_err(at)? {
        names.push(entry.map_err(at)?.file_name().to_string_lossy().into_owned());
    }
    names.retain(|name| !UNFINISHED.contains(&name.as_str()));
    names.sort();
    let foreign = names.iter().find(|name| !OURS.contains(&name.as_str()));
    let found = foreign.or_else(|| names.first().filter(|_| !names.iter().any(|name| name == MARK)));
    match found {
        Some(found) => Err(ReportError::NotOurs { path: path.to_owned(), found: found.clone() }),
        None => Ok(()),
    }
}

/// A temporary folder beside a path, on the same file system.
fn beside(path: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".pliant-report-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777)); // less the umask
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    // The kind alone: the path in the error would be the temporary one.
    builder.tempdir_in(folder).map_err(|error| error.kind().into())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn files(text: &str) -> [(&'static str, String); 2] {
        [("report.html", text.to_owned()), (MARK, String::new())]
    }

    #[test]
    fn a_report_is_replaced_and_leaves_nothing_beside_it() {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        let example = [("scene.toml".to_owned(), b"a = 1".to_vec())];
        write(&path, &files("one"), &example).unwrap();
        write(&path, &files("two"), &[]).unwrap();
        assert_eq!(std::fs::read_to_string(path.join("report.html")).unwrap(), "two");
        assert!(!path.join("example").exists());
        assert_eq!(std::fs::read_dir(around.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_empty_folder_is_taken() {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        std::fs::create_dir(&path).unwrap();
        check_folder(&path).unwrap();
        write(&path, &files("one"), &[]).unwrap();
    }

    #[test]
    fn a_report_takes_the_place_of_what_was_not_finished() {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join(PROGRESS), "{}").unwrap();
        check_folder(&path).unwrap();
        write(&path, &files("one"), &[]).unwrap();
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 2);
    }

    #[test]
    fn what_is_not_ours_is_refused() {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("thesis.tex"), "years").unwrap();
        let error = write(&path, &files("one"), &[]).unwrap_err();
        assert!(error.to_string().contains("`thesis.tex`") && error.is_input(), "{error}");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1);
        std::fs::remove_file(path.join("thesis.tex")).unwrap();
        std::fs::write(path.join("report.html"), "of somebody else").unwrap();
        assert!(matches!(check_folder(&path), Err(ReportError::NotOurs { .. })));
        let file = around.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert!(check_folder(&file).unwrap_err().to_string().contains("a file of that name"));
        assert!(check_folder(&around.path().join("no/report")).unwrap_err().to_string().contains("does not exist"));
        assert_eq!(std::fs::read_dir(around.path()).unwrap().count(), 2);
    }
}
