//! A scene made ready to simulate.

use crate::batch::{Batch, Job};
use crate::convert::{matrix, optional_vector, positions, rows_to_matrix, to_matrix, to_vector, vector};
use crate::equilibrium::Equilibrium;
use crate::errors::{self, input};
use crate::options::Keep;
use crate::rollout::wrap;
use crate::vector::VectorStepper;
use numpy::{PyArray1, PyArray2};
use pliant::gradcheck::default_steps;
use pliant::scene::{MOST_STEPS, Scene, Source, control_list, control_rows, parse_source, resting_inputs, warnings};
use pliant::{Case, Model as Engine, ModelBuilder, State, StepOptions, Stepper, equilibrium, start};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// A scene made ready to simulate. Immutable; all arrays are float64 in SI units.
#[pyclass(module = "pliant", frozen)]
pub struct Model {
    model: Arc<Engine>,
    scene: Scene,
}

/// Reads a scene file (TOML).
#[pyfunction]
pub fn load(py: Python<'_>, path: PathBuf) -> PyResult<Model> {
    Model::build(py, &Source::read(&path).map_err(input)?)
}

/// Reads a scene from a text (TOML); errors call it `name`.
#[pyfunction]
#[pyo3(signature = (text, name="scene.toml"))]
pub fn loads(py: Python<'_>, text: &str, name: &str) -> PyResult<Model> {
    Model::build(py, &Source::new(name, text))
}

impl Model {
    pub fn build(py: Python<'_>, source: &Source) -> PyResult<Self> {
        let scene: Scene = parse_source(source).map_err(input)?;
        for warning in warnings(&scene) {
            let text = CString::new(warning.located(source).to_string()).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        let model = ModelBuilder::new(&scene).map_err(|error| input(error.located(source)))?.build();
        Ok(Self { model: Arc::new(model), scene })
    }

    /// Of a scene that is ready to run.
    pub fn from_case(case: &Case) -> Self {
        Self { model: Arc::clone(&case.model), scene: case.scene.clone() }
    }

    pub fn engine(&self) -> &Arc<Engine> {
        &self.model
    }

    /// A whole state, (nx,).
    pub fn state(&self, name: &str, x: &Bound<PyAny>) -> PyResult<State> {
        Ok(State::from_flat(&vector(name, x, self.model.nx())?, self.model.nq(), self.model.nv()))
    }

    /// Rows of `columns` numbers: a pullback at every row of `x` of the row of `bar`, a name and an array (n, `given`).
    fn pulled<'py>(
        &self,
        py: Python<'py>,
        (name, bar): (&str, &Bound<'py, PyAny>),
        x: &Bound<'py, PyAny>,
        given: usize,
        columns: usize,
        pull: fn(&Engine, &State, &[f64]) -> Vec<f64>,
    ) -> PyResult<Matrix<'py>> {
        let x = matrix("x", x, None, self.model.nx())?;
        let bar = matrix(name, bar, Some(x.len()), given)?;
        let state = |x: &[f64]| State::from_flat(x, self.model.nq(), self.model.nv());
        let rows = x.iter().zip(&bar).flat_map(|(x, bar)| pull(&self.model, &state(x), bar)).collect();
        to_matrix(py, rows, columns, x.len())
    }

    /// The scene's parameters where none are given.
    pub fn theta_or_default(&self, theta: Option<&Bound<PyAny>>) -> PyResult<Vec<f64>> {
        let theta = optional_vector("theta", theta, self.model.n_params())?;
        Ok(theta.unwrap_or_else(|| self.model.params().values().to_vec()))
    }

    /// As the scene says: its initial shape, or the equilibrium with the grippers where they begin.
    pub fn start(&self, theta: &[f64]) -> PyResult<State> {
        let u = resting_inputs(&self.scene).map_err(input)?;
        start(&self.model, theta, &u).map_err(errors::step)
    }

    pub fn rows(&self, n_steps: Option<usize>) -> PyResult<Vec<Vec<f64>>> {
        control_rows(&self.scene, n_steps.unwrap_or_else(|| self.scene.time.n_steps())).map_err(input)
    }

