//! `<include file="…"/>`: the children of another file's root in its place.

use crate::import::error::{ImportError, ImportMistake};
use crate::import::view::View;
use crate::import::xml::{self, Element};
use std::path::{Path, PathBuf};

/// The model with all included files in place. Paths are relative to the folder of the main file, as MuJoCo has it, or else to
/// that of the file that includes.
pub fn expand(mut root: Element, path: &Path) -> Result<Element, ImportError> {
    let main = path.to_owned();
    expand_in(&mut root, &main, &mut vec![main.clone()])?;
    Ok(root)
}

fn expand_in(element: &mut Element, main: &Path, open: &mut Vec<PathBuf>) -> Result<(), ImportError> {
    for mut child in std::mem::take(&mut element.children) {
        if child.tag == "include" {
            element.children.extend(included(&child, main, open)?);
        } else {
            expand_in(&mut child, main, open)?;
            element.children.push(child);
        }
    }
    Ok(())
}

/// What an `<include>` stands for.
fn included(include: &Element, main: &Path, open: &mut Vec<PathBuf>) -> Result<Vec<Element>, ImportError> {
    let file = View::plain(include).required("file")?;
    let path = find(file, main, open.last().map_or(main, PathBuf::as_path));
    if open.iter().any(|p| same(p, &path)) {
        let chain: Vec<String> = open.iter().chain([&path]).map(|p| p.display().to_string()).collect();
        return Err(ImportError::at(include, ImportMistake::IncludeCycle { chain: chain.join(" → ") }));
    }
    let mut root = xml::read(&path, Some(include))?;
    open.push(path);
    expand_in(&mut root, main, open)?;
    open.pop();
    Ok(root.children)
}

fn find(file: &str, main: &Path, including: &Path) -> PathBuf {
    let beside = |path: &Path| path.parent().unwrap_or(Path::new("")).join(file);
    let (first, second) = (beside(main), beside(including));
    if !first.exists() && second.exists() { second } else { first }
}

fn same(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}
