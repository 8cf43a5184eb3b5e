//! Plans and controllers.

use crate::convert::{matrix, rows_to_matrix, to_vector, vector};
use crate::cost_function::Called;
use crate::errors::{self, input};
use crate::model::Model;
use crate::mpc::{Mpc, Uncertainty};
use crate::options::Trajectory;
use crate::rollout::wrap;
use crate::sensing::Sensing;
use numpy::{PyArray1, PyArray2};
use pliant::control::conformal::{self, Coverage};
use pliant::control::mppi::{Mppi as Sampler, MppiOptions};
use pliant::control::plan::{self, Annealing, PlanOptions, PlanStatus, PlanStep, Violation};
use pliant::control::problem::Problem;
use pliant::scene::Source;
use pliant::{State, TaskCase};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;
/// Cost and constraints of any kind.
pub type AnyProblem = Arc<dyn Problem + Send + Sync>;

/// Cost and constraints of a task file, with its scene.
#[pyclass(module = "pliant", frozen)]
pub struct Task {
    case: TaskCase,
    model: Py<Model>,
}

/// Reads a task file (TOML) and the scene beside it.
#[pyfunction]
pub fn load_task(py: Python<'_>, path: PathBuf) -> PyResult<Task> {
    Task::new(py, TaskCase::read(path).map_err(input)?)
}

/// Reads a task from a text (TOML); its scene is the text `scene` or a file in `folder`.
#[pyfunction]
#[pyo3(signature = (text, *, scene=None, folder=PathBuf::new()))]
pub fn loads_task(py: Python<'_>, text: &str, scene: Option<&str>, folder: PathBuf) -> PyResult<Task> {
    let scene = scene.map(|scene| Source::new("scene.toml", scene));
    let name = folder.join("task.toml").display().to_string();
    Task::new(py, TaskCase::parse(text, &name, scene.as_ref()).map_err(input)?)
}

impl Task {
    fn new(py: Python<'_>, case: TaskCase) -> PyResult<Self> {
        let model = Py::new(py, Model::from_case(&case.case))?;
        Ok(Self { case, model })
    }

    fn asked<'py>(
        &self,
        py: Python<'py>,
        x0: Option<&Bound<'py, PyAny>>,
        u0: Option<&Bound<'py, PyAny>>,
        theta: Option<&Bound<'py, PyAny>>,
        (steps, fewer): (usize, &str),
    ) -> PyResult<Asked> {
        let model = self.model.bind(py).get();
        let theta = model.theta_or_default(theta)?;
        let x0 = x0.map_or_else(|| Ok(self.case.case.x0.clone()), |x0| model.state("x0", x0))?;
        let first = |u0: &Bound<'py, PyAny>| {
            let rows = matrix("u0", u0, None, model.engine().nu())?;
            if rows.len() == steps {
                return Ok(rows);
            }
            let got = rows.len();
            Err(input(format!("u0 has {got} rows, but {steps} steps are to be planned: give a row for each, or {fewer}")))
        };
        let controls = u0.map_or_else(|| Ok(self.case.first_guess(steps)), first)?;
        Ok(Asked { x0, controls, theta })
    }
}

/// Arguments of a plan.
struct Asked {
    x0: State,
    controls: Vec<Vec<f64>>,
    theta: Vec<f64>,
}

pub fn options(
    iterations: usize,
    tolerance: f64,
    time_limit: Option<f64>,
    holding: bool,
    rest_gap: Option<f64>,
) -> PyResult<PlanOptions> {
    if tolerance.is_nan() || tolerance < 0.0 {
        return Err(input(format!("tolerance is {tolerance}, but must not be negative")));
    }
    let refused = |limit: f64| input(format!("time_limit is {limit} s, but must be a positive number"));
    let limit = |limit: f64| Duration::try_from_secs_f64(limit).ok().filter(|l| !l.is_zero()).ok_or_else(|| refused(limit));
    let time_limit = time_limit.map(limit).transpose()?;
    if let Some(gap) = rest_gap.filter(|gap| !(gap.is_finite() && *gap > 0.0)) {
        return Err(input(format!("rest_gap is {gap} m, but must be positive")));
    }
    let smoothing = rest_gap.map(Annealing::from_gap);
    Ok(PlanOptions { iterations, tolerance, time_limit, holding, smoothing })
}

