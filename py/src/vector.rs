//! Many copies of one model that are stepped together.

use crate::convert::{optional_vector, positive, rows_or_shared, to_matrix, to_vector, vector};
use crate::errors::{self, input};
use crate::model::Model;
use numpy::{PyArray1, PyArray2};
use pliant::{Differentiate, Linearization, ModelCopy, Rollout, State, VectorError, VectorStepper as Engine};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Copies of one model that are stepped together; made by `Model.stepper`.
#[pyclass(module = "pliant", frozen)]
pub struct VectorStepper {
    /// Threads that call at the same time take turns.
    inner: Mutex<Engine>,
    /// Number of copies.
    n: usize,
    model: Py<Model>,
    /// Its own threads, if their number was given.
    pool: Option<Arc<ThreadPool>>,
}

impl VectorStepper {
    /// `n` copies; `thetas` and `x0s` have one row for each, or one for all.
    pub fn new(
        model: Bound<'_, Model>,
        n: isize,
        thetas: Option<&Bound<PyAny>>,
        x0s: Option<&Bound<PyAny>>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let n = usize::try_from(n).map_err(|_| input(format!("n is {n}, but must be at least 1")))?;
        let (py, scene) = (model.py(), model.get());
        let engine = scene.engine();
        let thetas = thetas.map(|thetas| rows_or_shared("thetas", thetas, n, engine.n_params())).transpose()?;
        let x0s = x0s.map(|x0s| rows_or_shared("x0s", x0s, n, engine.nx())).transpose()?;
        let pool = threads.map(pool).transpose()?;
        let inner = py.detach(|| {
            let mut inner = Engine::new(engine, n).map_err(errors::vector)?;
            let theta_of = |k: usize| thetas.as_ref().map(|flat| &flat[k * engine.n_params()..(k + 1) * engine.n_params()]);
            // an equilibrium to start from is solved once where all have the same parameters
            let shared = if x0s.is_none() && thetas.is_none() { Some(scene.start(engine.params().values())?) } else { None };
            for k in 0..n {
                if let Some(theta) = theta_of(k) {
                    inner.set_theta(k, theta).map_err(errors::vector)?;
                }
                match (&x0s, &shared) {
                    (Some(x0s), _) => inner.reset(k, &state(engine, &x0s[k * engine.nx()..(k + 1) * engine.nx()])),
                    (None, Some(start)) => inner.reset(k, start),
                    (None, None) => inner.reset(k, &scene.start(theta_of(k).unwrap_or_default())?),
                }
                .map_err(errors::vector)?;
            }
            PyResult::Ok(inner)
        })?;
        Ok(Self { inner: Mutex::new(inner), n, model: model.unbind(), pool })
    }

    fn engine(&self) -> &Arc<pliant::Model> {
        self.model.get().engine()
    }

