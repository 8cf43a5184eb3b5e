//! XML as a tree of elements that know their file and line, and whether anybody has looked at them.
//!
//! What is read is marked, so that at the end everything that was not read can be reported.

use super::error::{ImportError, ImportMistake};
use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;

/// Levels of elements, and of links that hang on each other.
pub const DEEPEST: usize = 300;

/// An element.
#[derive(Clone, Debug)]
pub struct Element {
    /// File it stands in.
    pub file: Rc<str>,
    /// Line it begins at, counted from 1.
    pub line: usize,
    /// Its tag, without a namespace.
    pub tag: String,
    /// Its attributes.
    pub attributes: Vec<Attribute>,
    /// Elements in it.
    pub children: Vec<Element>,
    seen: Cell<bool>,
}

/// An attribute.
#[derive(Clone, Debug)]
pub struct Attribute {
    /// Name.
    pub name: String,
    /// Value.
    pub value: String,
    /// Line, counted from 1.
    pub line: usize,
    used: Cell<bool>,
}

impl Attribute {
    /// Marks it as read or reported.
    pub fn mark(&self) {
        self.used.set(true);
    }

    /// Whether it has been read or reported.
    pub fn is_used(&self) -> bool {
        self.used.get()
    }
}

impl Element {
    /// The attribute of that name; marks it as read.
    pub fn get(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name).inspect(|a| a.mark())
    }

    /// The value of the attribute of that name; marks it as read.
    pub fn value(&self, name: &str) -> Option<&str> {
        self.get(name).map(|a| a.value.as_str())
    }

    /// Children of that tag.
    pub fn children_of<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |c| c.tag == tag)
    }

    /// The first child of that tag.
    pub fn child<'a>(&'a self, tag: &'a str) -> Option<&'a Self> {
        self.children_of(tag).next()
    }

    /// Marks the element as read.
    pub fn mark(&self) {
        self.seen.set(true);
    }

    /// Marks the element and everything in it as read or reported.
    pub fn mark_all(&self) {
        self.mark();
        self.attributes.iter().for_each(Attribute::mark);
        self.children.iter().for_each(Self::mark_all);
    }

    /// Marks the element and one of its attributes as read.
    pub fn mark_all_of(&self, attribute: &str) {
        self.mark();
        self.get(attribute);
    }

    /// Whether it has been read or reported.
    pub fn is_seen(&self) -> bool {
        self.seen.get()
    }

    /// Names of the attributes that nobody has read; marks them.
    pub fn take_unused(&self) -> Vec<&str> {
        let unused: Vec<&Attribute> = self.attributes.iter().filter(|a| !a.is_used()).collect();
        unused.iter().for_each(|a| a.mark());
        unused.into_iter().map(|a| a.name.as_str()).collect()
    }

    /// Its `name`, or nothing; does not mark it.
    pub fn label(&self) -> &str {
        self.attributes.iter().find(|a| a.name == "name").map_or("", |a| a.value.as_str())
    }

    /// Number of elements in it, itself included.
    pub fn size(&self) -> usize {
        1 + self.children.iter().map(Self::size).sum::<usize>()
    }
}

/// Reads a file into its root element; `from` is the element that asked for it.
pub fn read(path: &Path, from: Option<&Element>) -> Result<Element, ImportError> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| match from {
        Some(element) if error.kind() == std::io::ErrorKind::NotFound => {
            ImportError::at(element, ImportMistake::MissingFile { what: "include file", path: file.clone() })
        }
        _ => ImportError::in_file(&file, 0, ImportMistake::Read { error: error.to_string() }),
    })?;
    parse(&text, &file)
}

/// Parses a text; `file` is what errors call it.
pub fn parse(text: &str, file: &str) -> Result<Element, ImportError> {
    let document = roxmltree::Document::parse(text).map_err(|error| {
        let message = error.to_string();
        let xacro = message.contains("xacro") || text.contains("<xacro:") || text.contains("$(arg");
        ImportError::in_file(file, error.pos().row as usize, ImportMistake::Syntax { message, xacro })
    })?;
    copy(&document, document.root_element(), &Rc::from(file), 0)
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
    if depth > DEEPEST {
        return Err(ImportError::at(&element, too_deep()));
    }
    for child in node.children().filter(|c| c.is_element()) {
        element.children.push(copy(document, child, file, depth + 1)?);
    }
    Ok(element)
}

/// The mistake of more than [`DEEPEST`] levels.
pub fn too_deep() -> ImportMistake {
    ImportMistake::Unsupported {
        what: format!("a tree of more than {DEEPEST} levels"),
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
