//! Trajectory files: CSV with one named column per coordinate, or npz with one array per rope, sheet and joint.

use super::failure::Failure;
use super::file;
use ndarray::{Array1, Array2, Array3};
use ndarray_npy::{NpzWriter, WriteNpzError};
use pliant::{Joint, Model, Rollout, State};
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

/// Writes positions [m] and velocities [m/s] of all real nodes and of all joints ([rad], [rad/s], or [m], [m/s]) at all states, and the
/// total energy [J].
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

/// Columns `t`, `cable.node[0].x`, … `.z`, `.vx`, … `.vz`, next node, …; `elbow.q`, `elbow.v`, or for a ball `wrist.qw`, … `.qz`,
/// `.vx`, … `.vz`, next joint, …; history variables, `elbow.plastic`, …; `energy`.
fn csv(out: &mut BufWriter<&std::fs::File>, run: &Rollout, energy: &[f64]) -> io::Result<()> {
    let h = run.model.step_length();
    write!(out, "t")?;
    for (name, nodes) in run.model.node_spans() {
        for i in 0..nodes.len() {
            for axis in ["x", "y", "z", "vx", "vy", "vz"] {
                write!(out, ",{name}.node[{i}].{axis}")?;
            }
        }
    }
    for joint in run.model.tree().joints() {
        let names: &[&str] = if joint.kind.n_dofs() == 3 { &["qw", "qx", "qy", "qz", "vx", "vy", "vz"] } else { &["q", "v"] };
        names.iter().try_for_each(|name| write!(out, ",{}.{name}", joint.name))?;
    }
    run.model.memory_names().iter().try_for_each(|name| write!(out, ",{name}"))?;
    writeln!(out, ",energy")?;
    for (k, state) in run.states.iter().enumerate() {
        write!(out, "{}", k as f64 * h)?;
        for node in run.model.node_spans().flat_map(|(_, nodes)| nodes) {
            for number in state.q[3 * node..3 * node + 3].iter().chain(&state.v[3 * node..3 * node + 3]) {
                write!(out, ",{number}")?;
            }
        }
        for joint in run.model.tree().joints() {
            joint_numbers(&run.model, joint, state).try_for_each(|number| write!(out, ",{number}"))?;
        }
        state.z.iter().try_for_each(|number| write!(out, ",{number}"))?;
        writeln!(out, ",{}", energy[k])?;
    }
    Ok(())
}

/// A joint's coordinates, then its velocities.
fn joint_numbers<'a>(model: &Model, joint: &Joint, state: &'a State) -> impl Iterator<Item = &'a f64> {
    let n = model.n_node_dofs();
    let q = &state.q[n + joint.q..n + joint.q + joint.kind.n_coordinates()];
    let v = &state.v[n + joint.v..n + joint.v + joint.kind.n_dofs()];
    q.iter().chain(v)
}

/// Arrays `t` (T+1), `energy` (T+1), and per rope and sheet `cable.position` and `cable.velocity` (T+1, nodes, 3), per joint `elbow.q`
/// (T+1, 1; 4 for a ball) and `elbow.v` (T+1, 1; 3), and per history variable `elbow.plastic`, … (T+1).
fn npz(run: &Rollout, energy: &[f64]) -> Result<Vec<u8>, WriteNpzError> {
    let h = run.model.step_length();
    let times = run.states.len();
    let mut out = NpzWriter::new(Cursor::new(Vec::new()));
    out.add_array("t", &Array1::from_shape_fn(times, |k| k as f64 * h))?;
    out.add_array("energy", &Array1::from_vec(energy.to_vec()))?;
    for (name, nodes) in run.model.node_spans() {
        let (n, first) = (nodes.len(), nodes.start);
        let position = Array3::from_shape_fn((times, n, 3), |(k, i, a)| run.states[k].q[3 * (first + i) + a]);
        let velocity = Array3::from_shape_fn((times, n, 3), |(k, i, a)| run.states[k].v[3 * (first + i) + a]);
        out.add_array(format!("{name}.position"), &position)?;
        out.add_array(format!("{name}.velocity"), &velocity)?;
    }
    let n = run.model.n_node_dofs();
    for joint in run.model.tree().joints() {
        let q = Array2::from_shape_fn((times, joint.kind.n_coordinates()), |(k, a)| run.states[k].q[n + joint.q + a]);
        let v = Array2::from_shape_fn((times, joint.kind.n_dofs()), |(k, a)| run.states[k].v[n + joint.v + a]);
        out.add_array(format!("{}.q", joint.name), &q)?;
        out.add_array(format!("{}.v", joint.name), &v)?;
    }
    for (k, name) in run.model.memory_names().iter().enumerate() {
        out.add_array(name, &Array1::from_shape_fn(times, |step| run.states[step].z[k]))?;
    }
    Ok(out.finish()?.into_inner())
}