#[pymethods]
impl Task {
    /// The model of its scene.
    #[getter]
    fn model(&self, py: Python<'_>) -> Py<Model> {
        self.model.clone_ref(py)
    }

    /// Steps of a plan.
    #[getter]
    fn steps(&self) -> usize {
        self.case.task.steps
    }

    /// Steps that a controller looks ahead.
    #[getter]
    fn horizon(&self) -> usize {
        self.case.task.horizon.unwrap_or(self.case.task.steps)
    }

    /// Sensors of its section `sensing`; None without one.
    #[getter]
    fn sensing(&self, py: Python<'_>) -> Option<Sensing> {
        self.case.problem.sensors().map(|sensors| Sensing::of(sensors.clone(), self.model.clone_ref(py)))
    }

    /// The state that the scene starts from, (nx,).
    #[getter]
    fn x0<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.case.case.x0.to_flat())
    }

    /// Bounds of the inputs, (nu,) each.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> (Vector<'py>, Vector<'py>) {
        let nu = self.case.case.model.nu();
        let (mut lower, mut upper) = (vec![0.0; nu], vec![0.0; nu]);
        self.case.problem.bounds(0, &mut lower, &mut upper);
        (to_vector(py, lower), to_vector(py, upper))
    }

    /// Cost of states x (N + 1, nx) under inputs u (N, nu), and the constraints that they violate.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        u: &Bound<'py, PyAny>,
    ) -> PyResult<(f64, Bound<'py, PyList>)> {
        let engine = &self.case.case.model;
        let u = matrix("u", u, None, engine.nu())?;
        let x = matrix("x", x, Some(u.len() + 1), engine.nx())?;
        let states: Vec<State> = x.iter().map(|x| State::from_flat(x, engine.nq(), engine.nv())).collect();
        let (cost, violations) = plan::evaluate(&self.case.problem, &states, &u).map_err(errors::plan)?;
        Ok((cost, broken(py, &violations)?))
    }

    /// Seeks the inputs of least cost.
    #[pyo3(signature = (x0=None, u0=None, theta=None, *, iterations=50, tolerance=1e-6, time_limit=None, holding=true, rest_gap=None))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn plan<'py>(
        &self,
        py: Python<'py>,
        x0: Option<&Bound<'py, PyAny>>,
        u0: Option<&Bound<'py, PyAny>>,
        theta: Option<&Bound<'py, PyAny>>,
        iterations: usize,
        tolerance: f64,
        time_limit: Option<f64>,
        holding: bool,
        rest_gap: Option<f64>,
    ) -> PyResult<Plan> {
        let options = options(iterations, tolerance, time_limit, holding, rest_gap)?;
        let Asked { x0, controls, theta } =
            self.asked(py, x0, u0, theta, (self.case.task.steps, "change `steps` of the task"))?;
        let model = &self.case.case.model;
        let found = py.detach(|| plan::plan(&self.case.problem, model, &theta, &x0, &controls, options)).map_err(errors::plan)?;
        Plan::new(py, found)
    }

    /// A controller that looks `horizon` steps ahead.
    #[pyo3(signature = (u0=None, theta=None, *, horizon=None, iterations=1, time_limit=None, holding=true, rest_gap=None, disturbance=None, initial=None, tube=Some("exact"), sensing=None))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn mpc<'py>(
        &self,
        py: Python<'py>,
        u0: Option<&Bound<'py, PyAny>>,
        theta: Option<&Bound<'py, PyAny>>,
        horizon: Option<usize>,
        iterations: usize,
        time_limit: Option<f64>,
        holding: bool,
        rest_gap: Option<f64>,
        disturbance: Option<&Bound<'py, PyAny>>,
        initial: Option<&Bound<'py, PyAny>>,
        tube: Option<&str>,
        sensing: Option<&Bound<'py, Sensing>>,
    ) -> PyResult<Mpc> {
        let options = options(iterations, PlanOptions::default().tolerance, time_limit, holding, rest_gap)?;
        let steps = (horizon.unwrap_or_else(|| self.horizon()), "change `horizon`");
        let Asked { controls, theta, .. } = self.asked(py, None, u0, theta, steps)?;
        let problem: AnyProblem = Arc::new(self.case.problem.clone());
        let uncertainty = Uncertainty { disturbance, initial, tube, sensing, x0: &self.case.case.x0 };
        Mpc::new(problem, self.model.clone_ref(py), &theta, controls, options, &uncertainty)
    }

    /// A controller that samples, to compare with.
    #[pyo3(signature = (u0, sigma, theta=None, *, samples=256, temperature=0.1, gamma=1e-2, violation=10.0, seed=0))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn mppi<'py>(
        &self,
        py: Python<'py>,
        u0: &Bound<'py, PyAny>,
        sigma: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        samples: usize,
        temperature: f64,
        gamma: f64,
        violation: f64,
        seed: u64,
    ) -> PyResult<Mppi> {
        if temperature.is_nan() || temperature <= 0.0 {
            return Err(input(format!("temperature is {temperature}, but must be positive")));
        }
        let Asked { controls, theta, .. } =
            self.asked(py, None, Some(u0), theta, (self.horizon(), "change `horizon` of the task"))?;
        let engine = &self.case.case.model;
        let sigma = vector("sigma", sigma, engine.nu())?;
        if let Some(k) = sigma.iter().position(|s| !(s.is_finite() && *s >= 0.0)) {
            return Err(input(format!("sigma[{k}] is {}, but must be finite and not negative", sigma[k])));
        }
        let options = MppiOptions { samples, sigma, temperature, gamma, violation, seed };
        let problem: AnyProblem = Arc::new(self.case.problem.clone());
        let inner = Sampler::new(problem, engine, &theta, controls, options).map_err(errors::plan)?;
        Ok(Mppi { inner: Mutex::new(inner), model: self.model.clone_ref(py) })
    }

    fn __repr__(&self) -> String {
        format!(
            "<pliant.Task: {} steps, {} costs, {} limits>",
            self.case.task.steps,
            self.case.task.cost.len(),
            self.case.task.limit.len()
        )
    }
}

