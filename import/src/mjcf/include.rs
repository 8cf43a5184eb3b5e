//! `<include file="…"/>`: the children of another file's root in its place.

use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::View;
use crate::xml;
use std::path::{Path, PathBuf};

/// The files being read, from the main one to that read now, and the `<include>` elements met so far.
struct Reading {
    open: Vec<PathBuf>,
    includes: Vec<Element>,
}

/// The model with all included files in place, and the elements that named them. Paths are relative to the folder of the main
/// file, as MuJoCo has it, or else to that of the file that includes.
pub fn expand(mut root: Element, path: &Path) -> Result<(Element, Vec<Element>), ImportError> {
    let mut reading = Reading { open: vec![path.to_owned()], includes: Vec::new() };
    reading.expand(&mut root)?;
    Ok((root, reading.includes))
}

impl Reading {
    fn expand(&mut self, element: &mut Element) -> Result<(), ImportError> {
        for mut child in std::mem::take(&mut element.children) {
            if child.tag == "include" {
                element.children.extend(self.included(&child)?);
                self.includes.push(child);
            } else {
                self.expand(&mut child)?;
                element.children.push(child);
            }
        }
        Ok(())
    }

    /// The elements that an `<include>` stands for.
    fn included(&mut self, include: &Element) -> Result<Vec<Element>, ImportError> {
        let file = View::plain(include).required("file")?;
        let path = find(file, &self.open[0], &self.open[self.open.len() - 1]);
        if self.open.iter().any(|p| same(p, &path)) {
            let chain: Vec<String> = self.open.iter().chain([&path]).map(|p| p.display().to_string()).collect();
            return Err(ImportError::at(include, ImportMistake::IncludeCycle { chain: chain.join(" → ") }));
        }
        let mut root = xml::read(&path, Some(include))?;
        self.open.push(path);
        self.expand(&mut root)?;
        self.open.pop();
        Ok(root.children)
    }
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
