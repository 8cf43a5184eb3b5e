//! Why a report cannot be written.

use std::path::PathBuf;

/// Errors of writing a report: place, mistake, likely cause and fix.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The place holds something that is not a report.
    #[error(
        "{path}: holds `{found}`, which is not part of a report of pliant\n  likely cause: the folder is used for something \
         else\n  fix: choose another folder with `--out`, or move that file away", path = .path.display()
    )]
    NotOurs {
        /// The folder.
        path: PathBuf,
        /// Name of the thing that is no part of a report.
        found: String,
    },
    /// A file or folder cannot be written.
    #[error("{path}: cannot be written: {source}\n  likely cause: {cause}\n  fix: {fix}", path = .path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// The file system's error.
        source: std::io::Error,
        /// Likely cause.
        cause: &'static str,
        /// Fix.
        fix: &'static str,
    },
    /// A log cannot be read to take its hash.
    #[error("{path}: cannot be read again: {source}\n  likely cause: it was moved meanwhile\n  fix: run again", path = .path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// The file system's error.
        source: std::io::Error,
    },
    /// A file of a report cannot be read.
    #[error("{path}: cannot be read: {source}\n  likely cause: it is not the folder or the JSON of a diagnosis\n  fix: give the folder \
             that `pliant diagnose --out` wrote, or a file with the output of `pliant diagnose --json`", path = .path.display())]
    Absent {
        /// File.
        path: PathBuf,
        /// The file system's error.
        source: std::io::Error,
    },
    /// A file of a report holds something else.
    #[error("{path}: is not part of a report of this version: {what}\n  likely cause: another version of pliant wrote it, or it was \
             changed\n  fix: run `pliant diagnose` again", path = .path.display())]
    Foreign {
        /// File.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The page cannot be filled in.
    #[error("report.html: {0}\n  likely cause: a mistake in pliant's own template\n  fix: report this as a bug")]
    Page(#[from] minijinja::Error),
    /// The diagnosis cannot be written as JSON.
    #[error("diagnosis.json: {0}\n  likely cause: a mistake in pliant\n  fix: report this as a bug")]
    Json(serde_json::Error),
    /// The extended scene or the provenance cannot be written as TOML.
    #[error("{file}: {source}\n  likely cause: a mistake in pliant\n  fix: report this as a bug")]
    Toml {
        /// File.
        file: &'static str,
        /// The writer's message.
        source: toml::ser::Error,
    },
}

impl ReportError {
    /// The error of a refused write, with advice.
    pub(super) fn write(path: &std::path::Path, source: std::io::Error) -> Self {
        use std::io::ErrorKind as E;
        let (cause, fix) = match source.kind() {
            E::StorageFull | E::QuotaExceeded => {
                ("the disk is full; nothing was left behind", "free some space, or write to another disk with `--out`")
            }
            E::NotFound => ("the folder around it does not exist", "create it, or correct `--out`"),
            E::PermissionDenied | E::ReadOnlyFilesystem => {
                ("the folder around it may not be written to", "choose another place with `--out`")
            }
            E::NotADirectory | E::AlreadyExists => ("there is a file of that name", "choose another place with `--out`"),
            _ => ("the file system refused", "choose another place with `--out`"),
        };
        Self::Write { path: path.to_owned(), source, cause, fix }
    }

    /// Whether the input is at fault (exit code 2).
    pub fn is_input(&self) -> bool {
        matches!(self, Self::NotOurs { .. } | Self::Write { .. } | Self::Read { .. } | Self::Absent { .. } | Self::Foreign { .. })
    }
}
