//! Where in a file a value stands: errors name file, line and field.

use super::error::{Mistake, SceneError};
use super::place::Place;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a scene file, and the name errors call it by.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name of the file.
    pub file: String,
    /// Its text.
    pub text: String,
}

impl Source {
    /// A text and the name errors call it by.
    pub fn new(file: impl Into<String>, text: impl Into<String>) -> Self {
        Self { file: file.into(), text: text.into() }
    }

    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let file = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Ok(Self { file, text }),
            Err(error) => {
                let place = Place { file: Some(file), ..Place::default() };
                let inside = path.join("scene.toml");
                let mistake = match path.is_dir() {
                    true => Mistake::Folder { scene: inside.is_file().then(|| inside.display().to_string()) },
                    false => Mistake::Read { error: error.to_string() },
                };
                Err(SceneError::new(place, mistake))
            }
        }
    }

    /// Line and column of a field, or of the deepest part of its path that the text has.
    pub fn place(&self, field: &str) -> Place {
        let start = DeTable::parse(&self.text).ok().and_then(|table| locate(table.get_ref(), field));
        match start {
            Some(start) => self.place_at(start, field),
            None => Place { file: Some(self.file.clone()), field: field.to_owned(), ..Place::default() },
        }
    }

    /// The place of a byte of the text.
    pub(super) fn place_at(&self, byte: usize, field: &str) -> Place {
        let before = self.text.get(..byte).unwrap_or(&self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
        Place { file: Some(self.file.clone()), line: Some(line), column: Some(column), field: field.to_owned() }
    }
}

impl SceneError {
    /// The same error with file and line found in the text.
    pub fn located(self, source: &Source) -> Self {
        if self.place.file.is_some() { self } else { Self { place: source.place(&self.place.field), ..self } }
    }
}

/// Byte at which the deepest existing part of a path begins; `None` if not even its first key is there.
fn locate(table: &DeTable, field: &str) -> Option<usize> {
    let mut at: Option<&Spanned<DeValue>> = None;
    for part in parts(field) {
        let next = match (at.map(Spanned::get_ref), &part) {
            (None, Part::Key(key)) => table.get(*key),
            (Some(DeValue::Table(table)), Part::Key(key)) => table.get(*key),
            (Some(DeValue::Array(array)), Part::Index(i)) => array.get(*i),
            _ => None,
        };
        match next {
            Some(next) => at = Some(next),
            None => break,
        }
    }
    at.map(|value| value.span().start)
}

enum Part<'a> {
    Key(&'a str),
    Index(usize),
}

/// `rope[0].length` is `rope`, 0, `length`.
fn parts(field: &str) -> impl Iterator<Item = Part<'_>> {
    let words = field.split(['.', '[', ']']).filter(|word| !word.is_empty());
    words.map(|word| word.parse().map_or(Part::Key(word), Part::Index))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1\n[[rope]]\nname = \"x\"\n[[rope]]\nname = \"y\"\npoints = [[0, 0],\n  [1, 2]]\n";

    #[test]
    fn finds_lines_of_fields() {
        let source = Source::new("s.toml", TEXT);
        let line = |field| source.place(field).line;
        assert_eq!(line("a"), Some(1));
        assert_eq!(line("rope[1].name"), Some(5));
        assert_eq!(line("rope[1].points[1][0]"), Some(7));
        assert_eq!(line("rope[1].missing.deeper"), Some(4));
        assert_eq!(line("nothing"), None);
        let place = source.place("rope[1].points[1][0]");
        assert_eq!((place.column, place.to_string()), (Some(4), "s.toml:7: rope[1].points[1][0]".to_owned()));
    }

    #[test]
    fn a_place_prints_what_is_known() {
        assert_eq!(Place::field("rope[0].length").to_string(), "rope[0].length");
        assert_eq!(Source::new("s.toml", "").place("time").to_string(), "s.toml: time");
    }
}
