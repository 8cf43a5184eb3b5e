//! Trajectory files: CSV with one named column per coordinate, or npz with one array per rope.

use super::failure::Failure;
use super::file;
use ndarray::{Array1, Array3};
use ndarray_npy::{NpzWriter, WriteNpzError};
use pliant::Rollout;
use std::io::{self, BufWriter, Cursor, Write};
use std::path::Path;

/// Refuses a file that is neither .csv nor .npz.
pub fn check_kind(path: &Path) -> Result<(), Failure> {
    kind(path).map(drop).ok_or_else(|| Failure::Kind { path: path.to_owned() })
}

enum Kind {
    Csv,
    Npz,
}

fn kind(path: &Path) -> Option<Kind> {
    match path.extension()?.to_ascii_lowercase().to_str()? {
        "csv" => Some(Kind::Csv),
        "npz" => Some(Kind::Npz),
        _ => None,
    }
}

/// Writes positions [m] and velocities [m/s] of all real nodes at all states, and the total energy [J].
pub fn write(path: &Path, run: &Rollout, energy: &[f64]) -> Result<(), Failure> {
    match kind(path) {
        Some(Kind::Csv) => file::write(path, |out| csv(out, run, energy)),
        Some(Kind::Npz) => {
            let bytes = npz(run, energy).map_err(|error| Failure::write(path, io::Error::other(error.to_string())))?;
            file::write(path, |out| out.write_all(&bytes))
        }
        None => Err(Failure::Kind { path: path.to_owned() }),
    }
}

/// Columns `t`, `cable.node[0].x`, … `.z`, `.vx`, … `.vz`, next node, …, `energy`.
fn csv(out: &mut BufWriter<&std::fs::File>, run: &Rollout, energy: &[f64]) -> io::Result<()> {
    let h = run.model.step_length();
    write!(out, "t")?;
    for rope in run.model.ropes() {
        for i in 0..rope.nodes.len() {
            for axis in ["x", "y", "z", "vx", "vy", "vz"] {
                write!(out, ",{}.node[{i}].{axis}", rope.name)?;
            }
        }
    }
    writeln!(out, ",energy")?;
    for (k, state) in run.states.iter().enumerate() {
        write!(out, "{}", k as f64 * h)?;
        for node in run.model.ropes().iter().flat_map(|rope| rope.nodes.clone()) {
            for number in state.q[3 * node..3 * node + 3].iter().chain(&state.v[3 * node..3 * node + 3]) {
                write!(out, ",{number}")?;
            }
        }
        writeln!(out, ",{}", energy[k])?;
    }
    Ok(())
}

/// Arrays `t` (T+1), `energy` (T+1), and per rope `cable.position` and `cable.velocity` (T+1, nodes, 3).
fn npz(run: &Rollout, energy: &[f64]) -> Result<Vec<u8>, WriteNpzError> {
    let h = run.model.step_length();
    let times = run.states.len();
    let mut out = NpzWriter::new(Cursor::new(Vec::new()));
    out.add_array("t", &Array1::from_shape_fn(times, |k| k as f64 * h))?;
    out.add_array("energy", &Array1::from_vec(energy.to_vec()))?;
    for rope in run.model.ropes() {
        let (n, first) = (rope.nodes.len(), rope.nodes.start);
        let position = Array3::from_shape_fn((times, n, 3), |(k, i, a)| run.states[k].q[3 * (first + i) + a]);
        let velocity = Array3::from_shape_fn((times, n, 3), |(k, i, a)| run.states[k].v[3 * (first + i) + a]);
        out.add_array(format!("{}.position", rope.name), &position)?;
        out.add_array(format!("{}.velocity", rope.name), &velocity)?;
    }
    Ok(out.finish()?.into_inner())
}
