//! Options and result of an import.

use super::report::{Report, Verdict};
use pliant_scene::{Scene, to_toml};
use std::path::PathBuf;

/// Options of an import.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Folders of packages by name, for `package://name/…` in a URDF; others are looked for around the model.
    pub packages: Vec<(String, PathBuf)>,
    /// Approximate models that cannot be kept, instead of refusing them.
    pub approximate: bool,
    /// Let the root link of a URDF fly, instead of fixing it to the world.
    pub free_base: bool,
    /// Leave out the shapes that bodies touch with.
    pub no_contact: bool,
    /// Joints whose stops are left out, as they are known not to be reached.
    pub without_stops: Vec<String>,
}

/// A model that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The scene made of it.
    pub scene: Scene,
    /// The outcome of every element.
    pub report: Report,
}

impl Imported {
    /// The scene as a file.
    pub fn to_toml(&self) -> String {
        let count = |verdict| self.report.count(verdict);
        let comment = format!(
            "Imported from {} ({}): {} elements kept, {} approximated, {} ignored.",
            self.report.source,
            self.report.format,
            count(Verdict::Kept),
            count(Verdict::Approximated),
            count(Verdict::Ignored)
        );
        to_toml(&self.scene, &comment)
    }
}
