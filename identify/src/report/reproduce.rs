//! Provenance of a report: command, seed, versions, files and their hashes.

use super::error::ReportError;
use crate::log::Setup;
use serde::{Deserialize, Serialize};
use std::path::{Component, Path, PathBuf};

/// The run that made a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// The command and its arguments.
    pub command: Vec<String>,
    /// Seed of everything random.
    pub seed: u64,
    /// Threads used; results do not depend on them.
    pub threads: usize,
    /// Logs beyond those the scene names.
    pub logs: Vec<PathBuf>,
    /// Names and contents of an example that is not otherwise on this disk; the report keeps a copy.
    pub example: Vec<(String, Vec<u8>)>,
    /// Files that were read.
    pub files: Vec<InputFile>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Path.
    pub path: String,
    /// Size.
    pub bytes: usize,
    /// 64-bit FNV-1a hash (Fowler, Noll, Vo; offset basis cbf29ce484222325, prime 100000001b3), in hexadecimal digits.
    pub fnv1a64: String,
}

impl InputFile {
    /// A file of this content.
    pub fn new(path: String, content: &[u8]) -> Self {
        Self { path, bytes: content.len(), fnv1a64: format!("{:016x}", fnv1a(content)) }
    }
}

#[derive(Serialize)]
struct Reproduce<'a> {
    schema_version: u32,
    command: &'a [String],
    folder: String,
    seed: u64,
    threads: usize,
    pliant: &'a str,
    platform: String,
    file: &'a [InputFile],
}

impl Provenance {
    /// Takes the hashes of the scene and of all its logs.
    ///
    /// # Errors
    /// A log that cannot be read any more.
    pub fn hash(mut self, setup: &Setup) -> Result<Self, ReportError> {
        let content = |path: &Path| std::fs::read(path).map_err(|source| ReportError::Read { path: path.to_owned(), source });
        if self.example.is_empty() {
            self.files = vec![InputFile::new(setup.source.file.clone(), setup.source.text.as_bytes())];
            let named = setup.experiment.record.iter().map(|record| setup.folder.join(&record.file));
            for path in named.chain(self.logs.iter().cloned()) {
                let file = InputFile::new(path.display().to_string(), &content(&path)?);
                self.files.push(file);
            }
        } else {
            self.files = self.example.iter().map(|(name, bytes)| InputFile::new(format!("example/{name}"), bytes)).collect();
        }
        Ok(self)
    }

    /// The command as one types it.
    pub(super) fn line(&self) -> String {
        let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
        let quote = |word: &String| {
            if !word.is_empty() && word.chars().all(plain) { word.clone() } else { format!("'{}'", word.replace('\'', "'\\''")) }
        };
        self.command.iter().map(quote).collect::<Vec<_>>().join(" ")
    }
}

/// Version of pliant.
pub(super) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The text of `reproduce.toml`.
pub(super) fn text(provenance: &Provenance) -> Result<String, ReportError> {
    let reproduce = Reproduce {
        schema_version: 1,
        command: &provenance.command,
        folder: std::env::current_dir().map(|folder| folder.display().to_string()).unwrap_or_default(),
        seed: provenance.seed,
        threads: provenance.threads,
        pliant: VERSION,
        platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        file: &provenance.files,
    };
    let text = toml::to_string(&reproduce).map_err(|source| ReportError::Toml { file: "reproduce.toml", source })?;
    Ok("# How this report was made; the same command on the same files gives the same numbers, on any number of threads.\n"
        .to_owned()
        + &text)
}

/// The provenance of a report in `folder`, from the text of its `reproduce.toml`.
pub(super) fn read(text: &str, folder: &Path) -> Result<Provenance, toml::de::Error> {
    #[derive(Deserialize)]
    struct Kept {
        command: Vec<String>,
        seed: u64,
        threads: usize,
        #[serde(default)]
        file: Vec<InputFile>,
    }
    let kept: Kept = toml::from_str(text)?;
    let content = |file: &InputFile| Some((file.path.clone(), std::fs::read(folder.join(&file.path)).ok()?));
    let copied = |file: &&InputFile| file.path.starts_with("example/");
    let example = kept.file.iter().filter(copied).filter_map(content).collect();
    Ok(Provenance {
        command: kept.command,
        seed: kept.seed,
        threads: kept.threads,
        example,
        files: kept.file,
        ..Provenance::default()
    })
}

/// The path of `file` as seen from the folder `from`.
pub fn relative(from: &Path, file: &Path) -> String {
    let (from, file) = (resolved(from), resolved(file));
    let (a, b): (Vec<Component>, Vec<Component>) = (from.components().collect(), file.components().collect());
    let common = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    // Nothing in common but the root: the absolute path says it better.
    if common <= 1 {
        return file.display().to_string();
    }
    let up = a[common..].iter().map(|_| Component::ParentDir);
    up.chain(b[common..].iter().copied()).collect::<PathBuf>().display().to_string()
}

/// An absolute path without links, as far as it exists.
fn resolved(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    match (path.canonicalize(), path.parent(), path.file_name()) {
        (Ok(path), ..) => path,
        (Err(_), Some(parent), Some(name)) => resolved(parent).join(name),
        _ => path,
    }
}

/// Fowler, Noll, Vo: 64-bit FNV-1a. Tells files apart; proves nothing against forgery.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn hashes_are_those_of_the_reference() {
        assert_eq!((fnv1a(b""), fnv1a(b"foobar")), (0xcbf2_9ce4_8422_2325, 0x8594_4171_f739_67e8));
    }

    #[test]
    fn the_file_is_toml() {
        let command = ["pliant", "diagnose", "my scene.toml", "it's"].map(str::to_owned).to_vec();
        let files = vec![InputFile::new("a.csv".into(), b"1")];
        let provenance = Provenance { command, seed: 7, threads: 2, files, ..Provenance::default() };
        assert_eq!(provenance.line(), r"pliant diagnose 'my scene.toml' 'it'\''s'");
        let table: toml::Table = toml::from_str(&text(&provenance).unwrap()).unwrap();
        assert_eq!(table["command"].as_array().unwrap().len(), 4);
        assert_eq!(table["file"][0]["bytes"].as_integer(), Some(1));
    }

    #[test]
    fn paths_are_seen_from_the_report() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("data")).unwrap();
        assert_eq!(relative(&at("out/report"), &at("data/run.csv")), "../../data/run.csv");
        assert_eq!(relative(Path::new("/a/b"), Path::new("/c/d.csv")), "/c/d.csv");
    }
}
