//! Models of other formats.

use crate::errors::{InputError, input};
use pliant::import::Options;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Reads an MJCF or URDF file: the text of a scene, and the report as the dictionary of the command's JSON.
#[pyfunction]
#[pyo3(signature = (path, *, approximate=false, free_base=false, contact=true, packages=None))]
pub fn import_model(
    py: Python<'_>,
    path: PathBuf,
    approximate: bool,
    free_base: bool,
    contact: bool,
    packages: Option<BTreeMap<String, PathBuf>>,
) -> PyResult<(String, Py<PyAny>)> {
    let packages = packages.into_iter().flatten().collect();
    let options = Options { packages, approximate, free_base, no_contact: !contact, ..Options::default() };
    let imported = pliant::import::import_model(path, &options).map_err(input)?;
    let text = serde_json::to_string(&imported.report).map_err(|e| InputError::new_err(e.to_string()))?;
    Ok((imported.to_toml(), py.import("json")?.call_method1("loads", (text,))?.unbind()))
}