/// Seeks the inputs of least cost, for a cost given as a function.
#[pyfunction]
#[pyo3(name = "plan", signature = (model, evaluate, x0, u0, theta=None, *, lower=None, upper=None, iterations=50, tolerance=1e-6, time_limit=None, holding=true, rest_gap=None))]
#[allow(clippy::too_many_arguments)] // keyword arguments
pub fn plan_inputs<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    evaluate: Py<PyAny>,
    x0: &Bound<'py, PyAny>,
    u0: &Bound<'py, PyAny>,
    theta: Option<&Bound<'py, PyAny>>,
    lower: Option<&Bound<'py, PyAny>>,
    upper: Option<&Bound<'py, PyAny>>,
    iterations: usize,
    tolerance: f64,
    time_limit: Option<f64>,
    holding: bool,
    rest_gap: Option<f64>,
) -> PyResult<Plan> {
    let options = options(iterations, tolerance, time_limit, holding, rest_gap)?;
    let model = model.get();
    let problem = Called::new(model, evaluate, [lower, upper])?;
    let (x0, theta) = (model.state("x0", x0)?, model.theta_or_default(theta)?);
    let u0 = matrix("u0", u0, None, model.engine().nu())?;
    let found = py.detach(|| plan::plan(&problem, model.engine(), &theta, &x0, &u0, options)).map_err(errors::plan)?;
    Plan::new(py, found)
}

/// A plan.
#[pyclass(module = "pliant", frozen)]
pub struct Plan {
    rollout: Py<PyAny>,
    /// Cost.
    #[pyo3(get)]
    cost: f64,
    violations: Vec<Violation>,
    steps: Vec<PlanStep>,
    status: PlanStatus,
    /// Whether the last step was taken with a surrogate term.
    #[pyo3(get)]
    surrogate: bool,
    u: Vec<Vec<f64>>,
    nu: usize,
}

