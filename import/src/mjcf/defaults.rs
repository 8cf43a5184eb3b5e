//! `<default>`: classes of attributes, each within another.

use super::words;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::check_children;
use pliant_scene::words::nearest;

/// The class that everything belongs to.
const MAIN: &str = "main";

/// All classes; the first is `main`.
#[derive(Clone, Debug)]
pub struct Defaults<'a> {
    classes: Vec<Class<'a>>,
}

#[derive(Clone, Debug)]
struct Class<'a> {
    name: &'a str,
    parent: Option<usize>,
    elements: Vec<&'a Element>,
}

impl<'a> Defaults<'a> {
    /// Reads all `<default>` elements of a model.
    pub fn read(root: &'a Element) -> Result<Self, ImportError> {
        let mut defaults = Self { classes: vec![Class { name: MAIN, parent: None, elements: Vec::new() }] };
        for element in root.children_of("default") {
            if let Some(name) = element.value("class").filter(|name| *name != MAIN) {
                // another name of the outermost class
                defaults.classes.push(Class { name, parent: Some(0), elements: Vec::new() });
            }
            defaults.fill(element, 0)?;
        }
        Ok(defaults)
    }

    fn fill(&mut self, element: &'a Element, class: usize) -> Result<(), ImportError> {
        check_children(element, &words::IN_DEFAULT)?;
        element.mark();
        for child in &element.children {
            if child.tag != "default" {
                self.classes[class].elements.push(child);
                continue;
            }
            let missing = || ImportError::at(child, ImportMistake::Missing { what: "`class`".to_owned() });
            let name = child.value("class").ok_or_else(missing)?;
            self.classes.push(Class { name, parent: Some(class), elements: Vec::new() });
            self.fill(child, self.classes.len() - 1)?;
        }
        Ok(())
    }

    /// The number of a class; `element` names it.
    fn find(&self, element: &Element, class: &str) -> Result<usize, ImportError> {
        let names = || self.classes.iter().map(|c| c.name);
        names().position(|name| name == class).ok_or_else(|| {
            let mistake = ImportMistake::UnknownClass {
                class: class.to_owned(),
                nearest: nearest(class, names()).map(str::to_owned),
                known: names().collect::<Vec<_>>().join(", "),
            };
            ImportError::at(element, mistake)
        })
    }

    /// Defaults of those tags for an element of a class (`main` if none): the outermost class first, the last word last.
    pub fn chain(&self, element: &Element, class: Option<&str>, tags: &[&str]) -> Result<Vec<&'a Element>, ImportError> {
        let start = class.map_or(Ok(0), |class| self.find(element, class))?;
        let mut classes: Vec<usize> = std::iter::successors(Some(start), |&c| self.classes[c].parent).collect();
        classes.reverse();
        let elements = classes.into_iter().flat_map(|c| &self.classes[c].elements);
        Ok(elements.copied().filter(|e| tags.contains(&e.tag.as_str())).collect())
    }

    /// Refuses a class that is not there.
    pub fn check(&self, element: &Element, class: &str) -> Result<(), ImportError> {
        self.find(element, class).map(drop)
    }

    /// All elements of all classes.
    pub fn elements(&self) -> impl Iterator<Item = &'a Element> + '_ {
        self.classes.iter().flat_map(|c| c.elements.iter().copied())
    }
}
