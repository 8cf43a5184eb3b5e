//! npz logs: arrays of float32 or float64, of shape (time, points, 3) for one record or (records, time, points, 3) for several.

use super::error::{LogError, LogMistake, Need};
use super::experiment::RecordFile;
use super::record::Record;
use super::setup::{Setup, suggestion};
use ndarray::{ArrayD, Axis, Ix2, Ix4, IxDyn, OwnedRepr};
use ndarray_npy::{NpzReader, ReadNpyError, ReadNpzError};
use pliant_scene::{Place, words};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

/// Arrays of a file: (records, time, points, 3).
type Points = ndarray::Array4<f64>;

/// A file while it is read.
struct Arrays {
    file: String,
    reader: NpzReader<File>,
    names: Vec<String>,
    points: BTreeMap<String, Points>,
}

/// Reads all records of a file.
pub(super) fn read(setup: &Setup, path: &Path, file: &RecordFile) -> Result<Vec<Record>, LogError> {
    let only_csv = [("joint", setup.experiment.joint.len()), ("orientation", setup.experiment.orientation.len())];
    if let Some((table, _)) = only_csv.iter().find(|(_, count)| *count > 0) {
        return Err(setup.refuse(&format!("experiment.{table}[0]"), LogMistake::OnlyCsv));
    }
    let mut arrays = Arrays::open(path)?;
    let main = arrays.load_all(setup, file)?;
    let (records, samples) = (arrays.points[&main].shape()[0], arrays.points[&main].shape()[1]);
    let clock = arrays.clock(setup, &main, records, samples)?;
    if let Some(skip) = file.skip.iter().find(|skip| **skip >= records) {
        return Err(arrays.refuse(&main, LogMistake::NoPoint { what: "record", index: *skip as i64, count: records }));
    }
    let mut out = Vec::new();
    for r in (0..records).filter(|r| !file.skip.contains(r)) {
        let name = if records == 1 { format!("{}/{main}", file.file) } else { format!("{}/{main}[{r}]", file.file) };
        let mut record = Record { name, time: clock.time[r].clone(), ..Record::default() };
        record.markers = arrays.markers(setup, &main, r, samples)?;
        record.inputs = arrays.inputs(setup, &main, r, samples)?;
        (record.joints, record.orientations) = (vec![Vec::new(); samples], vec![Vec::new(); samples]);
        let place = |k: usize| arrays.place(&format!("{}[{r}], time {k}", clock.name));
        out.push(setup.finish(record, &place)?);
    }
    Ok(out)
}

/// Times [s] of the samples of each record, and the array they come from.
struct ClockArray {
    name: String,
    time: Vec<Vec<f64>>,
}

impl Arrays {
    fn open(path: &Path) -> Result<Self, LogError> {
        let file = path.display().to_string();
        let place = Place { file: Some(file.clone()), ..Place::default() };
        let unreadable = |error: String| LogError::new(place.clone(), LogMistake::Read { error });
        let opened = File::open(path).map_err(|error| unreadable(error.to_string()))?;
        let mut reader = NpzReader::new(opened).map_err(|error| unreadable(error.to_string()))?;
        let names = reader.names().map_err(|error| unreadable(error.to_string()))?;
        Ok(Self { file, reader, names, points: BTreeMap::new() })
    }

    fn place(&self, field: &str) -> Place {
        Place { file: Some(self.file.clone()), field: field.to_owned(), ..Place::default() }
    }

    fn refuse(&self, field: &str, mistake: LogMistake) -> LogError {
        LogError::new(self.place(field), mistake)
    }

