//! Many rollouts at once, one task per rollout. Which thread runs which does not show in the results.

use crate::convert::{finite, matrix, n_axes, positive, stack, to_matrix, to_stack};
use crate::errors::input;
use crate::options::{Keep, Trajectory};
use crate::rollout::wrap;
use numpy::{PyArray2, PyArray3};
use pliant::{Model, RolloutCotangent};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::Arc;

type Matrix<'py> = Bound<'py, PyArray2<f64>>;
type Stack<'py> = Bound<'py, PyArray3<f64>>;

/// Rollouts of one model: `x` (batch, T + 1, nx), each with its own start, inputs and parameters.
#[pyclass(module = "pliant", frozen)]
pub struct Batch {
    kept: Vec<Arc<Trajectory>>,
    threads: Option<usize>,
    surrogate: bool,
}

/// The inputs of a batch. `us` and `thetas` have one entry, shared by all, or one per rollout.
pub struct Job {
    pub model: Arc<Model>,
    pub x0s: Vec<Vec<f64>>,
    pub us: Vec<Vec<Vec<f64>>>,
    pub thetas: Vec<Vec<f64>>,
    pub keep: Keep,
}

impl Job {
    /// Reads `x0s` (batch, nx), `us` (batch, T, nu) or (T, nu), `thetas` (batch, n_params) or (n_params,) or None.
    pub fn read(
        model: &Arc<Model>,
        x0s: &Bound<PyAny>,
        us: &Bound<PyAny>,
        thetas: Option<&Bound<PyAny>>,
        keep: Keep,
    ) -> PyResult<Self> {
        let x0s = matrix("x0s", x0s, None, model.nx())?;
        let us = match n_axes("us", us)? {
            2 => vec![matrix("us", us, None, model.nu())?],
            _ => stack("us", us, None, model.nu())?,
        };
        let thetas = match thetas {
            None => vec![model.params().values().to_vec()],
            Some(t) if n_axes("thetas", t)? == 1 => vec![crate::convert::vector("thetas", t, model.n_params())?],
            Some(t) => matrix("thetas", t, None, model.n_params())?,
        };
        for (name, size) in [("us", us.len()), ("thetas", thetas.len())] {
            if size != 1 && size != x0s.len() {
                return Err(input(format!("{name} has {size} entries, but x0s has {}", x0s.len())));
            }
        }
        Ok(Self { model: Arc::clone(model), x0s, us, thetas, keep })
    }

    /// Simulates all; the error is that of the first rollout that fails.
    pub fn run(&self, py: Python<'_>, threads: Option<usize>) -> PyResult<Batch> {
        let one = |b: usize| {
            let u = &self.us[if self.us.len() == 1 { 0 } else { b }];
            let theta = &self.thetas[if self.thetas.len() == 1 { 0 } else { b }];
            self.keep.run(&self.model, theta, &self.x0s[b], u).map(Arc::new)
        };
        let results = py.detach(|| in_parallel(threads, self.x0s.len(), one))?;
        Ok(Batch { kept: first_failure(py, results)?, threads, surrogate: self.keep.smoothing.is_some() })
    }
}

/// Runs `work` on a pool of so many threads; on one per core if their number is not given.
pub fn on_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    match threads {
        None => Ok(work()),
        Some(threads) => {
            positive("threads", threads)?;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(input)?;
            Ok(pool.install(work))
        }
    }
}

/// Runs `task(0) … task(n − 1)`, in order of their numbers in the result.
fn in_parallel<T: Send>(threads: Option<usize>, n: usize, task: impl Fn(usize) -> T + Sync) -> PyResult<Vec<T>> {
    on_threads(threads, || (0..n).into_par_iter().map(&task).collect())
}

fn first_failure<T>(py: Python<'_>, results: Vec<PyResult<T>>) -> PyResult<Vec<T>> {
    let mut out = Vec::with_capacity(results.len());
    for (b, result) in results.into_iter().enumerate() {
        match result {
            Ok(value) => out.push(value),
            Err(error) => {
                error.add_note(py, format!("in rollout {b} of the batch"))?;
                return Err(error);
            }
        }
    }
    Ok(out)
}

#[pymethods]
impl Batch {
    /// States (batch, T + 1, nx): positions [m], velocities [m/s], then history variables.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Stack<'py>> {
        let (rows, columns) = self.kept.first().map_or((0, 0), |k| (k.states().len(), k.model().nx()));
        to_stack(py, self.kept.iter().flat_map(|k| k.flat()).collect(), [self.kept.len(), rows, columns])
    }

    /// Whether the derivatives are those of another rest gap or grasp than the scene's; each rollout says which.
    #[getter]
    fn surrogate(&self) -> bool {
        self.surrogate
    }

    /// Cotangents (x0_bar (batch, nx), u_bar (batch, T, nu), theta_bar (batch, n_params)) from x_bar (batch, T + 1, nx).
    #[pyo3(signature = (x_bar, threads=None))]
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        x_bar: &Bound<'py, PyAny>,
        threads: Option<usize>,
    ) -> PyResult<(Matrix<'py>, Stack<'py>, Matrix<'py>)> {
        let n = self.kept.len();
        let Some(first) = self.kept.first() else { return Err(input("the batch is empty")) };
        let (model, steps) = (first.model(), first.controls().len());
        let x_bar = stack("x_bar", x_bar, Some(steps + 1), model.ndx())?;
        if x_bar.len() != n {
            return Err(input(format!("x_bar has {} entries, but the batch has {n}", x_bar.len())));
        }
        x_bar.iter().enumerate().try_for_each(|(b, rows)| finite(&format!("x_bar[{b}]"), rows.iter().map(Vec::as_slice)))?;
        let results = py.detach(|| in_parallel(threads.or(self.threads), n, |b| self.kept[b].vjp(&x_bar[b])))?;
        let bars: Vec<RolloutCotangent> = first_failure(py, results)?;
        let flat = |part: fn(&RolloutCotangent) -> Vec<f64>| bars.iter().flat_map(part).collect::<Vec<_>>();
        Ok((
            to_matrix(py, flat(|b| b.x0.clone()), model.ndx(), n)?,
            to_stack(py, flat(|b| b.u.concat()), [n, steps, model.nu()])?,
            to_matrix(py, flat(|b| b.theta.clone()), model.n_params(), n)?,
        ))
    }

    fn __len__(&self) -> usize {
        self.kept.len()
    }

    /// The rollout of that number; negative numbers count from the end.
    fn __getitem__<'py>(&self, py: Python<'py>, b: isize) -> PyResult<Bound<'py, PyAny>> {
        let n = self.kept.len();
        let index = if b < 0 { b + n as isize } else { b };
        match usize::try_from(index).ok().and_then(|i| self.kept.get(i)) {
            Some(kept) => wrap(py, Arc::clone(kept)),
            None => Err(pyo3::exceptions::PyIndexError::new_err(format!("there is no rollout {b}: the batch has {n}"))),
        }
    }

    fn __repr__(&self) -> String {
        let kind = if self.surrogate { "surrogate rollouts" } else { "rollouts" };
        format!("<pliant.Batch: {} {kind}>", self.kept.len())
    }
}