    /// Waits without the interpreter's lock until no other thread steps.
    fn lock(&self, py: Python<'_>) -> MutexGuard<'_, Engine> {
        self.inner.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of a copy; negative ones count from the end.
    fn number(&self, i: isize) -> PyResult<usize> {
        let n = self.n;
        let index = if i < 0 { i + n as isize } else { i };
        let number = usize::try_from(index).ok().filter(|k| *k < n);
        number.ok_or_else(|| PyIndexError::new_err(format!("there is no copy {i}: there are {n}, counted from 0")))
    }

    fn record(&self, py: Python<'_>, i: isize) -> PyResult<Arc<Rollout>> {
        let copy = self.number(i)?;
        match self.lock(py).record(copy) {
            Ok(record) => Ok(Arc::clone(record)),
            Err(VectorError::NoRecord { copy }) => Err(input(format!(
                "copy {copy} has no record of a last step, which derivatives need: call step(u, record=True), and differentiate before the \
                 copy is reset or gets other parameters"
            ))),
            Err(error) => Err(errors::vector(error)),
        }
    }
}

fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    positive("threads", threads)?;
    Ok(Arc::new(ThreadPoolBuilder::new().num_threads(threads).build().map_err(input)?))
}

fn state(model: &pliant::Model, x: &[f64]) -> State {
    State::from_flat(x, model.nq(), model.nv())
}

/// States of all copies, row-major, (n, nx).
fn states(inner: &Engine) -> Vec<f64> {
    let mut flat = Vec::with_capacity(inner.len() * inner.model().nx());
    for State { q, v, z } in inner.copies().iter().map(ModelCopy::state) {
        [q, v, z].into_iter().for_each(|part| flat.extend_from_slice(part));
    }
    flat
}

#[pymethods]
impl VectorStepper {
    /// Takes a step of every copy that has not failed: u (n, nu), or (nu,) for all -> x (n, nx).
    #[pyo3(signature = (u, *, record=false))]
    fn step<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>, record: bool) -> PyResult<Matrix<'py>> {
        let n = self.n;
        let u = rows_or_shared("u", u, n, self.engine().nu())?;
        let flat = py.detach(|| {
            let mut guard = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let inner = &mut *guard;
            // to hand a single copy to other threads takes as long as its step
            match self.pool.as_ref().filter(|_| n > 1) {
                Some(pool) => pool.install(|| inner.step(&u, record)),
                None => inner.step(&u, record),
            }?;
            Ok(states(inner))
        });
        to_matrix(py, flat.map_err(errors::vector)?, self.engine().nx(), n)
    }

    /// States of all copies, (n, nx).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let flat = states(&self.lock(py));
        to_matrix(py, flat, self.engine().nx(), self.n)
    }

    /// Time of every copy since it was made or reset [s], (n,).
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.lock(py).copies().iter().map(ModelCopy::time).collect())
    }

    /// Parameters of all copies, (n, n_params).
    #[getter]
    fn thetas<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let flat = self.lock(py).copies().iter().flat_map(|copy| copy.theta().to_vec()).collect();
        to_matrix(py, flat, self.engine().n_params(), self.n)
    }

    /// The model.
    #[getter]
    fn model(&self, py: Python<'_>) -> Py<Model> {
        self.model.clone_ref(py)
    }

    /// Which copies have failed, (n,) bool.
    #[getter]
    fn failed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.lock(py).copies().iter().map(|copy| copy.failure().is_some()))
    }

    /// Why copies have failed: number -> exception, of those that have.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (k, copy) in self.lock(py).copies().iter().enumerate() {
            if let Some(source) = copy.failure() {
                let error = errors::vector(VectorError::Copy { copy: k, source: source.clone() });
                dict.set_item(k, error.into_value(py))?;
            }
        }
        Ok(dict)
    }

    /// Lets copy i start anew from x (nx,), or as the scene says.
    #[pyo3(signature = (i, x=None))]
    fn reset(&self, py: Python<'_>, i: isize, x: Option<&Bound<PyAny>>) -> PyResult<()> {
        let copy = self.number(i)?;
        let x = match optional_vector("x", x, self.engine().nx())? {
            Some(x) => state(self.engine(), &x),
            None => {
                let theta = self.lock(py).copy(copy).map_err(errors::vector)?.theta().to_vec();
                py.detach(|| self.model.get().start(&theta))?
            }
        };
        self.lock(py).reset(copy, &x).map_err(errors::vector)
    }

    /// Gives copy i parameters theta (n_params,).
    fn set_theta(&self, py: Python<'_>, i: isize, theta: &Bound<PyAny>) -> PyResult<()> {
        let copy = self.number(i)?;
        let theta = vector("theta", theta, self.engine().n_params())?;
        self.lock(py).set_theta(copy, &theta).map_err(errors::vector)
    }

    /// Makes copy `target` the same as copy `source`.
    fn clone_copy(&self, py: Python<'_>, source: isize, target: isize) -> PyResult<()> {
        let (from, to) = (self.number(source)?, self.number(target)?);
        self.lock(py).clone_copy(from, to).map_err(errors::vector)
    }

    /// Another stepper whose copies go on as these do.
    fn clone(&self, py: Python<'_>) -> Self {
        let inner = self.lock(py).clone();
        Self { inner: Mutex::new(inner), n: self.n, model: self.model.clone_ref(py), pool: self.pool.clone() }
    }

    /// Tangent (ndx,) of x after the recorded step of copy i along directions of x before it, u and theta; None is zero.
    #[pyo3(signature = (i, x_dot=None, u_dot=None, theta_dot=None))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        i: isize,
        x_dot: Option<&Bound<'py, PyAny>>,
        u_dot: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let (record, model) = (self.record(py, i)?, self.engine());
        let x_dot = optional_vector("x_dot", x_dot, model.ndx())?;
        let u_dot = optional_vector("u_dot", u_dot, model.nu())?.map(|row| vec![row]);
        let theta_dot = optional_vector("theta_dot", theta_dot, model.n_params())?;
        let rows = py.detach(|| record.jvp(x_dot.as_deref(), u_dot.as_deref(), theta_dot.as_deref())).map_err(errors::adjoint)?;
        Ok(to_vector(py, rows.into_iter().next_back().unwrap_or_default()))
    }

    /// Cotangents (x_bar (ndx,), u_bar (nu,), theta_bar (n_params,)) before the recorded step of copy i from x_bar (ndx,) after it.
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        i: isize,
        x_bar: &Bound<'py, PyAny>,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>)> {
        let (record, ndx) = (self.record(py, i)?, self.engine().ndx());
        let x_bar = vector("x_bar", x_bar, ndx)?;
        if let Some(k) = x_bar.iter().position(|x| !x.is_finite()) {
            return Err(input(format!("x_bar[{k}] is {}, but must be finite", x_bar[k])));
        }
        let bar = py.detach(|| record.vjp(&[vec![0.0; ndx], x_bar])).map_err(errors::adjoint)?;
        Ok((to_vector(py, bar.x0), to_vector(py, bar.u.concat()), to_vector(py, bar.theta)))
    }

    /// Jacobians of the recorded step of copy i: A (ndx, ndx), B (ndx, nu), C (ndx, n_params).
    fn linearize<'py>(&self, py: Python<'py>, i: isize) -> PyResult<(Matrix<'py>, Matrix<'py>, Matrix<'py>)> {
        let (record, model) = (self.record(py, i)?, self.engine());
        let Linearization { a, b, c } = py.detach(|| record.linearize(0)).map_err(errors::adjoint)?;
        let (nx, nu, np) = (model.ndx(), model.nu(), model.n_params());
        Ok((to_matrix(py, a, nx, nx)?, to_matrix(py, b, nu, nx)?, to_matrix(py, c, np, nx)?))
    }

    fn __len__(&self) -> usize {
        self.n
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let failed = self.lock(py).copies().iter().filter(|copy| copy.failure().is_some()).count();
        format!("<pliant.VectorStepper: {} copies, {failed} failed>", self.n)
    }
}