    /// Loads every array that markers and inputs point into; returns the one that names the records.
    fn load_all(&mut self, setup: &Setup, file: &RecordFile) -> Result<String, LogError> {
        let own = setup.experiment.marker.iter().filter_map(|m| m.array.clone());
        let mut named: Vec<String> = own.chain(setup.experiment.input.iter().filter_map(|i| i.array.clone())).collect();
        let borrowed = setup.experiment.marker.iter().any(|m| m.array.is_none());
        let main = match (&file.array, named.first()) {
            (Some(array), _) => array.clone(),
            (None, Some(first)) if !borrowed => first.clone(),
            (None, _) if self.names.len() == 1 => self.names[0].clone(),
            (None, _) => {
                return Err(self.refuse("", LogMistake::WhichArray { known: words::list(self.names.iter().map(String::as_str)) }));
            }
        };
        named.push(main.clone());
        for name in named {
            if !self.points.contains_key(&name) {
                let points = self.points(&name)?;
                self.points.insert(name, points);
            }
        }
        self.agree(&main)?;
        Ok(main)
    }

    /// All arrays have the records and samples of the main one.
    fn agree(&self, main: &str) -> Result<(), LogError> {
        let expected = self.points[main].shape();
        for (name, array) in &self.points {
            for (axis, what) in [(0, "records"), (1, "samples")] {
                if array.shape()[axis] != expected[axis] {
                    return Err(self.refuse(
                        name,
                        LogMistake::Disagree {
                            name: name.clone(),
                            found: array.shape()[axis],
                            other: main.to_owned(),
                            expected: expected[axis],
                            what,
                        },
                    ));
                }
            }
        }
        Ok(())
    }

    /// An array of any shape.
    fn array(&mut self, name: &str) -> Result<ArrayD<f64>, LogError> {
        if !self.names.iter().any(|known| known == name) {
            let known: Vec<&str> = self.names.iter().map(String::as_str).collect();
            let (nearest, known) = suggestion(name, &known);
            return Err(self.refuse("", LogMistake::NoArray { name: name.to_owned(), nearest, known }));
        }
        match self.reader.by_name::<OwnedRepr<f64>, IxDyn>(name) {
            Ok(array) => Ok(array),
            Err(ReadNpzError::Npy(ReadNpyError::WrongDescriptor(_))) => {
                match self.reader.by_name::<OwnedRepr<f32>, IxDyn>(name) {
                    Ok(array) => Ok(array.mapv(f64::from)),
                    Err(error) => Err(self.refuse(name, LogMistake::Type { error: error.to_string() })),
                }
            }
            Err(error) => Err(self.refuse(name, LogMistake::Read { error: error.to_string() })),
        }
    }

    fn points(&mut self, name: &str) -> Result<Points, LogError> {
        let array = self.array(name)?;
        let found = array.shape().to_vec();
        let shape = |array: ArrayD<f64>| array.into_dimensionality::<Ix4>();
        let points = match found.len() {
            3 => shape(array.insert_axis(Axis(0))),
            _ => shape(array),
        };
        match points {
            Ok(points) if points.shape()[3] == 3 => Ok(points),
            _ => Err(self.refuse(name, LogMistake::Shape { found, expected: "(time, points, 3) or (records, time, points, 3)" })),
        }
    }

    fn clock(&mut self, setup: &Setup, main: &str, records: usize, samples: usize) -> Result<ClockArray, LogError> {
        let clock = &setup.experiment.time;
        let Some(name) = &clock.array else {
            let Some(rate) = clock.rate else {
                let mistake = LogMistake::Mapping { key: "rate", kind: "npz" };
                return Err(LogError::new(setup.source.place("experiment.time"), mistake));
            };
            let time: Vec<f64> = (0..samples).map(|k| k as f64 / rate).collect();
            return Ok(ClockArray { name: main.to_owned(), time: vec![time; records] });
        };
        let array = self.array(name)?;
        let found = array.shape().to_vec();
        let array = if found.len() == 1 { array.insert_axis(Axis(0)) } else { array };
        let Ok(array) = array.into_dimensionality::<Ix2>() else {
            return Err(self.refuse(name, LogMistake::Shape { found, expected: "(time) or (records, time)" }));
        };
        let disagree =
            |found, expected, what| LogMistake::Disagree { name: name.clone(), found, other: main.to_owned(), expected, what };
        if array.shape()[1] != samples {
            return Err(self.refuse(name, disagree(array.shape()[1], samples, "samples")));
        }
        if found.len() == 2 && array.shape()[0] != records {
            return Err(self.refuse(name, disagree(array.shape()[0], records, "records")));
        }
        if let Some(((r, k), value)) = array.indexed_iter().find(|(_, value)| !value.is_finite()) {
            let mistake = LogMistake::Missing { found: not_finite(*value), of: Need::Clock };
            return Err(self.refuse(&format!("{name}[{r}], time {k}"), mistake));
        }
        let row = |r: usize| array.row(r % array.shape()[0]).iter().map(|t| t * clock.unit.seconds()).collect();
        Ok(ClockArray { name: name.clone(), time: (0..records).map(row).collect() })
    }

