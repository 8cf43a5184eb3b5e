//! The columns and the clock of a log.

use super::super::failure::Failure;
use super::clock;
use super::matching::{self, Mistake};
use super::names;
use pliant::identify::log::{CsvTable, Gaps, period};
use std::path::{Path, PathBuf};

/// A log as far as a scene for it has to know.
pub struct Log {
    /// The file.
    pub path: PathBuf,
    /// Names of its columns, without those that are to be left out.
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
    /// Smallest and largest number of each column, in its unit; those that are missing do not count.
    pub ranges: Vec<[f64; 2]>,
    /// Cells without a number of each column.
    pub gaps: Vec<Option<Gaps>>,
    /// Its columns that were left out on purpose.
    pub without: Vec<String>,
    /// Whether it only judges.
    pub held_out: bool,
}

impl Log {
    /// Reads the header and the clock, as if the columns `without` were not there.
    pub fn read(path: &Path, without: &[String]) -> Result<Self, Failure> {
        let table = CsvTable::open(path)?;
        let (without, header): (Vec<String>, Vec<String>) =
            table.names().iter().cloned().partition(|name| without.contains(name));
        let columns: Vec<&str> = header.iter().map(String::as_str).collect();
        let clock = matching::clock(&columns).map_err(|mistake| no_clock(path, &header, &mistake))?;
        let name = columns[clock];
        let mut times = table.counts(name)?;
        let counts = period(&times);
        let unit = names::read(name).unit;
        let seconds = clock::seconds(unit, counts);
        let said = unit.is_some_and(|unit| clock::UNITS.iter().any(|(known, _)| *known == unit));
        times.iter_mut().for_each(|time| *time *= seconds);
        table.check_clock(name, &times)?;
        let duration = times[times.len() - 1] - times[0];
        let ranges = columns.iter().map(|name| table.range(name)).collect();
        let gaps = columns.iter().map(|name| table.gaps(name)).collect();
        let path = path.to_owned();
        Ok(Self {
            path,
            header,
            clock,
            seconds,
            said,
            period: seconds * counts,
            duration,
            ranges,
            gaps,
            without,
            held_out: false,
        })
    }

    /// What is missing of a column, by its name.
    pub fn gaps_of(&self, column: &str) -> Option<Gaps> {
        self.header.iter().zip(&self.gaps).find(|(name, _)| *name == column).and_then(|(_, gaps)| *gaps)
    }
}

fn no_clock(path: &Path, header: &[String], mistake: &Mistake) -> Failure {
    let place = path.display().to_string();
    if header.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Failure::Init {
            place,
            what: format!("its first row has numbers, not names of columns: {}", header.join(", ")),
            cause: "the log was saved without a header",
            fix: "write a row with the name of each column above it, such as `time_ms,elbow_pos_deg,elbow_torque_Nm`".to_owned(),
        };
    }
    match mistake {
        Mistake::TwoClocks(a, b) => Failure::Init {
            place,
            what: format!("columns `{}` and `{}` both look like the time", header[*a], header[*b]),
            cause: "the log has two clocks",
            fix: format!("keep one: leave the other out with `--leave-out \"{}\"`", header[*b]),
        },
        _ => Failure::Init {
            place,
            what: format!("no column is the time; there are {}", header.join(", ")),
            cause: "the column of the time has another name",
            fix: "name one column `time`, `time_ms` or `t` (unit s, ms, us or ns)".to_owned(),
        },
    }
}
