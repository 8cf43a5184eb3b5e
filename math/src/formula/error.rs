//! What may be wrong with a formula.

use super::{DEEPEST, MOST_PARTS};

/// A text that is no formula. `at` counts characters from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum FormulaError {
    /// Nothing there.
    #[error("the formula is empty")]
    Empty,
    /// A character that no formula has.
    #[error("character {at}: `{found}` means nothing in a formula")]
    Character { at: usize, found: char },
    /// A number that cannot be read.
    #[error("character {at}: `{text}` is no number")]
    Number { at: usize, text: String },
    /// Something in the wrong place.
    #[error("character {at}: `{found}` stands where {wanted} is expected")]
    Unexpected { at: usize, found: String, wanted: &'static str },
    /// A text that stops too early.
    #[error("it ends where {wanted} is expected")]
    End { wanted: &'static str },
    /// A comparison of a comparison.
    #[error("character {at}: `{found}` compares what is a comparison already")]
    Chain { at: usize, found: String },
    /// A name that nothing has.
    #[error("character {at}: there is no `{name}`")]
    Unknown { at: usize, name: String, nearest: Option<String>, known: String },
    /// A function that does not exist.
    #[error("character {at}: there is no function `{name}`")]
    UnknownFunction { at: usize, name: String, nearest: Option<String>, known: String },
    /// A function without its arguments.
    #[error("character {at}: the function `{name}` has no arguments")]
    NotCalled { at: usize, name: String },
    /// A name with arguments.
    #[error("character {at}: `{name}` is a number, not a function")]
    Called { at: usize, name: String },
    /// Arguments missing or superfluous.
    #[error("character {at}: `{name}` has {found} argument(s) instead of {expected}")]
    Arguments { at: usize, name: String, found: usize, expected: usize },
    /// A part that has no value whatever the names are.
    #[error("character {at}: this is {value}, not a finite number")]
    NotFinite { at: usize, value: f64 },
    /// Too long.
    #[error("the formula has more than {MOST_PARTS} parts")]
    Long,
    /// Too many parts inside each other.
    #[error("character {at}: more than {DEEPEST} parts stand inside each other")]
    Deep { at: usize },
}

impl FormulaError {
    /// What to write instead.
    pub fn fix(&self) -> String {
        match self {
            Self::Empty => "write e.g. \"-c*v\"; `0` is no force".to_owned(),
            Self::Character { found: '^', .. } => "write `**` for a power".to_owned(),
            Self::Character { found: '=' | '!', .. } => "compare with `<`, `<=`, `>` or `>=`".to_owned(),
            Self::Character { found: '.', .. } => "write the function alone: `sin(q)`, not `np.sin(q)`".to_owned(),
            Self::Character { found: '&' | '|', .. } => {
                "multiply conditions where both have to hold: `(q > 0)*(v > 0)`".to_owned()
            }
            Self::Character { .. } => "use numbers, names, `+ - * / **`, `< <= > >=`, parentheses and functions".to_owned(),
            Self::Number { .. } => "write numbers like `2`, `0.5` or `1e-3`, and `*` between a number and a name".to_owned(),
            Self::Unexpected { found, .. } if matches!(found.as_str(), "if" | "else" | "and" | "or" | "not") => {
                "write `where(condition, there, elsewhere)`".to_owned()
            }
            Self::Unexpected { .. } => "look for an operator or a bracket that is missing before it".to_owned(),
            Self::End { .. } => "complete it, or remove what stands last".to_owned(),
            Self::Chain { .. } => "write `(a < b)*(b < c)` for `a < b < c`".to_owned(),
            Self::Unknown { nearest: Some(nearest), known, .. } => format!("did you mean `{nearest}`? known here: {known}"),
            Self::Unknown { known, .. } => format!("use a name known here: {known}; a number of your own goes into `parameters`"),
            Self::UnknownFunction { nearest: Some(nearest), .. } => format!("did you mean `{nearest}`?"),
            Self::UnknownFunction { known, .. } => format!("use one of {known}"),
            Self::NotCalled { name, .. } => format!("write `{name}(…)`"),
            Self::Called { name, .. } => format!("write `{name}*(…)` for a product"),
            Self::Arguments { name, .. } if name == "where" => "write `where(condition, there, elsewhere)`".to_owned(),
            Self::Arguments { expected, .. } => format!("give {expected}, with a comma between them"),
            Self::NotFinite { .. } => "remove the division by zero, or what is undefined there".to_owned(),
            Self::Long | Self::Deep { .. } => "write it more simply, or as two forces that add up".to_owned(),
        }
    }
}
