//! Fits and diagnoses, as the dictionaries of the command's JSON.

use crate::batch::on_threads;
use crate::errors::{self, InputError, input};
use pliant::identify::log::{Logs, Setup};
use pliant::identify::{DiagnoseOptions, IdentifyError};
use pyo3::prelude::*;
use std::path::PathBuf;

type Progress<'a> = &'a mut (dyn FnMut(&str) + Send);

/// Fits the free parameters that the scene's experiment declares.
#[pyfunction]
#[pyo3(signature = (scene_path, logs=Vec::new(), *, threads=None, progress=None))]
pub fn fit(
    py: Python<'_>,
    scene_path: PathBuf,
    logs: Vec<PathBuf>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    study(py, scene_path, logs, threads, progress, |setup, logs, report| {
        pliant::identify::fit_scene(setup, logs, &mut |text| report(text)).map(|fit| serde_json::to_string(&fit))
    })
}

/// Finds the physical effects that the scene lacks to explain the logs.
#[pyfunction]
#[pyo3(signature = (scene_path, logs=Vec::new(), *, seed=0, threads=None, progress=None))]
pub fn diagnose(
    py: Python<'_>,
    scene_path: PathBuf,
    logs: Vec<PathBuf>,
    seed: u64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let options = DiagnoseOptions { seed, ..DiagnoseOptions::default() };
    study(py, scene_path, logs, threads, progress, |setup, logs, report| {
        pliant::identify::diagnose(setup, logs, &options, &mut |text| report(text)).map(|found| serde_json::to_string(&found))
    })
}

/// Reads scene and logs, works without the interpreter's lock, and turns the JSON into a dictionary.
fn study(
    py: Python<'_>,
    scene: PathBuf,
    logs: Vec<PathBuf>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
    work: impl Fn(&Setup, &Logs, Progress) -> Result<serde_json::Result<String>, IdentifyError> + Send + Sync,
) -> PyResult<Py<PyAny>> {
    let setup = Setup::read(scene).map_err(input)?;
    let logs = setup.read_logs(&logs).map_err(input)?;
    let mut raised = None;
    let json = py.detach(|| {
        let mut report = |text: &str| {
            if let (Some(call), None) = (&progress, &raised) {
                raised = Python::attach(|py| call.call1(py, (text,))).err();
            }
        };
        on_threads(threads, || work(&setup, &logs, &mut report))
    })?;
    if let Some(error) = raised {
        return Err(error);
    }
    let text = json.map_err(errors::identify)?.map_err(|e| InputError::new_err(e.to_string()))?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}
