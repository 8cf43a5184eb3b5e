//! CSV logs: one record per file, a header with column names, one row per sample. Comma, semicolon or tab; `#` begins a comment.

use super::check::check_clock;
use super::constants::LOG;
use super::error::{LogError, LogMistake, Need};
use super::experiment::RecordFile;
use super::record::Record;
use super::setup::{Setup, suggestion};
use csv::{ReaderBuilder, StringRecord, Trim};
use pliant_scene::Place;
use std::num::ParseFloatError;
use std::path::Path;

/// A CSV log as it is read: names of columns, and cells.
pub struct CsvTable {
    file: String,
    header: Vec<String>,
    rows: Vec<StringRecord>,
}

/// Cells of a column without a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gaps {
    /// How many.
    pub count: usize,
    /// Line of the first one in the file.
    pub line: usize,
    /// Whether every row is one.
    pub all: bool,
}

/// A column that the experiment asks for.
struct Column {
    index: usize,
    factor: f64,
}

/// Whether a file is a CSV log, by its name.
pub(super) fn is_csv(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    matches!(extension.as_deref().and_then(|e| e.to_str()), Some("csv" | "txt" | "tsv"))
}

/// Reads the one record of a file.
pub(super) fn read(setup: &Setup, path: &Path, file: &RecordFile) -> Result<Vec<Record>, LogError> {
    let table = CsvTable::read(path)?;
    let time = table.time(setup)?;
    let mut markers: Vec<Vec<[f64; 3]>> = vec![Vec::new(); table.rows.len()];
    for (k, marker) in setup.experiment.marker.iter().enumerate() {
        let Some(columns) = &marker.columns else {
            return Err(LogError::new(setup.source.place(&format!("experiment.marker[{k}]")), mapping("columns")));
        };
        let need = if marker.may_be_missing { Need::HiddenMarker } else { Need::Marker };
        let factor = marker.unit.metres();
        let found: Vec<Vec<f64>> = columns.iter().map(|name| table.column(name, factor, need)).collect::<Result<_, _>>()?;
        for (row, all) in markers.iter_mut().enumerate() {
            all.push([found[0][row], found[1][row], found[2][row]]);
        }
    }
    let mut inputs: Vec<Vec<f64>> = vec![Vec::new(); table.rows.len()];
    for (k, input, factors) in setup.ordered_inputs() {
        let Some(columns) = &input.columns else {
            return Err(LogError::new(setup.source.place(&format!("experiment.input[{k}]")), mapping("columns")));
        };
        for (name, factor) in columns.iter().zip(factors) {
            let values = table.column(name, factor, Need::Input)?;
            inputs.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        }
    }
    let (joints, orientations) = (table.joints(setup)?, table.orientations(setup)?);
    let record = Record { name: file.file.clone(), time, markers, joints, orientations, inputs, ..Record::default() };
    let clock = setup.experiment.time.column.as_deref().unwrap_or("time");
    Ok(vec![setup.finish(record, &|row| table.place(row, clock))?])
}

/// Names in the last comment above a first row of numbers, as `numpy.savetxt` writes its header: as many as there are numbers.
fn commented_header<'a>(above: impl Iterator<Item = &'a str>, first: &str, delimiter: char) -> Option<Vec<String>> {
    let is_number = |cell: &str| cell.trim().parse::<f64>().is_ok();
    let comment = above.filter(|line| line.starts_with('#')).last()?;
    let names: Vec<String> = comment.trim_start_matches('#').split(delimiter).map(|name| name.trim().to_owned()).collect();
    let named = names.len() == first.split(delimiter).count() && !names.iter().any(|name| is_number(name));
    (named && first.split(delimiter).all(is_number)).then_some(names)
}

/// The number of a cell; NaN if it is empty.
fn number(cell: &str) -> Result<f64, ParseFloatError> {
    if cell.is_empty() { Ok(f64::NAN) } else { cell.parse() }
}

fn mapping(key: &'static str) -> LogMistake {
    LogMistake::Mapping { key, kind: "CSV" }
}

