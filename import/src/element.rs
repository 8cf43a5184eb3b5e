//! Elements that know their file and line, and whether anybody has looked at them.
//!
//! Attributes are marked as they are read, so that those that were not read can be reported at the end.

use std::cell::Cell;
use std::rc::Rc;

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
    pub(super) seen: Cell<bool>,
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
    pub(super) used: Cell<bool>,
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