    fn index(&self, path: &str) -> PyResult<usize> {
        let params = self.model.params();
        params.find(path).ok_or_else(|| {
            let nearest = params.nearest(path).map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            input(format!("there is no parameter `{path}`{nearest}"))
        })
    }
}

#[pymethods]
impl Model {
    /// Number of nodes, ghosts included.
    #[getter]
    fn n_nodes(&self) -> usize {
        self.model.n_nodes()
    }

    /// Size of the state x = [q, v, z]: node positions and joint coordinates (a quaternion for a ball), then as many velocities, then
    /// history variables (see memory_names).
    #[getter]
    fn nx(&self) -> usize {
        self.model.nx()
    }

    /// Size of a change of state, [dq, dv, dz]: that of tangents, cotangents and Jacobians. As nx, but with three numbers instead of a
    /// ball's quaternion: a turn in its body's axes \[rad\].
    #[getter]
    fn ndx(&self) -> usize {
        self.model.ndx()
    }

    /// Names of the entries of v that belong to joints: the joint's, with `[k]` for the parts of a ball.
    #[getter]
    fn dof_names(&self) -> Vec<String> {
        let names = |j: &pliant::Joint| match j.kind.n_dofs() {
            1 => vec![j.name.clone()],
            n => (0..n).map(|k| format!("{}[{k}]", j.name)).collect(),
        };
        self.model.tree().joints().iter().flat_map(names).collect()
    }

    /// Names of the entries of z: "elbow.plastic", "elbow.load", "rod.node[i].creep[k]", "rod.node[i].friction[k]", "motor.target", "motor.command[k]", "motor.lagged".
    #[getter]
    fn memory_names(&self) -> Vec<String> {
        self.model.memory_names()
    }

    /// Number of inputs.
    #[getter]
    fn nu(&self) -> usize {
        self.model.nu()
    }

    /// Number of parameters.
    #[getter]
    fn n_params(&self) -> usize {
        self.model.n_params()
    }

    /// Step length [s].
    #[getter]
    fn step_length(&self) -> f64 {
        self.model.step_length()
    }

    /// Rest gap of the scene's contact [m].
    #[getter]
    fn rest_gap(&self) -> f64 {
        self.scene.contact.rest_gap
    }

    /// Names of the parameters, in the order of theta.
    #[getter]
    fn param_paths(&self) -> Vec<String> {
        self.model.params().infos().iter().map(|i| i.path.clone()).collect()
    }

