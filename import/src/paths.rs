//! Files that a URDF names: beside it, or in a package.

use crate::xml;
use std::path::{Path, PathBuf};

/// The file that a model names, or the places where it was looked for.
///
/// `package://name/rest` (or `model://`) is `rest` in the folder that `packages` has for the package. Otherwise it is looked for in the
/// model's folder and those above it: in one of the package's name, in one whose `package.xml` gives it this name, and at last in any.
/// Other names are relative to the model's folder.
pub fn locate(model: &Path, name: &str, packages: &[(String, PathBuf)]) -> Result<PathBuf, Vec<PathBuf>> {
    let folder = model.parent().unwrap_or(Path::new(""));
    let places = match name.strip_prefix("package://").or_else(|| name.strip_prefix("model://")) {
        Some(package) => in_package(folder, package, packages),
        None => vec![folder.join(name.strip_prefix("file://").unwrap_or(name))],
    };
    places.iter().find(|place| place.is_file()).cloned().ok_or(places)
}

fn in_package(folder: &Path, path: &str, packages: &[(String, PathBuf)]) -> Vec<PathBuf> {
    let (package, rest) = path.split_once('/').unwrap_or((path, ""));
    if let Some((_, folder)) = packages.iter().find(|(name, _)| name == package) {
        return vec![folder.join(rest)];
    }
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let above: Vec<&Path> = absolute.ancestors().filter(|above| !above.as_os_str().is_empty()).collect();
    let beside = above.iter().map(|above| above.join(package).join(rest));
    let named = above.iter().filter(|above| is_package(above, package)).map(|above| above.join(rest));
    let anywhere = above.iter().map(|above| above.join(rest));
    let mut places: Vec<PathBuf> = Vec::new();
    for place in named.chain(beside).chain(anywhere) {
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places
}

/// Whether a folder is that package: by its name, or by the `<name>` in its `package.xml`.
fn is_package(folder: &Path, package: &str) -> bool {
    let named = folder.file_name().is_some_and(|name| name == package);
    named || xml::text_of(&folder.join("package.xml"), "name").is_some_and(|name| name == package)
}
