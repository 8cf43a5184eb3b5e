//! The report of a diagnosis: a folder with a page for people, and files for machines.
//!
//! ```text
//! report.html          the story, self-contained: no network, no scripts
//! diagnosis.json       the object behind it
//! scene_extended.toml  the scene with the estimates in place
//! reproduce.toml       command, seed, versions, files and their hashes
//! ```
//! The folder is complete or absent: it is built beside its place and renamed at the end. A report of pliant is replaced; a
//! folder with anything else in it is refused.

mod curves;
mod error;
mod extended;
mod folder;
pub mod json;
mod page;
mod place_body;
mod place_cloth;
mod place_rod;
mod plot;
mod reproduce;
#[cfg(test)]
pub(crate) mod sample;
mod saved;
mod shapes;
mod stages;
mod story;

pub use error::ReportError;
pub use folder::check_folder;
pub use reproduce::{InputFile, Provenance, relative};
pub use saved::Saved;
pub use story::{headline, summary};

use crate::diagnose::Diagnosis;
use crate::log::Setup;
use std::path::Path;

/// Writes the report of a diagnosis as the folder `path`.
///
/// # Errors
/// A folder that is not a report, a file system that refuses, numbers that cannot be written.
pub fn write_report(path: &Path, diagnosis: &Diagnosis, setup: &Setup, provenance: &Provenance) -> Result<(), ReportError> {
    let reproduce = reproduce::text(provenance)?;
    let files = [
        ("report.html", page::page(diagnosis, provenance)?),
        ("diagnosis.json", json::text(diagnosis).map_err(ReportError::Json)? + "\n"),
        ("scene_extended.toml", extended::text(diagnosis, setup, provenance, path)?),
        ("reproduce.toml", reproduce),
    ];
    folder::write(path, &files, &provenance.example)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_report_is_a_page_and_three_files() {
        let around = tempfile::tempdir().unwrap();
        let path = around.path().join("report");
        let example = vec![("scene.toml".to_owned(), b"".to_vec()), ("run1.csv".to_owned(), b"t".to_vec())];
        let provenance = Provenance { command: vec!["pliant".into(), "diagnose".into()], example, ..Provenance::default() };
        let provenance = provenance.hash(&sample::setup()).unwrap();
        write_report(&path, &sample::diagnosis(), &sample::setup(), &provenance).unwrap();
        let read = |name: &str| std::fs::read_to_string(path.join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("diagnosis.json")).unwrap();
        assert_eq!(json["verdict"], "named");
        assert!(read("report.html").ends_with("</html>"));
        assert!(read("scene_extended.toml").contains("file = \"example/run1.csv\""));
        assert!(read("reproduce.toml").contains("path = \"example/run1.csv\""));
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 5);
    }

    #[test]
    fn logs_that_have_gone_are_named() {
        let error = Provenance::default().hash(&sample::setup()).unwrap_err();
        assert!(error.to_string().starts_with("/somewhere/data/run1.csv: cannot be read again"), "{error}");
    }
}
