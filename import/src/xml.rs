//! XML as a tree of elements.

use super::element::{Attribute, Element};
use super::error::{ImportError, ImportMistake};
use crate::constants::IMPORT;
use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;

/// Reads a file into its root element; `from` is the element that asked for it.
pub fn read(path: &Path, from: Option<&Element>) -> Result<Element, ImportError> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| match from {
        Some(element) if error.kind() == std::io::ErrorKind::NotFound => {
            ImportError::at(element, ImportMistake::MissingFile { what: "include file", path: file.clone(), looked: Vec::new() })
        }
        _ => ImportError::in_file(&file, 0, ImportMistake::Read { error: error.to_string() }),
    })?;
    parse(&text, &file)
}

/// Parses a text; `file` is its name in errors.
pub fn parse(text: &str, file: &str) -> Result<Element, ImportError> {
    let document = roxmltree::Document::parse(text).map_err(|error| {
        let message = error.to_string();
        let xacro = message.contains("xacro") || text.contains("<xacro:") || text.contains("$(arg");
        ImportError::in_file(file, error.pos().row as usize, ImportMistake::Syntax { message, xacro })
    })?;
    copy(&document, document.root_element(), &Rc::from(file), 0)
}

/// The text of the first child of that tag of a file's root, if there is such a file.
pub fn text_of(path: &Path, tag: &str) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let document = roxmltree::Document::parse(&text).ok()?;
    let child = document.root_element().children().find(|c| c.has_tag_name(tag))?;
    child.text().map(|text| text.trim().to_owned())
}

fn copy(document: &roxmltree::Document, node: roxmltree::Node, file: &Rc<str>, depth: usize) -> Result<Element, ImportError> {
    let line = |byte: usize| document.text_pos_at(byte).row as usize;
    let attribute = |a: roxmltree::Attribute| Attribute {
        name: a.name().to_owned(),
        value: a.value().to_owned(),
        line: line(a.range().start),
        used: Cell::new(false),
    };
    let mut element = Element {
        file: Rc::clone(file),
        line: line(node.range().start),
        tag: node.tag_name().name().to_owned(),
        attributes: node.attributes().map(attribute).collect(),
        children: Vec::new(),
        seen: Cell::new(false),
    };
    if node.tag_name().namespace().is_some_and(|space| space.contains("xacro")) {
        let message = format!("<{}> is a macro", node.tag_name().name());
        return Err(ImportError::in_file(file, element.line, ImportMistake::Syntax { message, xacro: true }));
    }
    if depth > IMPORT.deepest {
        return Err(ImportError::at(&element, too_deep()));
    }
    for child in node.children().filter(|c| c.is_element()) {
        element.children.push(copy(document, child, file, depth + 1)?);
    }
    Ok(element)
}

/// The mistake of more than 300 levels.
pub fn too_deep() -> ImportMistake {
    ImportMistake::Unsupported {
        what: format!("a tree of more than {} levels", IMPORT.deepest),
        reason: "it would exhaust the stack".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn lines_and_marks() {
        let root = parse("<a>\n  <b x='1'\n     y='2'/>\n</a>", "f.xml").unwrap();
        let b = root.child("b").unwrap();
        assert_eq!((b.line, b.attributes[1].line, root.size()), (2, 3, 2));
        assert_eq!(b.value("x"), Some("1"));
        assert_eq!(b.take_unused(), ["y"]);
        assert!(b.take_unused().is_empty() && !b.is_seen());
    }
}
