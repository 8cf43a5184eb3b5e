//! The built-in example: a cable whose scene lacks something.

use super::failure::Failure;
use pliant::identify::log::Setup;
use pliant::scene::Source;
use std::path::Path;
use tempfile::TempDir;

/// File name of the example's scene.
pub const SCENE: &str = "example/scene.toml";

const TEXT: &str = include_str!("../../examples/hidden_effect/scene.toml");
const LOGS: [(&str, &[u8]); 3] = [
    ("run1.csv", include_bytes!("../../examples/hidden_effect/run1.csv")),
    ("run2.csv", include_bytes!("../../examples/hidden_effect/run2.csv")),
    ("run3.csv", include_bytes!("../../examples/hidden_effect/run3.csv")),
];

/// All its files.
pub fn files() -> Vec<(String, Vec<u8>)> {
    let scene = ("scene.toml".to_owned(), TEXT.as_bytes().to_vec());
    std::iter::once(scene).chain(LOGS.map(|(name, bytes)| (name.to_owned(), bytes.to_vec()))).collect()
}

/// Its logs in a temporary folder.
pub fn unpack() -> Result<TempDir, Failure> {
    let folder = tempfile::tempdir().map_err(|error| Failure::write(&std::env::temp_dir(), error))?;
    for (name, bytes) in LOGS {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).map_err(|error| Failure::write(&path, error))?;
    }
    Ok(folder)
}

/// Its scene, with logs in that folder.
pub fn setup(folder: &Path) -> Result<Setup, Failure> {
    Ok(Setup::from_source(Source::new(SCENE, TEXT), folder.to_owned())?)
}
