//! The gradient check as dictionaries.

use crate::errors;
use pliant::gradcheck::{BlockReport, Verdict, gradcheck as check};
use pliant::{Model, State};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::Arc;

/// The report as a dictionary.
pub fn gradcheck<'py>(
    py: Python<'py>,
    model: &Arc<Model>,
    theta: &[f64],
    x0: &State,
    u: &[Vec<f64>],
    seed: u64,
) -> PyResult<Bound<'py, PyDict>> {
    let report = py.detach(|| check(model, theta, x0, u, seed)).map_err(errors::adjoint)?;
    let dict = PyDict::new(py);
    dict.set_item("verdict", verdict(report.verdict))?;
    dict.set_item("judged", report.judged)?;
    dict.set_item("total", report.total)?;
    dict.set_item("worst_relative_error", report.worst_relative_error)?;
    dict.set_item("taylor_slope", report.taylor_slope)?;
    dict.set_item("dot_test", report.dot_test)?;
    dict.set_item("switches", report.switches)?;
    dict.set_item("retries", report.retries)?;
    let blocks = report.blocks.iter().map(|b| block(py, b)).collect::<PyResult<Vec<_>>>()?;
    dict.set_item("blocks", PyList::new(py, blocks)?)?;
    Ok(dict)
}

fn block<'py>(py: Python<'py>, b: &BlockReport) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", &b.name)?;
    dict.set_item("size", b.size)?;
    dict.set_item("derivative", b.derivative)?;
    dict.set_item("difference", b.difference)?;
    dict.set_item("relative_error", b.relative_error)?;
    dict.set_item("floor", b.floor)?;
    dict.set_item("step", b.step)?;
    dict.set_item("taylor_slope", b.taylor_slope)?;
    dict.set_item("dot_test", b.dot_test)?;
    dict.set_item("switches", b.switches)?;
    dict.set_item("one_sided", b.one_sided)?;
    dict.set_item("verdict", verdict(b.verdict))?;
    dict.set_item("reason", &b.reason)?;
    Ok(dict)
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "pass",
        Verdict::Fail => "fail",
        Verdict::Inconclusive => "inconclusive",
    }
}