impl Plan {
    fn new(py: Python<'_>, found: plan::Plan) -> PyResult<Self> {
        let (u, nu) = (found.rollout.controls.clone(), found.rollout.model.nu());
        let rollout = wrap(py, Arc::new(Trajectory::Exact(found.rollout)))?.unbind();
        let plan::Plan { cost, violations, steps, status, surrogate, .. } = found;
        Ok(Self { rollout, cost, violations, steps, status, surrogate, u, nu })
    }
}

#[pymethods]
impl Plan {
    /// Its rollout, with derivatives.
    #[getter]
    fn rollout(&self, py: Python<'_>) -> Py<PyAny> {
        self.rollout.clone_ref(py)
    }

    /// Its inputs, (N, nu).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows_to_matrix(py, &self.u, self.nu)
    }

    /// Constraints that it violates, largest first: (text, by how much).
    #[getter]
    fn violations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        broken(py, &self.violations)
    }

    /// The steps of the search.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        listed(py, &self.steps)
    }

    /// Why the search ended: "converged", "iterations", "time" or "stalled".
    #[getter]
    fn status(&self) -> &'static str {
        self.status.word()
    }

    fn __repr__(&self) -> String {
        format!("<pliant.Plan: cost {:.6}, {} violations, {}>", self.cost, self.violations.len(), self.status.word())
    }
}

/// A sampling controller.
#[pyclass(module = "pliant", frozen)]
pub struct Mppi {
    inner: Mutex<Sampler<AnyProblem>>,
    model: Py<Model>,
}

#[pymethods]
impl Mppi {
    /// Improves the plan from the measured state x (nx,); returns the inputs to apply now, (nu,).
    fn update<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let x = self.model.get().state("x", x)?;
        let first = py.detach(|| self.inner.lock().unwrap_or_else(PoisonError::into_inner).update(&x));
        Ok(to_vector(py, first.map_err(errors::plan)?))
    }
}

/// A bound on one-step errors from held-out runs by split conformal prediction: a dict (see the stubs).
#[pyfunction]
#[pyo3(signature = (runs, delta, horizon, *, coverage="trajectory"))]
pub fn conformal_bound<'py>(
    py: Python<'py>,
    runs: Vec<Vec<f64>>,
    delta: f64,
    horizon: usize,
    coverage: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let coverage = match coverage {
        "trajectory" => Coverage::Trajectory,
        "transitions" => Coverage::Transitions,
        other => return Err(input(format!("coverage is \"{other}\", but must be \"trajectory\" or \"transitions\""))),
    };
    let bound = conformal::conformal_bound(&runs, delta, horizon, coverage, false).map_err(input)?;
    let dict = PyDict::new(py);
    dict.set_item("radius", bound.radius)?;
    dict.set_item("delta", bound.delta)?;
    dict.set_item("horizon", bound.horizon)?;
    dict.set_item("scores", bound.scores)?;
    dict.set_item("rank", bound.rank)?;
    dict.set_item("statement", bound.statement())?;
    Ok(dict)
}

pub fn broken<'py>(py: Python<'py>, violations: &[Violation]) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, violations.iter().map(|v| (v.constraint.clone(), v.by)))
}

pub fn listed<'py>(py: Python<'py>, steps: &[PlanStep]) -> PyResult<Bound<'py, PyList>> {
    let one = |step: &PlanStep| -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("cost", step.cost)?;
        dict.set_item("penalty", step.penalty)?;
        dict.set_item("predicted", step.predicted)?;
        dict.set_item("achieved", step.achieved)?;
        dict.set_item("damping", step.damping)?;
        dict.set_item("rollouts", step.rollouts)?;
        dict.set_item("approaches", step.approaches)?;
        dict.set_item("rest_gap", step.rest_gap)?;
        Ok(dict)
    };
    PyList::new(py, steps.iter().map(one).collect::<PyResult<Vec<_>>>()?)
}
