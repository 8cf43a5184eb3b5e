//! The engine's errors as Python exceptions.

use pliant::control::plan::PlanError;
use pliant::control::robust::RobustError;
use pliant::control::sensing::SensingError;
use pliant::identify::IdentifyError;
use pliant::{AdjointError, StepError, VectorError};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use std::fmt::Display;

create_exception!(pliant, InputError, PyValueError, "Wrong input: a scene, a log, an array's shape, a parameter.");
create_exception!(pliant, NumericsError, PyRuntimeError, "The numerics failed: not converged, not finite, or singular.");

/// Wrong input.
pub fn input(error: impl Display) -> PyErr {
    InputError::new_err(error.to_string())
}

pub fn step(error: StepError) -> PyErr {
    of_step(&error, &error)
}

/// Of a vector stepper, or of the copy that it names.
pub fn vector(error: VectorError) -> PyErr {
    match &error {
        VectorError::Copy { source, .. } | VectorError::Records(source) => of_step(source, &error),
        _ => input(error),
    }
}

/// The exception of `error`'s kind with the text of `told`.
fn of_step(error: &StepError, told: &dyn Display) -> PyErr {
    match error {
        StepError::Size { .. }
        | StepError::Memory { .. }
        | StepError::Parameter { .. }
        | StepError::Command { .. }
        | StepError::Frames { .. }
        | StepError::EquilibriumWithContact { .. } => input(told),
        StepError::NotConverged { .. }
        | StepError::EnergyCreated { .. }
        | StepError::NotFinite { .. }
        | StepError::Singular { .. }
        | StepError::NoNormal { .. }
        | StepError::ContactNotFinite { .. }
        | StepError::Geometry { .. } => NumericsError::new_err(told.to_string()),
    }
}

pub fn identify(error: IdentifyError) -> PyErr {
    match error {
        error if error.is_input() => input(error),
        error => NumericsError::new_err(error.to_string()),
    }
}

pub fn adjoint(error: AdjointError) -> PyErr {
    match error {
        AdjointError::Step(error) => step(error),
        AdjointError::NoRecords => input("this rollout kept no records, which derivatives need: simulate it with `record=True`"),
        AdjointError::Checkpointed | AdjointError::Size { .. } => input(error),
    }
}

/// Of a controller with tubes.
pub fn robust(error: RobustError) -> PyErr {
    match error {
        RobustError::Plan(error) => plan(error),
        RobustError::Disturbance { .. } => input(error),
        RobustError::Sensing(SensingError::Step(error)) => step(error),
        RobustError::Sensing(error) => input(error),
        RobustError::Tube(_) | RobustError::Observer(_) => NumericsError::new_err(error.to_string()),
    }
}

/// Of a plan.
pub fn plan(error: PlanError) -> PyErr {
    match error {
        PlanError::Guess(error) => step(error),
        PlanError::Adjoint(error) => adjoint(error),
        PlanError::NotFinite { .. } | PlanError::Step(_) | PlanError::Hold { .. } => NumericsError::new_err(error.to_string()),
        PlanError::Inputs { .. }
        | PlanError::Empty
        | PlanError::Problem(_)
        | PlanError::Bounds { .. }
        | PlanError::Memory { .. } => input(error),
    }
}