    /// SI units of the parameters.
    #[getter]
    fn param_units(&self) -> Vec<&'static str> {
        self.model.params().infos().iter().map(|i| i.unit).collect()
    }

    /// Physical bounds of the parameters, (n_params, 2).
    #[getter]
    fn param_bounds<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let flat = self.model.params().infos().iter().flat_map(|i| [i.lower, i.upper]).collect();
        to_matrix(py, flat, 2, self.model.n_params())
    }

    /// The scene's parameters, (n_params,).
    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.model.params().values().to_vec())
    }

    /// Names of the inputs, e.g. `left.node[0].x`.
    #[getter]
    fn control_names(&self) -> Vec<String> {
        control_list(&self.scene).into_iter().map(|c| c.name).collect()
    }

    /// Units of the inputs.
    #[getter]
    fn control_units(&self) -> Vec<&'static str> {
        control_list(&self.scene).into_iter().map(|c| c.unit).collect()
    }

    /// Nodes of every rope, ghosts left out: name -> slice.
    #[getter]
    fn ropes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for rope in self.model.ropes() {
            dict.set_item(&rope.name, PySlice::new(py, rope.nodes.start as isize, rope.nodes.end as isize, 1))?;
        }
        Ok(dict)
    }

    /// Nodes of every sheet of cloth: name -> slice.
    #[getter]
    fn cloths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for cloth in self.model.cloths() {
            dict.set_item(&cloth.name, PySlice::new(py, cloth.nodes.start as isize, cloth.nodes.end as isize, 1))?;
        }
        Ok(dict)
    }

    /// Triangles of every sheet of cloth, by its own nodes counted from 0: name -> (n, 3) int64.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for cloth in self.model.cloths() {
            let rows: Vec<Vec<i64>> = cloth.triangles.iter().map(|t| t.iter().map(|i| *i as i64).collect()).collect();
            dict.set_item(&cloth.name, PyArray2::from_vec2(py, &rows).map_err(|e| input(e.to_string()))?)?;
        }
        Ok(dict)
    }

    /// Index of a parameter in theta.
    fn param_index(&self, path: &str) -> PyResult<usize> {
        self.index(path)
    }

    /// The scene's parameters with some replaced: {path: value in SI units} -> (n_params,).
    fn theta_with<'py>(&self, py: Python<'py>, values: &Bound<'py, PyDict>) -> PyResult<Vector<'py>> {
        let mut theta = self.model.params().values().to_vec();
        for (path, value) in values.iter() {
            theta[self.index(&path.extract::<String>()?)?] = value.extract()?;
        }
        Ok(to_vector(py, theta))
    }

    /// The state the scene starts from, (nx,); an equilibrium if it says so.
    #[pyo3(signature = (theta=None))]
    fn initial_state<'py>(&self, py: Python<'py>, theta: Option<&Bound<'py, PyAny>>) -> PyResult<Vector<'py>> {
        let theta = self.theta_or_default(theta)?;
        Ok(to_vector(py, py.detach(|| self.start(&theta))?.to_flat()))
    }

    /// Inputs of the scene's gripper motions, (n_steps, nu); row k belongs to step k, positions at its end.
    #[pyo3(signature = (n_steps=None))]
    fn controls<'py>(&self, py: Python<'py>, n_steps: Option<i64>) -> PyResult<Matrix<'py>> {
        let refused = |n: i64| input(format!("n_steps is {n}, but must be from 0 to {MOST_STEPS}"));
        let checked = |n: i64| usize::try_from(n).ok().filter(|n| *n <= MOST_STEPS).ok_or_else(|| refused(n));
        let n_steps = n_steps.map(checked).transpose()?;
        rows_to_matrix(py, &self.rows(n_steps)?, self.model.nu())
    }

    /// The state (nx,) a change dx (ndx,) away from x (nx,).
    fn displaced<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>, dx: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let dx = vector("dx", dx, self.model.ndx())?;
        Ok(to_vector(py, self.model.displaced(&self.state("x", x)?, &dx).to_flat()))
    }

    /// The change (ndx,) that leads from state a (nx,) to state b (nx,).
    fn difference<'py>(&self, py: Python<'py>, b: &Bound<'py, PyAny>, a: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        Ok(to_vector(py, self.model.difference(&self.state("b", b)?, &self.state("a", a)?)))
    }

    /// Cotangents of changes (n, ndx) from those of the numbers of states x (n, nx): the pullback of `displaced` at dx = 0.
    fn pull_displaced<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>, x_bar: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        self.pulled(py, ("x_bar", x_bar), x, self.model.nx(), self.model.ndx(), Engine::pull_displaced)
    }

    /// Cotangents of the numbers of states x (n, nx) from those of changes (n, ndx): the pullback of `difference` by b at b = a.
    fn pull_difference<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>, dx_bar: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        self.pulled(py, ("dx_bar", dx_bar), x, self.model.ndx(), self.model.nx(), Engine::pull_difference)
    }

    /// First material axes at x (nx,) of all edges that twist, (n_twists, 3).
    fn material_axes<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let x = self.state("x", x)?;
        let axes = self.model.material_axes(&x.q, &x.z);
        to_matrix(py, axes.iter().flat_map(|d| [d.x, d.y, d.z]).collect(), 3, axes.len())
    }

    /// Names of the grippers that grasp, in the order of `held`.
    #[getter]
    fn grasping(&self) -> Vec<String> {
        self.model.grasps().iter().map(|grasp| grasp.name.clone()).collect()
    }

    /// Whether each grasping gripper holds something at x (nx,): bools, in the order of `grasping`.
    fn held<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let x = self.state("x", x)?;
        Ok(PyArray1::from_iter(py, self.model.grasps().iter().map(|grasp| grasp.held(&x.z).is_some())))
    }

    /// The point nearest to a grasping gripper at x (nx,) of what it may seize; see the stubs.
    fn reach<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>, gripper: &str) -> PyResult<Bound<'py, PyDict>> {
        let x = self.state("x", x)?;
        let grasp = self.model.grasps().iter().find(|grasp| grasp.name == gripper);
        let known = || self.grasping().join(", ");
        let grasp =
            grasp.ok_or_else(|| input(format!("no gripper named \"{gripper}\" grasps: those that do are {}", known())))?;
        let reach = grasp.reach(&x.q).ok_or_else(|| input(format!("there is nothing that \"{gripper}\" could seize")))?;
        let mut slope = vec![0.0; self.model.ndx()];
        reach.visit_distance(|k, by| slope[k] += by);
        let dict = PyDict::new(py);
        dict.set_item("distance", reach.distance)?;
        dict.set_item("distance_by_x", to_vector(py, slope))?;
        dict.set_item("point", to_vector(py, reach.point.as_slice().to_vec()))?;
        dict.set_item("nodes", reach.weights().map(|(node, _)| node).collect::<Vec<_>>())?;
        dict.set_item("weights", to_vector(py, reach.weights().map(|(_, w)| w).collect()))?;
        Ok(dict)
    }

    /// Masses of all nodes [kg], (n_nodes,); ghosts have none.
    #[pyo3(signature = (theta=None))]
    fn masses<'py>(&self, py: Python<'py>, theta: Option<&Bound<'py, PyAny>>) -> PyResult<Vector<'py>> {
        Ok(to_vector(py, self.model.masses(&self.theta_or_default(theta)?)))
    }

    /// Names of the bodies, in the order of `body_poses`.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.model.tree().bodies().iter().map(|b| b.name.clone()).collect()
    }

    /// Origins [m] and unit quaternions (w, x, y, z) of all bodies in the world at q (nq,): (n_bodies, 3) and (n_bodies, 4).
    fn body_poses<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let poses = self.model.body_poses(&vector("q", q, self.model.nq())?);
        let positions = poses.iter().flat_map(|(p, _)| [p[0], p[1], p[2]]).collect();
        let quaternions = poses.iter().flat_map(|(_, q)| *q).collect();
        Ok((to_matrix(py, positions, 3, poses.len())?, to_matrix(py, quaternions, 4, poses.len())?))
    }

    /// Mass matrix of the bodies' degrees of freedom at q (nq,), armatures included: (n, n) [kg·m², kg·m or kg].
    #[pyo3(signature = (q, theta=None))]
    fn mass_matrix<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Matrix<'py>> {
        let theta = self.theta_or_default(theta)?;
        let m = self.model.mass_matrix(&vector("q", q, self.model.nq())?, &theta);
        let n = self.model.tree().nv();
        to_matrix(py, m, n, n)
    }

    /// Coriolis forces less weight at q (nq,), v (nv,), by degree of freedom of the bodies: (n,) [N·m or N].
    #[pyo3(signature = (q, v, theta=None))]
    fn bias_forces<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let theta = self.theta_or_default(theta)?;
        let (q, v) = (vector("q", q, self.model.nq())?, vector("v", v, self.model.nv())?);
        Ok(to_vector(py, self.model.bias_forces(&q, &v, &theta)))
    }

    /// One step without records: x (nx,), u (nu,) -> x_next (nx,).
    #[pyo3(signature = (x, u, theta=None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        u: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let mut state = self.state("x", x)?;
        let u = vector("u", u, self.model.nu())?;
        let theta = self.theta_or_default(theta)?;
        let options = StepOptions { record: false, ..StepOptions::default() };
        py.detach(|| Stepper::new(&self.model, &theta, options)?.step(&mut state, &u)).map_err(errors::step)?;
        Ok(to_vector(py, state.to_flat()))
    }

    /// `n` copies that are stepped together, each with its own state, parameters and warm start.
    #[pyo3(signature = (n=1, thetas=None, *, x0s=None, threads=None))]
    fn stepper<'py>(
        this: Bound<'py, Self>,
        n: isize,
        thetas: Option<&Bound<'py, PyAny>>,
        x0s: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
    ) -> PyResult<VectorStepper> {
        VectorStepper::new(this, n, thetas, x0s, threads)
    }

    /// Simulates from x0 (nx,) through u (T, nu). See the stubs for the options.
    #[pyo3(signature = (x0, u, theta=None, *, record=true, max_records=None, rest_gap=None, states="smooth", grasp="hard"))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        x0: &Bound<'py, PyAny>,
        u: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        record: bool,
        max_records: Option<usize>,
        rest_gap: Option<f64>,
        states: &str,
        grasp: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let x0 = vector("x0", x0, self.model.nx())?;
        let u = matrix("u", u, None, self.model.nu())?;
        let theta = self.theta_or_default(theta)?;
        let keep = Keep::new(&self.model, record, max_records, [states, grasp], rest_gap)?;
        let kept = py.detach(|| keep.run(&self.model, &theta, &x0, &u))?;
        wrap(py, Arc::new(kept))
    }

    /// Simulates many at once: x0s (batch, nx), us (batch, T, nu) or (T, nu), thetas (batch, n_params) or (n_params,).
    #[pyo3(signature = (x0s, us, thetas=None, *, threads=None, record=true, max_records=None, rest_gap=None, states="smooth", grasp="hard"))]
    #[allow(clippy::too_many_arguments)] // keyword arguments
    fn rollout_batch<'py>(
        &self,
        py: Python<'py>,
        x0s: &Bound<'py, PyAny>,
        us: &Bound<'py, PyAny>,
        thetas: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
        record: bool,
        max_records: Option<usize>,
        rest_gap: Option<f64>,
        states: &str,
        grasp: &str,
    ) -> PyResult<Batch> {
        let keep = Keep::new(&self.model, record, max_records, [states, grasp], rest_gap)?;
        Job::read(&self.model, x0s, us, thetas, keep)?.run(py, threads)
    }

    /// Static equilibrium with inputs u (nu,); `guess` (nq,) or, of the nodes alone, (n_nodes, 3) [m], else the scene's initial shape.
    #[pyo3(signature = (u, theta=None, guess=None))]
    fn equilibrium<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        guess: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Equilibrium> {
        let u = vector("u", u, self.model.nu())?;
        let theta = self.theta_or_default(theta)?;
        let guess = match guess {
            Some(guess) => positions("guess", guess, self.model.n_nodes(), self.model.initial_positions())?,
            None => self.model.initial_positions().to_vec(),
        };
        let inner = py.detach(|| equilibrium(&self.model, &theta, &guess, &u)).map_err(errors::step)?;
        Ok(Equilibrium { inner })
    }

    /// Checks the derivatives of the rollout from x0 through u block by block against finite differences; a dict (see the stubs).
    #[pyo3(signature = (x0=None, u=None, theta=None, *, seed=0))]
    fn gradcheck<'py>(
        &self,
        py: Python<'py>,
        x0: Option<&Bound<'py, PyAny>>,
        u: Option<&Bound<'py, PyAny>>,
        theta: Option<&Bound<'py, PyAny>>,
        seed: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let theta = self.theta_or_default(theta)?;
        let x0 = match x0 {
            Some(x0) => self.state("x0", x0)?,
            None => py.detach(|| self.start(&theta))?,
        };
        let first = |mut rows: Vec<Vec<f64>>| {
            rows.truncate(default_steps(&self.model));
            rows
        };
        let u = u.map_or_else(|| self.rows(None).map(first), |u| matrix("u", u, None, self.model.nu()))?;
        crate::gradcheck::gradcheck(py, &self.model, &theta, &x0, &u, seed)
    }

    fn __repr__(&self) -> String {
        let (n, nu, np) = (self.model.n_nodes(), self.model.nu(), self.model.n_params());
        format!("<pliant.Model: {n} nodes, {nu} inputs, {np} parameters>")
    }
}
