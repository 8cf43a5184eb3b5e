//! Errors of an import: place, mistake, likely cause and fix.

use super::element::{Attribute, Element};
use super::mesh::MeshMistake;
use pliant_math::inertia::InertiaError;
use pliant_scene::SceneError;
use std::fmt;

/// A model that is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportError {
    /// File.
    pub file: String,
    /// Line, counted from 1; 0 if it is the file as a whole.
    pub line: usize,
    /// The element, with its name if it has one: `joint "elbow"`.
    pub element: String,
    /// What.
    pub mistake: Box<ImportMistake>,
}

impl std::error::Error for ImportError {}

impl ImportError {
    /// At an element.
    pub fn at(element: &Element, mistake: ImportMistake) -> Self {
        let label = element.label();
        let name = if label.is_empty() { element.tag.clone() } else { format!("{} \"{label}\"", element.tag) };
        Self { file: element.file.to_string(), line: element.line, element: name, mistake: Box::new(mistake) }
    }

    /// At an attribute of an element.
    pub fn at_attribute(element: &Element, attribute: &Attribute, mistake: ImportMistake) -> Self {
        Self { line: attribute.line, ..Self::at(element, mistake) }
    }

    /// In a file, at no element.
    pub fn in_file(file: &str, line: usize, mistake: ImportMistake) -> Self {
        Self { file: file.to_owned(), line, element: String::new(), mistake: Box::new(mistake) }
    }
}

/// Three lines: place and mistake, likely cause, fix.
impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (cause, fix) = self.mistake.advice();
        write!(f, "{}", self.file)?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if !self.element.is_empty() {
            write!(f, ": {}", self.element)?;
        }
        write!(f, ": {}\n  likely cause: {cause}\n  fix: {fix}", self.mistake)
    }
}

/// Defect of a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum ImportMistake {
    /// The file cannot be read.
    #[error("cannot be read: {error}")]
    Read { error: String },
    /// Not XML.
    #[error("is not valid XML: {message}")]
    Syntax { message: String, xacro: bool },
    /// Neither MJCF nor URDF.
    #[error("the root element is <{root}>, neither <mujoco> nor <robot>")]
    NotAModel { root: String },
    /// An element that the format does not have here.
    #[error("unknown element <{tag}> in <{parent}>")]
    UnknownElement { tag: String, parent: String, nearest: Option<String>, known: String },
    /// An attribute that the format does not have here.
    #[error("unknown attribute `{name}`")]
    UnknownAttribute { name: String, nearest: Option<String>, known: String },
    /// An attribute or element that must be there.
    #[error("{what} is missing")]
    Missing { what: String },
    /// Not a number.
    #[error("`{attribute}` holds \"{found}\", which is not a finite number")]
    NotANumber { attribute: String, found: String },
    /// The wrong number of numbers.
    #[error("`{attribute}` has {found} numbers instead of {expected}")]
    Count { attribute: String, found: usize, expected: String },
    /// A word that is not among the choices.
    #[error("`{attribute}` is \"{found}\", none of {choices}")]
    Choice { attribute: String, found: String, choices: String, nearest: Option<String> },
    /// A negative number, or zero where it must be positive.
    #[error("`{attribute}` is {value}, but must {must}")]
    Sign { attribute: String, value: f64, must: &'static str },
    /// A vector or quaternion of length zero.
    #[error("`{attribute}` has length zero, so it has no direction")]
    NoDirection { attribute: String },
    /// A default class that does not exist.
    #[error("there is no default class \"{class}\"")]
    UnknownClass { class: String, nearest: Option<String>, known: String },
    /// A joint, body or link that does not exist.
    #[error("there is no {what} \"{name}\"")]
    NoSuch { what: &'static str, name: String, nearest: Option<String>, known: String },
    /// Two things of one name.
    #[error("a second {what} \"{name}\"; the first is on line {first}")]
    Duplicate { what: &'static str, name: String, first: usize },
    /// A file that includes itself.
    #[error("the file includes itself: {chain}")]
    IncludeCycle { chain: String },
    /// A file that is not there.
    #[error("the {what} \"{path}\" is not there{}", places(.looked))]
    MissingFile { what: &'static str, path: String, looked: Vec<String> },
    /// A mesh that cannot be used.
    #[error("the mesh \"{path}\" {error}")]
    Mesh { path: String, error: MeshMistake },
    /// A mass that cannot be.
    #[error("body \"{body}\": {error}")]
    Inertia { body: String, error: InertiaError },
    /// A joint that moves nothing.
    #[error("body \"{body}\" moves, but neither it nor any body beyond it has a mass")]
    Massless { body: String },
    /// Limits in the wrong order.
    #[error("`{attribute}` goes from {low} down to {high}")]
    LimitOrder { attribute: String, low: f64, high: f64 },
    /// A link with two parents.
    #[error("link \"{link}\" has two parents, by joint \"{first}\" and by joint \"{second}\"")]
    Loop { link: String, first: String, second: String },
    /// Links that hang on each other in a circle, so that there is no root.
    #[error("no link is a root: each is the child of another")]
    NoRoot,
    /// More than one root.
    #[error("links {links} all have no parent")]
    Roots { links: String },
    /// A size that betrays another unit.
    #[error("`{attribute}` is {value} {unit}")]
    Unit { attribute: String, value: f64, unit: &'static str, likely: &'static str },
    /// Shapes that overlap as the scene begins.
    #[error("{first} and {second} overlap by {depth:.2e} m as the scene begins, and would be thrown apart")]
    Overlap { first: String, second: String, depth: f64 },
    /// A free joint that is not alone at the world.
    #[error("a free joint of body \"{body}\", which has a parent or other joints too")]
    FreeBelow { body: String },
    /// Something that would make it another model if it were left out.
    #[error("{what} cannot be kept: {reason}")]
    NeedsApproximate { what: String, reason: String },
    /// Something that is not read at all.
    #[error("{what} is not supported: {reason}")]
    Unsupported { what: String, reason: String },
    /// The scene that came out is refused.
    #[error("the scene made from it is refused: {error}")]
    Scene { error: SceneError },
}

/// The places where a file was looked for.
fn places(places: &[String]) -> String {
    if places.is_empty() { String::new() } else { format!("; looked for it at {}", places.join(", ")) }
}
