//! Controllers.

use crate::control::{AnyProblem, broken, listed, options};
use crate::convert::{finite, matrix, rows_to_matrix, to_vector, vector};
use crate::cost_function::Called;
use crate::errors::{self, input};
use crate::model::Model;
use crate::sensing::Sensing;
use faer::Mat;
use numpy::{PyArray1, PyArray2};
use pliant::control::mpc::{Mpc as Engine, Update};
use pliant::control::output::{OutputMpc, OutputOptions, OutputUpdate, Planned};
use pliant::control::plan::{PlanOptions, Violation};
use pliant::control::robust::{RobustError, RobustMpc, RobustUpdate, TubeOptions, ball_of_free_nodes};
use pliant::control::sensing::{SensingError, Sensors};
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

enum Controller {
    Nominal(Box<Engine<AnyProblem>>),
    Tubes(Box<RobustMpc<AnyProblem>>),
    Output(Box<OutputMpc<AnyProblem>>),
}

struct Decision {
    update: Update,
    /// Largest tightening of a constraint, what the tube reaches beyond, and the steps in which a gripper seizes or lets go.
    tube: Option<(f64, Vec<Violation>, Vec<usize>)>,
}

/// The state, or a reading.
enum Known {
    State(State),
    Reading(Option<Vec<f64>>),
}

impl From<Update> for Decision {
    fn from(update: Update) -> Self {
        Self { update, tube: None }
    }
}

impl From<RobustUpdate> for Decision {
    fn from(robust: RobustUpdate) -> Self {
        let most = robust.tightening();
        let RobustUpdate { update, violations, switches, .. } = robust;
        Self { update, tube: Some((most, violations, switches)) }
    }
}

impl Controller {
    fn sensors(&self) -> Option<&Sensors> {
        match self {
            Self::Output(engine) => Some(engine.sensors()),
            Self::Nominal(_) | Self::Tubes(_) => None,
        }
    }

    fn update(&mut self, known: &Known) -> Result<Decision, RobustError> {
        Ok(match (self, known) {
            (Self::Nominal(engine), Known::State(x)) => engine.update(x)?.into(),
            (Self::Tubes(engine), Known::State(x)) => engine.update(x)?.into(),
            (Self::Output(engine), Known::Reading(reading)) => {
                let OutputUpdate { planned, .. } = engine.update(reading.as_deref())?;
                match planned {
                    Planned::Nominal(update) => (*update).into(),
                    Planned::Tubes(robust) => (*robust).into(),
                }
            }
            (Self::Output(_), Known::State(_)) => return Err(kind("readings", "the state").into()),
            (_, Known::Reading(_)) => return Err(kind("the state", "readings").into()),
        })
    }
}

fn kind(needed: &'static str, given: &'static str) -> SensingError {
    SensingError::Kind { needed, given, fix: "give `sensing` to the controller, or leave it out" }
}

/// A controller's knowledge of disturbances and of the state.
pub struct Uncertainty<'a, 'py> {
    pub disturbance: Option<&'a Bound<'py, PyAny>>,
    pub initial: Option<&'a Bound<'py, PyAny>>,
    /// "exact", "shared", or no tube.
    pub tube: Option<&'a str>,
    pub sensing: Option<&'a Bound<'py, Sensing>>,
    /// The state that an estimate begins with.
    pub x0: &'a State,
}

