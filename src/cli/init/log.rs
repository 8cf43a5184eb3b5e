//! The columns and the clock of a log.

use super::super::failure::Failure;
use super::clock;
use super::matching::{self, Mistake};
use super::names;
use csv::{ReaderBuilder, Trim};
use std::path::{Path, PathBuf};

/// A log as far as a scene for it has to know.
pub struct Log {
    /// The file.
    pub path: PathBuf,
    /// Names of its columns.
    pub header: Vec<String>,
    /// Number of the column that is its clock.
    pub clock: usize,
    /// Unit of the clock [s].
    pub seconds: f64,
    /// Whether the clock's name says the unit.
    pub said: bool,
    /// Median time between samples \[s\].
    pub period: f64,
    /// Time from the first sample to the last \[s\].
    pub duration: f64,
    /// Whether it only judges.
    pub held_out: bool,
}

impl Log {
    /// Reads the header and the clock.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let place = || path.display().to_string();
        let unreadable = |what: String| Failure::Init {
            place: place(),
            what,
            cause: "the path is wrong, or the file is not a CSV log with a line of names",
            fix: "give a CSV file with one column per quantity; other formats can be written as CSV".to_owned(),
        };
        let text = std::fs::read_to_string(path).map_err(|error| unreadable(format!("cannot be read: {error}")))?;
        let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or("");
        let delimiter = [b',', b';', b'\t'].into_iter().find(|d| first.contains(char::from(*d))).unwrap_or(b',');
        let mut builder = ReaderBuilder::new();
        builder.delimiter(delimiter).comment(Some(b'#')).trim(Trim::All).flexible(true);
        let mut reader = builder.from_reader(text.as_bytes());
        let names = reader.headers().map_err(|error| unreadable(format!("cannot be read: {error}")))?;
        let header: Vec<String> = names.iter().map(|name| name.trim_start_matches('\u{feff}').to_owned()).collect();
        let columns: Vec<&str> = header.iter().map(String::as_str).collect();
        let clock = matching::clock(&columns).map_err(|mistake| no_clock(path, &header, &mistake))?;
        let mut times = Vec::new();
        for row in reader.records() {
            let row = row.map_err(|error| unreadable(format!("cannot be read: {error}")))?;
            times.extend(row.get(clock).and_then(|cell| cell.parse::<f64>().ok()).filter(|t| t.is_finite()));
        }
        let difference = clock::median_difference(&times);
        if difference <= 0.0 {
            return Err(unreadable(format!("column `{}` does not count up: {} times", header[clock], times.len())));
        }
        let unit = names::read(&header[clock]).unit;
        let seconds = clock::seconds(unit.as_deref(), difference);
        let said = unit.as_deref().is_some_and(|unit| clock::UNITS.iter().any(|(known, _)| *known == unit));
        let duration = seconds * (times[times.len() - 1] - times[0]);
        Ok(Self { path: path.to_owned(), header, clock, seconds, said, period: seconds * difference, duration, held_out: false })
    }
}

fn no_clock(path: &Path, header: &[String], mistake: &Mistake) -> Failure {
    let what = match mistake {
        Mistake::TwoClocks(a, b) => format!("columns `{}` and `{}` both look like the time", header[*a], header[*b]),
        _ => format!("no column is the time; there are {}", header.join(", ")),
    };
    Failure::Init {
        place: path.display().to_string(),
        what,
        cause: "the column of the time has another name",
        fix: "name one column `time`, `time_ms` or `t` (unit s, ms or us)".to_owned(),
    }
}
