//! The columns and the clock of a log.

use super::super::failure::Failure;
use super::clock;
use super::matching::{self, Mistake};
use super::names;
use pliant::identify::log::{csv_columns, period};
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
    /// Smallest and largest number of every column, in its unit; those that are missing do not count.
    pub ranges: Vec<[f64; 2]>,
    /// Whether it only judges.
    pub held_out: bool,
}

impl Log {
    /// Reads the header and the clock.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let (header, numbers): (Vec<String>, Vec<Vec<f64>>) = csv_columns(path)?.into_iter().unzip();
        let columns: Vec<&str> = header.iter().map(String::as_str).collect();
        let clock = matching::clock(&columns).map_err(|mistake| no_clock(path, &header, &mistake))?;
        let times: Vec<f64> = numbers[clock].iter().copied().filter(|t| t.is_finite()).collect();
        let counts = period(&times);
        if counts <= 0.0 {
            return Err(Failure::Init {
                place: format!("{}: column `{}`", path.display(), header[clock]),
                what: format!("does not count up: {} times", times.len()),
                cause: "the column is not the time, or the log has a single sample",
                fix: "name another column `time`, or give a longer log".to_owned(),
            });
        }
        let unit = names::read(&header[clock]).unit;
        let seconds = clock::seconds(unit.as_deref(), counts);
        let said = unit.as_deref().is_some_and(|unit| clock::UNITS.iter().any(|(known, _)| *known == unit));
        let duration = seconds * (times[times.len() - 1] - times[0]);
        let range = |column: &Vec<f64>| {
            let finite = column.iter().copied().filter(|x| x.is_finite());
            finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let ranges = numbers.iter().map(range).collect();
        let path = path.to_owned();
        Ok(Self { path, header, clock, seconds, said, period: seconds * counts, duration, ranges, held_out: false })
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
