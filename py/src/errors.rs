//! The engine's errors as Python exceptions.

use pliant_adjoint::AdjointError;
use pliant_engine::model::BuildError;
use pliant_engine::scene::SceneError;
use pliant_engine::step::StepError;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use std::fmt::Display;

create_exception!(pliant, InputError, PyValueError, "What was given is wrong: a scene, a log, an array's shape, a parameter.");
create_exception!(pliant, NumericsError, PyRuntimeError, "The numerics failed: not converged, not finite, or singular.");

/// What was given is wrong.
pub fn input(error: impl Display) -> PyErr {
    InputError::new_err(error.to_string())
}

pub fn scene(error: SceneError) -> PyErr {
    input(error)
}

pub fn build(error: BuildError) -> PyErr {
    input(error)
}

pub fn step(error: StepError) -> PyErr {
    match error {
        StepError::Size { .. }
        | StepError::Parameter { .. }
        | StepError::Command { .. }
        | StepError::EquilibriumWithContact { .. } => input(error),
        StepError::NotConverged { .. }
        | StepError::NotFinite { .. }
        | StepError::Singular { .. }
        | StepError::Geometry { .. } => NumericsError::new_err(error.to_string()),
    }
}

pub fn adjoint(error: AdjointError) -> PyErr {
    match error {
        AdjointError::Step(error) => step(error),
        AdjointError::NoRecords | AdjointError::Size { .. } => input(error),
    }
}
