//! Controllers.

use crate::control::{AnyProblem, broken, listed, options};
use crate::convert::{finite, matrix, rows_to_matrix, to_vector};
use crate::cost_function::Called;
use crate::errors::{self, input};
use crate::model::Model;
use faer::Mat;
use numpy::{PyArray1, PyArray2};
use pliant::control::mpc::{Mpc as Engine, Update};
use pliant::control::plan::{PlanOptions, Violation};
use pliant::control::robust::{RobustError, RobustMpc, RobustUpdate, ball_of_free_nodes};
use pliant::{Rollout, State};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyList;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// A controller.
#[pyclass(module = "pliant", frozen)]
pub struct Mpc {
    inner: Mutex<Loop>,
    model: Py<Model>,
}

/// A controller and its last decision.
struct Loop {
    controller: Controller,
    last: Option<Decision>,
}

pub enum Controller {
    Nominal(Box<Engine<AnyProblem>>),
    Tubes(Box<RobustMpc<AnyProblem>>),
}

struct Decision {
    update: Update,
    /// Largest tightening of a constraint, what the tube reaches beyond, and the steps in which a gripper seizes or lets go.
    tube: Option<(f64, Vec<Violation>, Vec<usize>)>,
}

impl Controller {
    fn update(&mut self, x: &State) -> Result<Decision, RobustError> {
        match self {
            Self::Nominal(engine) => Ok(Decision { update: engine.update(x)?, tube: None }),
            Self::Tubes(engine) => {
                let RobustUpdate { update, tube, violations, switches } = engine.update(x)?;
                let stages = 0..=update.rollout.controls.len();
                let most = stages.flat_map(|k| tube.tightenings.rows(k)).fold(0.0, |most: f64, h| most.max(*h));
                Ok(Decision { update, tube: Some((most, violations, switches)) })
            }
        }
    }
}

/// E of the disturbances, (ndx, nw), or the radius of a ball of all free nodes' positions [m].
pub fn columns(model: &Model, name: &str, given: &Bound<PyAny>) -> PyResult<Mat<f64>> {
    let engine = model.engine();
    if let Ok(radius) = given.extract::<f64>() {
        if !radius.is_finite() || radius < 0.0 {
            return Err(input(format!("{name} is {radius} m, but must be a radius, finite and not negative")));
        }
        return Ok(ball_of_free_nodes(engine, radius));
    }
    let columns = given.getattr("shape").ok().and_then(|shape| shape.get_item(1).ok()).and_then(|n| n.extract::<usize>().ok());
    let columns = columns.ok_or_else(|| input(format!("{name} must be a radius [m] or a matrix (ndx, nw)")))?;
    let rows = matrix(name, given, Some(engine.ndx()), columns)?;
    finite(name, rows.iter().map(Vec::as_slice))?;
    Ok(Mat::from_fn(engine.ndx(), columns, |r, c| rows[r][c]))
}

impl Mpc {
    pub fn new(
        problem: AnyProblem,
        model: Py<Model>,
        theta: &[f64],
        controls: Vec<Vec<f64>>,
        options: PlanOptions,
    ) -> PyResult<Self> {
        let engine = Engine::new(problem, model.get().engine(), theta, controls, options).map_err(errors::plan)?;
        Ok(Self::of(Controller::Nominal(Box::new(engine)), model))
    }

    pub fn of(controller: Controller, model: Py<Model>) -> Self {
        Self { inner: Mutex::new(Loop { controller, last: None }), model }
    }

    fn lock<'a>(&'a self, py: Python<'_>) -> MutexGuard<'a, Loop> {
        self.inner.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    fn decision<T>(&self, py: Python<'_>, of: impl FnOnce(&Decision) -> PyResult<T>) -> PyResult<T> {
        let inner = self.lock(py);
        of(inner.last.as_ref().ok_or_else(|| input("this controller has not been updated yet: call `update(x)` first"))?)
    }

    fn last<T>(&self, py: Python<'_>, of: impl FnOnce(&Update) -> PyResult<T>) -> PyResult<T> {
        self.decision(py, |decision| of(&decision.update))
    }
}

#[pymethods]
impl Mpc {
    /// A controller for a cost given as a function.
    #[new]
    #[pyo3(signature = (model, evaluate, u0, theta=None, *, lower=None, upper=None, iterations=1, time_limit=None, holding=true))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn of_function<'py>(
        model: Bound<'py, Model>,
        evaluate: Py<PyAny>,
        u0: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        lower: Option<&Bound<'py, PyAny>>,
        upper: Option<&Bound<'py, PyAny>>,
        iterations: usize,
        time_limit: Option<f64>,
        holding: bool,
    ) -> PyResult<Self> {
        let options = options(iterations, PlanOptions::default().tolerance, time_limit, holding, None)?;
        let problem: AnyProblem = Arc::new(Called::new(model.get(), evaluate, [lower, upper])?);
        let theta = model.get().theta_or_default(theta)?;
        let u0 = matrix("u0", u0, None, model.get().engine().nu())?;
        Self::new(problem, model.unbind(), &theta, u0, options)
    }

    /// Improves the plan from the measured state x (nx,); returns the inputs to apply now, (nu,).
    fn update<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let x = self.model.get().state("x", x)?;
        let first = py.detach(|| -> Result<Vec<f64>, RobustError> {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let decision = inner.controller.update(&x)?;
            let first = decision.update.rollout.controls[0].clone();
            inner.last = Some(decision);
            Ok(first)
        });
        Ok(to_vector(py, first.map_err(errors::robust)?))
    }

    /// Largest tightening of a constraint by the last tube; 0 without tubes.
    #[getter]
    fn tightening(&self, py: Python<'_>) -> PyResult<f64> {
        self.decision(py, |decision| Ok(decision.tube.as_ref().map_or(0.0, |tube| tube.0)))
    }

    /// Constraints that the last tube reaches beyond: (text, by how much), largest first; without tubes those that the plan violates.
    #[getter]
    fn violations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.decision(py, |decision| match &decision.tube {
            Some((_, violations, _)) => broken(py, violations),
            None => broken(py, &decision.update.violations),
        })
    }

    /// Steps of the last plan in which a gripper seizes or lets go, through which a tube is not valid.
    #[getter]
    fn switches(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.decision(py, |decision| Ok(decision.tube.as_ref().map_or(Vec::new(), |tube| tube.2.clone())))
    }

    /// Inputs of the last plan, (N, nu).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let nu = self.model.get().engine().nu();
        self.last(py, |update| rows_to_matrix(py, &update.rollout.controls, nu))
    }

    /// States of the last plan, (N + 1, nx).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let nx = self.model.get().engine().nx();
        let flat = |rollout: &Rollout| rollout.states.iter().map(State::to_flat).collect::<Vec<_>>();
        self.last(py, |update| rows_to_matrix(py, &flat(&update.rollout), nx))
    }

    /// Cost of the last plan.
    #[getter]
    fn cost(&self, py: Python<'_>) -> PyResult<f64> {
        self.last(py, |update| Ok(update.cost))
    }

    /// Price of the constraints that the last plan violates.
    #[getter]
    fn penalty(&self, py: Python<'_>) -> PyResult<f64> {
        self.last(py, |update| Ok(update.penalty))
    }

    /// The steps of the last update.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.last(py, |update| listed(py, &update.steps))
    }

    /// Why the last update ended.
    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.last(py, |update| Ok(update.status.word()))
    }
}
