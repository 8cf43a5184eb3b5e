//! Control logs: CSV with a column per input by its name and a row per step.
//!
//! Column `t` is the time at which a row's step begins \[s\]; the row holds until the next one. A guess may leave it out. Comma, semicolon
//! or tab separate columns; `#` begins a comment.

use super::failure::Failure;
use super::file;
use csv::{ReaderBuilder, StringRecord, Trim};
use pliant::scene::words::nearest;
use pliant::scene::{Place, Scene, control_list};
use std::fmt;
use std::io::Write;
use std::path::Path;

/// The column of times.
const TIME: &str = "t";

/// A control log that is refused.
#[derive(Debug)]
pub struct InputsError {
    place: Place,
    mistake: Box<Mistake>,
}

/// The problem.
#[derive(Debug, thiserror::Error)]
enum Mistake {
    #[error("cannot be read: {error}")]
    Read { error: String },
    #[error("the header is missing")]
    Empty,
    #[error("there is no input \"{name}\"")]
    Unknown { name: String, nearest: Option<String>, known: String },
    #[error("input \"{name}\" has no column")]
    Missing { name: String },
    #[error("two columns are called \"{name}\"")]
    Twice { name: String },
    #[error("the row has {found} cells, but the header {expected}")]
    Ragged { found: usize, expected: usize },
    #[error("\"{found}\" is not a number")]
    NotANumber { found: String },
    #[error("is {found}, not a finite number")]
    NotFinite { found: f64 },
    #[error("has {found} rows, but the plan has {expected} steps")]
    Rows { found: usize, expected: usize },
}

impl Mistake {
    /// (likely cause, fix).
    fn advice(&self) -> (&'static str, String) {
        match self {
            Self::Read { .. } => {
                ("the path is wrong, or the file may not be read", "check the path and the file's permissions".to_owned())
            }
            Self::Empty => ("the file is empty, or was saved without names", "begin it with the names of the inputs".to_owned()),
            Self::Unknown { nearest: Some(nearest), .. } => ("a typing error", format!("did you mean \"{nearest}\"?")),
            Self::Unknown { known, .. } => {
                ("a log of another scene, or a column that is no input", format!("remove it; inputs of the scene: {known}"))
            }
            Self::Missing { name } => (
                "the column was left out, or is a log of another scene",
                format!("add a column \"{name}\" with one number per step"),
            ),
            Self::Twice { .. } => ("a column was copied and not renamed", "keep one of the two".to_owned()),
            Self::Ragged { .. } => ("a separator is missing or superfluous", "correct this line".to_owned()),
            Self::NotANumber { .. } => ("a unit, a decimal comma or a word in the cell", "write the number alone".to_owned()),
            Self::NotFinite { .. } => {
                ("a gap in the log, or a division by zero where it was made", "write a finite number".to_owned())
            }
            Self::Rows { found, .. } => {
                ("the guess is of another plan", format!("give one row per step, or plan `--steps {found}`"))
            }
        }
    }
}

impl std::error::Error for InputsError {}

/// Three lines: place and mistake, likely cause, fix.
impl fmt::Display for InputsError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (cause, fix) = self.mistake.advice();
        write!(f, "{}: {}\n  likely cause: {cause}\n  fix: {fix}", self.place, self.mistake)
    }
}

/// Names of a scene's inputs, in the order of the model.
pub fn names(scene: &Scene) -> Vec<String> {
    control_list(scene).into_iter().map(|control| control.name).collect()
}

/// Refuses a file that is not .csv.
pub fn check_kind(path: &Path) -> Result<(), Failure> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        Ok(())
    } else {
        Err(Failure::InputsKind { path: path.to_owned() })
    }
}

/// Writes the inputs of steps of h \[s\].
pub fn write(path: &Path, names: &[String], h: f64, rows: &[Vec<f64>]) -> Result<(), Failure> {
    file::write(path, |out| {
        write!(out, "{TIME}")?;
        names.iter().try_for_each(|name| write!(out, ",{name}"))?;
        writeln!(out)?;
        for (k, row) in rows.iter().enumerate() {
            write!(out, "{}", k as f64 * h)?;
            row.iter().try_for_each(|u| write!(out, ",{u}"))?;
            writeln!(out)?;
        }
        Ok(())
    })
}