impl CsvTable {
    /// Opens a log before there is a scene for it.
    ///
    /// # Errors
    /// Another kind of file, one that cannot be read, without names, or with rows of another length.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        if !is_csv(path) {
            return Err(LogError::new(Place { file: Some(path.display().to_string()), ..Place::default() }, LogMistake::Kind));
        }
        Self::read(path)
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        &self.header
    }

    /// The numbers of a clock, in its own unit.
    ///
    /// # Errors
    /// Fewer rows than a record needs, or a cell without a number.
    pub fn counts(&self, clock: &str) -> Result<Vec<f64>, LogError> {
        let (found, needed) = (self.rows.len(), LOG.samples);
        if found < needed {
            return Err(LogError::new(self.place(found.saturating_sub(1), clock), LogMistake::TooFew { found, needed }));
        }
        self.column(clock, 1.0, Need::Clock)
    }

    /// Refuses times [s] of a clock that do not count up.
    ///
    /// # Errors
    /// The first row at which they do not.
    pub fn check_clock(&self, clock: &str, times: &[f64]) -> Result<(), LogError> {
        check_clock(times, &|row| self.place(row, clock))
    }

    /// The cells of a column that hold no number because none was logged; `None` if there are none.
    pub fn gaps(&self, name: &str) -> Option<Gaps> {
        let column = self.header.iter().position(|other| other == name)?;
        let is_missing = |row: &&StringRecord| row.get(column).is_none_or(|cell| number(cell).is_ok_and(f64::is_nan));
        let mut missing = self.rows.iter().filter(is_missing);
        let first = missing.next()?;
        let count = 1 + missing.count();
        Some(Gaps { count, line: first.position().map_or(0, |place| place.line() as usize), all: count == self.rows.len() })
    }

    /// The smallest and the largest number of a column, in its own unit: infinities, in the wrong order, if it has none.
    pub fn range(&self, name: &str) -> [f64; 2] {
        let column = self.header.iter().position(|other| other == name);
        let cells = self.rows.iter().filter_map(|row| number(row.get(column?)?).ok().filter(|x| x.is_finite()));
        cells.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    fn read(path: &Path) -> Result<Self, LogError> {
        let file = path.display().to_string();
        let whole = Place { file: Some(file.clone()), ..Place::default() };
        let unreadable = |error: String| LogError::new(whole.clone(), LogMistake::Read { error });
        let text = std::fs::read_to_string(path).map_err(|error| unreadable(error.to_string()))?;
        let is_row = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
        let first = text.lines().find(is_row).unwrap_or("");
        let delimiter = [b',', b';', b'\t'].into_iter().find(|d| first.contains(char::from(*d))).unwrap_or(b',');
        let commented = commented_header(text.lines().take_while(|line| !is_row(line)), first, char::from(delimiter));
        let mut builder = ReaderBuilder::new();
        builder.delimiter(delimiter).comment(Some(b'#')).trim(Trim::All).flexible(true).has_headers(commented.is_none());
        let mut reader = builder.from_reader(text.as_bytes());
        let header = match commented {
            Some(names) => names,
            None => reader.headers().map_err(|error| unreadable(error.to_string()))?.iter().map(str::to_owned).collect(),
        };
        let header: Vec<String> = header.iter().map(|name| name.trim_start_matches('\u{feff}').to_owned()).collect();
        if header.iter().all(String::is_empty) {
            return Err(LogError::new(whole.clone(), LogMistake::Empty));
        }
        let rows: Vec<StringRecord> =
            reader.records().collect::<Result<_, _>>().map_err(|error| unreadable(error.to_string()))?;
        let table = Self { file, header, rows };
        let expected = table.header.len();
        match table.rows.iter().position(|row| row.len() != expected) {
            Some(row) => {
                let mistake = LogMistake::Ragged { found: table.rows[row].len(), expected };
                Err(LogError::new(Place { field: String::new(), column: None, ..table.place(row, "") }, mistake))
            }
            None => Ok(table),
        }
    }

    /// The place of a cell.
    fn place(&self, row: usize, column: &str) -> Place {
        let line = self.rows.get(row).and_then(|row| row.position()).map(|position| position.line() as usize);
        let number = self.header.iter().position(|name| name == column).map(|index| index + 1);
        Place { file: Some(self.file.clone()), line, column: number, field: format!("column {column}") }
    }

    fn time(&self, setup: &Setup) -> Result<Vec<f64>, LogError> {
        let clock = &setup.experiment.time;
        match (&clock.column, clock.rate) {
            (Some(name), _) => self.column(name, clock.unit.seconds(), Need::Clock),
            (None, Some(rate)) => Ok((0..self.rows.len()).map(|k| k as f64 / rate).collect()),
            (None, None) => Err(LogError::new(setup.source.place("experiment.time"), mapping("column"))),
        }
    }

    /// Readings of the sensors at joints, per time.
    fn joints(&self, setup: &Setup) -> Result<Vec<Vec<f64>>, LogError> {
        let axes = setup.axes();
        let mut out: Vec<Vec<f64>> = vec![Vec::new(); self.rows.len()];
        for sensor in &setup.experiment.joint {
            let slides = axes.iter().any(|(name, slides)| *name == sensor.joint && *slides);
            let need = if sensor.may_be_missing { Need::HiddenReading } else { Need::Reading };
            let values = self.column(&sensor.column, sensor.factor(slides), need)?;
            out.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        }
        Ok(out)
    }

    /// Observed orientations as unit quaternions, per time.
    fn orientations(&self, setup: &Setup) -> Result<Vec<Vec<[f64; 4]>>, LogError> {
        let mut out: Vec<Vec<[f64; 4]>> = vec![Vec::new(); self.rows.len()];
        for observed in &setup.experiment.orientation {
            let need = if observed.may_be_missing { Need::HiddenReading } else { Need::Reading };
            let factor = observed.factor();
            let found: Vec<Vec<f64>> =
                observed.columns.iter().map(|name| self.column(name, factor, need)).collect::<Result<_, _>>()?;
            for (k, row) in out.iter_mut().enumerate() {
                let numbers: Vec<f64> = found.iter().map(|column| column[k]).collect();
                row.push(observed.quaternion(&numbers).map_err(|m| LogError::new(self.place(k, &observed.columns[0]), m))?);
            }
        }
        Ok(out)
    }

    fn find(&self, name: &str) -> Result<usize, LogError> {
        let mut found = self.header.iter().enumerate().filter(|(_, column)| *column == name);
        let place = || Place { file: Some(self.file.clone()), line: Some(1), column: None, field: String::new() };
        match (found.next(), found.next()) {
            (Some((index, _)), None) => Ok(index),
            (Some(_), Some(_)) => Err(LogError::new(place(), LogMistake::TwoColumns { name: name.to_owned() })),
            (None, _) => {
                let names: Vec<&str> = self.header.iter().map(String::as_str).collect();
                let (nearest, known) = suggestion(name, &names);
                Err(LogError::new(place(), LogMistake::NoColumn { name: name.to_owned(), nearest, known }))
            }
        }
    }

    /// All values of a column, in SI units.
    fn column(&self, name: &str, factor: f64, need: Need) -> Result<Vec<f64>, LogError> {
        let column = Column { index: self.find(name)?, factor };
        (0..self.rows.len()).map(|row| self.cell(row, name, &column, need)).collect()
    }

    fn cell(&self, row: usize, name: &str, column: &Column, need: Need) -> Result<f64, LogError> {
        let text = self.rows[row].get(column.index).unwrap_or("");
        let refuse = |mistake| Err(LogError::new(self.place(row, name), mistake));
        match number(text) {
            Ok(value) if value.is_finite() => Ok(value * column.factor),
            Ok(value) if value.is_nan() && matches!(need, Need::HiddenMarker | Need::HiddenReading) => Ok(f64::NAN),
            Ok(value) => {
                let found = if text.is_empty() { "empty" } else { super::npz_file::not_finite(value) };
                refuse(LogMistake::Missing { found, of: need })
            }
            Err(_) => refuse(LogMistake::NotANumber { found: text.to_owned() }),
        }
    }
}
