//! Python bindings: NumPy arrays in, NumPy arrays out, the interpreter's lock released while the engine works.
//!
//! No formula lives here. Every error of the engine becomes one of two exceptions with the engine's own text: `InputError` if
//! the input is wrong, `NumericsError` if the numerics failed.

mod batch;
mod bench;
mod cable;
mod control;
mod convert;
mod cost_function;
mod equilibrium;
mod errors;
mod gradcheck;
mod import;
mod model;
mod mpc;
mod options;
mod rollout;
mod sensing;
mod study;
mod vector;

use pyo3::prelude::*;

#[pymodule]
fn _pliant(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("InputError", m.py().get_type::<errors::InputError>())?;
    m.add("NumericsError", m.py().get_type::<errors::NumericsError>())?;
    m.add_class::<model::Model>()?;
    m.add_class::<rollout::Rollout>()?;
    m.add_class::<rollout::SurrogateRollout>()?;
    m.add_class::<batch::Batch>()?;
    m.add_class::<vector::VectorStepper>()?;
    m.add_class::<equilibrium::Equilibrium>()?;
    m.add_class::<control::Task>()?;
    m.add_class::<control::Plan>()?;
    m.add_class::<mpc::Mpc>()?;
    m.add_class::<control::Mppi>()?;
    m.add_class::<sensing::Sensing>()?;
    m.add_function(wrap_pyfunction!(model::load, m)?)?;
    m.add_function(wrap_pyfunction!(model::loads, m)?)?;
    m.add_function(wrap_pyfunction!(cable::cable, m)?)?;
    m.add_function(wrap_pyfunction!(control::load_task, m)?)?;
    m.add_function(wrap_pyfunction!(control::loads_task, m)?)?;
    m.add_function(wrap_pyfunction!(control::plan_inputs, m)?)?;
    m.add_function(wrap_pyfunction!(control::conformal_bound, m)?)?;
    m.add_function(wrap_pyfunction!(import::import_model, m)?)?;
    m.add_function(wrap_pyfunction!(bench::bench, m)?)?;
    m.add_function(wrap_pyfunction!(study::fit, m)?)?;
    m.add_function(wrap_pyfunction!(study::diagnose, m)?)?;
    Ok(())
}
