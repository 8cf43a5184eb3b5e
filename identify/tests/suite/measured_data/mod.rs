//! Where the measured data lie: `PLIANT_DATA`, else `../shared/data` beside the repository. Tests that need them skip,
//! saying so, where they are absent.

use ndarray::Array4;
use std::path::PathBuf;

/// Path of a measured file, or none after a line on stderr.
pub fn path(relative: &str) -> Option<PathBuf> {
    let workspace = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = std::env::var_os("PLIANT_DATA").map_or_else(|| workspace.join("../shared/data"), PathBuf::from);
    let file = root.join(relative);
    if file.is_file() {
        Some(file)
    } else {
        eprintln!("skipped: no measured data at {} (set PLIANT_DATA)", file.display());
        None
    }
}

/// An array (record, time, point, axis) of an npz file.
pub fn records(relative: &str, array: &str) -> Option<Array4<f64>> {
    let file = std::fs::File::open(path(relative)?).ok()?;
    let mut archive = ndarray_npy::NpzReader::new(file).ok()?;
    let data: Array4<f32> = archive.by_name(array).ok()?;
    Some(data.mapv(f64::from))
}
