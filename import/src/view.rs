//! Attributes as numbers and words, those of default classes behind those of the element.

use super::element::{Attribute, Element};
use super::error::{ImportError, ImportMistake};
use pliant_scene::words::{list, nearest};
use std::ops::RangeInclusive;

/// An element and where attributes that it does not have come from.
#[derive(Clone, Debug)]
pub struct View<'a> {
    /// The element.
    pub element: &'a Element,
    /// The element itself, then defaults, the most specific first.
    sources: Vec<&'a Element>,
}

impl<'a> View<'a> {
    /// An element without defaults.
    pub fn plain(element: &'a Element) -> Self {
        Self { element, sources: vec![element] }
    }

    /// An element and its defaults, the most specific first.
    pub fn new(element: &'a Element, defaults: impl IntoIterator<Item = &'a Element>) -> Self {
        Self { element, sources: std::iter::once(element).chain(defaults).collect() }
    }

    /// The element itself, then its defaults.
    pub fn sources(&self) -> &[&'a Element] {
        &self.sources
    }

    /// The first of the sources with that attribute; the same attribute of sources behind it is marked too.
    fn find(&self, name: &str) -> Option<(&'a Element, &'a Attribute)> {
        let mut found = self.sources.iter().filter_map(|e| e.get(name).map(|a| (*e, a)));
        let first = found.next();
        found.for_each(drop);
        first
    }

    /// Whether any source has that attribute.
    pub fn has(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    /// An error at an attribute.
    pub fn error(&self, name: &str, mistake: ImportMistake) -> ImportError {
        match self.find(name) {
            Some((element, attribute)) => ImportError::at_attribute(element, attribute, mistake),
            None => ImportError::at(self.element, mistake),
        }
    }

    /// A text.
    pub fn text(&self, name: &str) -> Option<&'a str> {
        self.find(name).map(|(_, a)| a.value.as_str())
    }

    /// A text that must be there.
    pub fn required(&self, name: &str) -> Result<&'a str, ImportError> {
        self.text(name).ok_or_else(|| self.missing(&format!("`{name}`")))
    }

    /// The error of something missing.
    pub fn missing(&self, what: &str) -> ImportError {
        ImportError::at(self.element, ImportMistake::Missing { what: what.to_owned() })
    }

    /// One of several words.
    pub fn word(&self, name: &str, choices: &[&'static str]) -> Result<Option<&'static str>, ImportError> {
        let Some((element, attribute)) = self.find(name) else { return Ok(None) };
        let found = attribute.value.trim();
        let word = choices.iter().find(|c| **c == found);
        word.map(|w| Some(*w)).ok_or_else(|| {
            let mistake = ImportMistake::Choice {
                attribute: name.to_owned(),
                found: found.to_owned(),
                choices: list(choices.iter().copied()),
                nearest: nearest(found, choices.iter().copied()).map(str::to_owned),
            };
            ImportError::at_attribute(element, attribute, mistake)
        })
    }

    /// `true` or `false`.
    pub fn flag(&self, name: &str) -> Result<Option<bool>, ImportError> {
        Ok(self.word(name, &["true", "false"])?.map(|w| w == "true"))
    }

    /// As many numbers as `count` allows.
    pub fn numbers(&self, name: &str, count: RangeInclusive<usize>) -> Result<Option<Vec<f64>>, ImportError> {
        let Some((element, attribute)) = self.find(name) else { return Ok(None) };
        let refused = |mistake| ImportError::at_attribute(element, attribute, mistake);
        let mut out = Vec::new();
        for word in attribute.value.split_whitespace() {
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => out.push(number),
                _ => return Err(refused(ImportMistake::NotANumber { attribute: name.to_owned(), found: word.to_owned() })),
            }
        }
        if count.contains(&out.len()) {
            return Ok(Some(out));
        }
        let (low, high) = (count.start(), count.end());
        let expected = if low == high { low.to_string() } else { format!("{low} to {high}") };
        Err(refused(ImportMistake::Count { attribute: name.to_owned(), found: out.len(), expected }))
    }

    /// N numbers.
    pub fn vector<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, ImportError> {
        Ok(self.numbers(name, N..=N)?.and_then(|v| <[f64; N]>::try_from(v).ok()))
    }

    /// N numbers that are not all zero.
    pub fn direction<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, ImportError> {
        match self.vector::<N>(name)? {
            Some(v) if v.iter().all(|x| *x == 0.0) => {
                Err(self.error(name, ImportMistake::NoDirection { attribute: name.to_owned() }))
            }
            v => Ok(v),
        }
    }

    /// A number.
    pub fn number(&self, name: &str) -> Result<Option<f64>, ImportError> {
        Ok(self.vector::<1>(name)?.map(|[x]| x))
    }

    /// A number that must not be negative; `default` if it is not there.
    pub fn not_negative(&self, name: &str, default: f64) -> Result<f64, ImportError> {
        match self.number(name)? {
            Some(value) if value < 0.0 => {
                Err(self.error(name, ImportMistake::Sign { attribute: name.to_owned(), value, must: "not be negative" }))
            }
            value => Ok(value.unwrap_or(default)),
        }
    }
}

/// Refuses children that `element` cannot have.
pub fn check_children(element: &Element, known: &[&str]) -> Result<(), ImportError> {
    let unknown = element.children.iter().find(|c| !known.contains(&c.tag.as_str()));
    unknown.map_or(Ok(()), |child| Err(unknown_element(child, element, known)))
}

/// The error of an element that does not belong there.
pub fn unknown_element(child: &Element, parent: &Element, known: &[&str]) -> ImportError {
    let mistake = ImportMistake::UnknownElement {
        tag: child.tag.clone(),
        parent: parent.tag.clone(),
        nearest: nearest(&child.tag, known.iter().copied()).map(str::to_owned),
        known: list(known.iter().copied()),
    };
    ImportError::at(child, mistake)
}

/// Refuses attributes that `element` cannot have; `known` is separated by spaces.
pub fn check_attributes(element: &Element, known: &str) -> Result<(), ImportError> {
    let words = || known.split_whitespace();
    let Some(unknown) = element.attributes.iter().find(|a| words().all(|k| k != a.name)) else { return Ok(()) };
    let mistake = ImportMistake::UnknownAttribute {
        name: unknown.name.clone(),
        nearest: nearest(&unknown.name, words()).map(str::to_owned),
        known: list(words()),
    };
    Err(ImportError::at_attribute(element, unknown, mistake))
}