/// Reads one row of inputs per step, in the order of `names`.
pub fn read(path: &Path, names: &[String], steps: usize) -> Result<Vec<Vec<f64>>, InputsError> {
    let whole = Place { file: Some(path.display().to_string()), ..Place::default() };
    let refuse = |mistake: Mistake| InputsError { place: whole.clone(), mistake: Box::new(mistake) };
    let text = std::fs::read_to_string(path).map_err(|error| refuse(Mistake::Read { error: error.to_string() }))?;
    let (header, rows) = table(&text).map_err(|error| refuse(Mistake::Read { error }))?;
    let columns = columns(&header, names).map_err(refuse)?;
    let read = |row: &StringRecord| -> Result<Vec<f64>, InputsError> {
        let line = row.position().map(|position| position.line() as usize);
        let at = |place: Place, mistake: Mistake| InputsError { place: Place { line, ..place }, mistake: Box::new(mistake) };
        if row.len() != header.len() {
            return Err(at(whole.clone(), Mistake::Ragged { found: row.len(), expected: header.len() }));
        }
        let cell = |(&column, name): (&usize, &String)| {
            let place = || Place { column: Some(column + 1), field: format!("column {name}"), ..whole.clone() };
            match row[column].parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                Ok(found) => Err(at(place(), Mistake::NotFinite { found })),
                Err(_) => Err(at(place(), Mistake::NotANumber { found: row[column].to_owned() })),
            }
        };
        columns.iter().zip(names).map(cell).collect()
    };
    let inputs: Vec<Vec<f64>> = rows.iter().map(read).collect::<Result<_, _>>()?;
    if inputs.len() == steps { Ok(inputs) } else { Err(refuse(Mistake::Rows { found: inputs.len(), expected: steps })) }
}

/// Header and rows.
fn table(text: &str) -> Result<(Vec<String>, Vec<StringRecord>), String> {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or("");
    let delimiter = [b',', b';', b'\t'].into_iter().find(|d| first.contains(char::from(*d))).unwrap_or(b',');
    let mut builder = ReaderBuilder::new();
    builder.delimiter(delimiter).comment(Some(b'#')).trim(Trim::All).flexible(true);
    let mut reader = builder.from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| error.to_string())?;
    let header = header.iter().map(|name| name.trim_start_matches('\u{feff}').to_owned()).collect();
    let rows = reader.records().collect::<Result<_, _>>().map_err(|error| error.to_string())?;
    Ok((header, rows))
}

/// The column of each input.
fn columns(header: &[String], names: &[String]) -> Result<Vec<usize>, Mistake> {
    if header.iter().all(String::is_empty) {
        return Err(Mistake::Empty);
    }
    if let Some((_, name)) = header.iter().enumerate().find(|(k, name)| header[..*k].contains(name)) {
        return Err(Mistake::Twice { name: name.clone() });
    }
    if let Some(name) = header.iter().find(|name| *name != TIME && !names.contains(name)) {
        let absent = names.iter().filter(|input| !header.contains(input)).map(String::as_str);
        let nearest = nearest(name, absent).map(str::to_owned);
        return Err(Mistake::Unknown { name: name.clone(), nearest, known: names.join(", ") });
    }
    let column =
        |name: &String| header.iter().position(|column| column == name).ok_or_else(|| Mistake::Missing { name: name.clone() });
    names.iter().map(column).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn read_text(text: &str) -> Result<Vec<Vec<f64>>, String> {
        let file = tempfile::NamedTempFile::with_suffix(".csv").unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path(), &["hand.x".to_owned(), "hand.y".to_owned()], 2).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name() {
        let expected = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        for text in [
            "hand.x,hand.y\n1,2\n3,4\n",
            "t,hand.y,hand.x\n0,2,1\n0.1,4,3\n",
            "# a guess\nhand.x; hand.y\n1;2\n3; 4",
            "\u{feff}hand.y\thand.x\n2\t1\n4\t3",
        ] {
            assert_eq!(read_text(text).unwrap(), expected, "{text}");
        }
        let file = tempfile::NamedTempFile::with_suffix(".csv").unwrap();
        let rows = vec![vec![0.1 + 0.2, -1e-300], vec![std::f64::consts::PI, 1.0 / 3.0]];
        let names = ["hand.x".to_owned(), "hand.y".to_owned()];
        write(file.path(), &names, 0.01, &rows).unwrap();
        assert_eq!(read(file.path(), &names, 2).unwrap(), rows, "bit by bit");
        assert!(std::fs::read_to_string(file.path()).unwrap().starts_with("t,hand.x,hand.y\n0,"));
    }

    #[test]
    fn mistakes_are_located() {
        for (text, parts) in [
            ("", ["the header is missing", "begin it with the names"]),
            ("hand.x,hand.z\n1,2\n3,4", ["there is no input \"hand.z\"", "did you mean \"hand.y\"?"]),
            ("hand.x,hand.y,force\n1,2,0\n3,4,0", ["there is no input \"force\"", "inputs of the scene: hand.x, hand.y"]),
            ("hand.x\n1\n2", ["input \"hand.y\" has no column", "add a column \"hand.y\""]),
            ("hand.x,hand.y,hand.x\n1,2,3", ["two columns are called \"hand.x\"", "keep one"]),
            ("hand.x,hand.y\n1,2\n3", [":3: the row has 1 cells, but the header 2", "correct this line"]),
            ("hand.x,hand.y\n1,2 m\n3,4", [":2: column hand.y: \"2 m\" is not a number", "the number alone"]),
            ("hand.x,hand.y\n1,2\nNaN,4", [":3: column hand.x: is NaN", "a gap in the log"]),
            ("hand.x,hand.y\n1,2", ["has 1 rows, but the plan has 2 steps", "`--steps 1`"]),
        ] {
            let error = read_text(text).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{text:?}: {error}");
        }
    }
}