    /// Coordinates of a point of record `r` over time, in SI units.
    fn track(&self, name: &str, r: usize, index: i64, factor: f64, need: Need) -> Result<Vec<[f64; 3]>, LogError> {
        let array = &self.points[name];
        let count = array.shape()[2];
        let point = if index < 0 { index + count as i64 } else { index };
        let Some(point) = usize::try_from(point).ok().filter(|point| *point < count) else {
            return Err(self.refuse(name, LogMistake::NoPoint { what: "point", index, count }));
        };
        let cell = |k: usize, a: usize| match array[[r, k, point, a]] {
            value if value.is_finite() => Ok(value * factor),
            value if value.is_nan() && need == Need::HiddenMarker => Ok(value),
            value => {
                let field = format!("{name}[{r}], time {k}, point {point}, {}", ["x", "y", "z"][a]);
                Err(self.refuse(&field, LogMistake::Missing { found: not_finite(value), of: need }))
            }
        };
        (0..array.shape()[1]).map(|k| Ok([cell(k, 0)?, cell(k, 1)?, cell(k, 2)?])).collect()
    }

    fn markers(&self, setup: &Setup, main: &str, r: usize, samples: usize) -> Result<Vec<Vec<[f64; 3]>>, LogError> {
        let mut out = vec![Vec::new(); samples];
        for (k, marker) in setup.experiment.marker.iter().enumerate() {
            let Some(index) = marker.index else {
                let mistake = LogMistake::Mapping { key: "index", kind: "npz" };
                return Err(LogError::new(setup.source.place(&format!("experiment.marker[{k}]")), mistake));
            };
            let name = marker.array.as_deref().unwrap_or(main);
            let need = if marker.may_be_missing { Need::HiddenMarker } else { Need::Marker };
            let track = self.track(name, r, index, marker.unit.metres(), need)?;
            out.iter_mut().zip(track).for_each(|(row, point)| row.push(point));
        }
        Ok(out)
    }

    fn inputs(&self, setup: &Setup, main: &str, r: usize, samples: usize) -> Result<Vec<Vec<f64>>, LogError> {
        let mut out = vec![Vec::new(); samples];
        for (k, input, factors) in setup.ordered_inputs() {
            let Some(indices) = &input.indices else {
                let mistake = LogMistake::Mapping { key: "indices", kind: "npz" };
                return Err(LogError::new(setup.source.place(&format!("experiment.input[{k}]")), mistake));
            };
            let name = input.array.as_deref().unwrap_or(main);
            // The three components of a point have one unit.
            for (index, factors) in indices.iter().zip(factors.chunks(3)) {
                let track = self.track(name, r, *index, factors[0], Need::Input)?;
                out.iter_mut().zip(track).for_each(|(row, point)| row.extend(point));
            }
        }
        Ok(out)
    }
}

/// A word for a number that is none.
pub(super) fn not_finite(value: f64) -> &'static str {
    if value.is_nan() { "NaN" } else { "infinite" }
}