impl Uncertainty<'_, '_> {
    /// Tubes and sensors of a controller.
    fn read(&self, model: &Model) -> PyResult<Option<(TubeOptions, bool)>> {
        let exact = match self.tube {
            None | Some("exact") => true,
            Some("shared") => false,
            Some(other) => return Err(input(format!("tube is \"{other}\", but must be \"exact\", \"shared\" or None"))),
        };
        if self.disturbance.is_none() && self.sensing.is_none() {
            return Ok(None);
        }
        let of = |name: &str, given: Option<&Bound<PyAny>>| match given {
            Some(given) => columns(model, name, given),
            None => Ok(Mat::zeros(model.engine().ndx(), 0)),
        };
        let (disturbance, initial) = (of("disturbance", self.disturbance)?, of("initial", self.initial)?);
        Ok(Some((TubeOptions { disturbance, initial, exact }, self.tube.is_some())))
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
        uncertainty: &Uncertainty,
    ) -> PyResult<Self> {
        let engine = model.get().engine();
        let controller = match (uncertainty.read(model.get())?, uncertainty.sensing) {
            (Some((tubes, tighten)), Some(sensing)) => {
                let options_of_output = OutputOptions { sensors: sensing.get().sensors.clone(), tubes, tighten };
                let made = OutputMpc::new(problem, engine, theta, uncertainty.x0, controls, options, options_of_output);
                Controller::Output(Box::new(made.map_err(errors::robust)?))
            }
            (Some((tubes, true)), None) => {
                let made = RobustMpc::new(problem, engine, theta, controls, options, tubes);
                Controller::Tubes(Box::new(made.map_err(errors::robust)?))
            }
            _ => Controller::Nominal(Box::new(Engine::new(problem, engine, theta, controls, options).map_err(errors::plan)?)),
        };
        Ok(Self { inner: Mutex::new(Loop { controller, last: None }), model })
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
    #[pyo3(signature = (model, evaluate, u0, theta=None, *, lower=None, upper=None, iterations=1, time_limit=None, holding=true, rest_gap=None, disturbance=None, initial=None, tube=Some("exact"), sensing=None, x0=None))]
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
        rest_gap: Option<f64>,
        disturbance: Option<&Bound<'py, PyAny>>,
        initial: Option<&Bound<'py, PyAny>>,
        tube: Option<&str>,
        sensing: Option<&Bound<'py, Sensing>>,
        x0: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let options = options(iterations, PlanOptions::default().tolerance, time_limit, holding, rest_gap)?;
        let problem: AnyProblem = Arc::new(Called::new(model.get(), evaluate, [lower, upper])?);
        let theta = model.get().theta_or_default(theta)?;
        let u0 = matrix("u0", u0, None, model.get().engine().nu())?;
        let x0 = x0.map_or_else(|| Ok(model.get().engine().initial_state()), |x0| model.get().state("x0", x0))?;
        let uncertainty = Uncertainty { disturbance, initial, tube, sensing, x0: &x0 };
        Self::new(problem, model.unbind(), &theta, u0, options, &uncertainty)
    }

    /// Improves the plan from the measured state (nx,) or, with sensors, from a reading (n,) or none; returns the inputs to apply now, (nu,).
    #[pyo3(signature = (x=None))]
    fn update<'py>(&self, py: Python<'py>, x: Option<&Bound<'py, PyAny>>) -> PyResult<Vector<'py>> {
        let model = self.model.get();
        let numbers = self.lock(py).controller.sensors().map(|sensors| sensors.len(model.engine()));
        let known = match (numbers, x) {
            (None, None) => return Err(input("this controller needs the state: call `update(x)`")),
            (None, Some(x)) => Known::State(model.state("x", x)?),
            (Some(_), None) => Known::Reading(None),
            (Some(numbers), Some(reading)) => Known::Reading(Some(vector("the reading", reading, numbers)?)),
        };
        let first = py.detach(|| -> Result<Vec<f64>, RobustError> {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let decision = inner.controller.update(&known)?;
            let first = decision.update.rollout.controls[0].clone();
            inner.last = Some(decision);
            Ok(first)
        });
        Ok(to_vector(py, first.map_err(errors::robust)?))
    }

    /// Inputs (nu,) that were sent instead of those that the last update returned; only with sensors is that of interest.
    fn sent<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<()> {
        let u = vector("u", u, self.model.get().engine().nu())?;
        match &mut self.lock(py).controller {
            Controller::Output(engine) => engine.sent(&u).map_err(errors::robust),
            Controller::Nominal(_) | Controller::Tubes(_) => Ok(()),
        }
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
