//! `<mesh>` of `<asset>`: not read, but a model whose files are missing is likely incomplete.

use super::Reader;
use super::contact::no_such;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::View;
use std::path::{Path, PathBuf};

/// The meshes that a model names, and where their files are.
#[derive(Debug, Default)]
pub(super) struct Meshes {
    /// Names, and files if they have any.
    named: Vec<(String, Option<PathBuf>)>,
}

impl Meshes {
    /// All meshes of a model in the file `path`.
    pub fn read(root: &Element, path: &Path) -> Self {
        let mut folder = path.parent().unwrap_or(Path::new("")).to_owned();
        for directory in ["assetdir", "meshdir"] {
            // that of meshes alone counts more, and the last one given
            let given = root.children_of("compiler").filter_map(|c| c.value(directory)).last();
            if let Some(directory) = given {
                folder = path.parent().unwrap_or(Path::new("")).join(directory);
            }
        }
        let strip = root.children_of("compiler").filter_map(|c| c.value("strippath")).last() == Some("true");
        let own = |mesh: &Element| {
            let file = mesh.value("file").map(Path::new);
            let stem = file.and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
            let place = file.map(|file| folder.join(if strip { file.file_name().map_or(file, Path::new) } else { file }));
            (mesh.value("name").map(str::to_owned).or(stem).unwrap_or_default(), place)
        };
        let assets = root.children_of("asset").flat_map(|asset| asset.children_of("mesh"));
        Self { named: assets.map(own).collect() }
    }
}

impl Reader<'_> {
    /// Refuses a geom whose mesh the model does not have, or whose file is not there; says so if it was asked to approximate.
    pub(super) fn missing_mesh(&mut self, view: &View, name: &str) -> Result<(), ImportError> {
        let known = || self.meshes.named.iter().map(|(name, _)| name.as_str()).collect();
        let mistake = match self.meshes.named.iter().find(|(own, _)| own == name) {
            None => no_such("mesh", name, known()),
            Some((_, Some(file))) if !file.exists() => {
                ImportMistake::MissingFile { what: "mesh", path: file.display().to_string() }
            }
            Some(_) => return Ok(()),
        };
        if !self.work.options.approximate {
            return Err(view.error("mesh", mistake));
        }
        self.work.ignored(view.element, view.element.label(), format!("{mistake}"));
        Ok(())
    }
}
