//! A trajectory and its derivatives.

use crate::convert::{
    finite, last_axis, matrix, optional_matrix, optional_vector, positive, rows_to_matrix, stack, to_matrix, to_stack, to_vector,
};
use crate::errors::input;
use crate::options::Trajectory;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pliant::file::write;
use pliant::view::{Caption, Run, is_page, page};
use pliant::{Along, Grasping, Linearization, RolloutCotangent, State, StepTrace};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// A simulated trajectory: states `x` (T + 1, nx), x = [q, v, z], and its derivatives.
#[pyclass(module = "pliant", subclass, frozen)]
pub struct Rollout {
    pub kept: Arc<Trajectory>,
    x: Py<PyArray2<f64>>,
}

/// A rollout whose derivatives are those of another rest gap or grasp than the scene's.
#[pyclass(module = "pliant", extends = Rollout, frozen)]
pub struct SurrogateRollout;

#[pymethods]
impl SurrogateRollout {
    /// Rest gap [m] of the steps that are differentiated.
    #[getter]
    fn rest_gap(this: PyRef<'_, Self>) -> Option<f64> {
        this.as_super().kept.smoothing().map(|s| s.rest_gap)
    }

    /// Grasp of the steps that are differentiated: "hard", the scene's own, or "smooth".
    #[getter]
    fn grasp(this: PyRef<'_, Self>) -> Option<&'static str> {
        this.as_super().kept.smoothing().map(|s| if s.grasp == Grasping::Smooth { "smooth" } else { "hard" })
    }

    /// Whose states `x` are: "smooth", the smoothed rollout's own, or "hard", those of the scene's contact.
    #[getter]
    fn states(this: PyRef<'_, Self>) -> Option<&'static str> {
        this.as_super().kept.smoothing().map(|s| if s.along == Along::Hard { "hard" } else { "smooth" })
    }
}

/// A `Rollout`, or a `SurrogateRollout` if it is not the scene's own contact that is differentiated.
pub fn wrap(py: Python<'_>, kept: Arc<Trajectory>) -> PyResult<Bound<'_, PyAny>> {
    let rows = kept.states().len();
    let x = to_matrix(py, kept.flat(), kept.model().nx(), rows)?.unbind();
    let surrogate = kept.smoothing().is_some();
    let base = Rollout { kept, x };
    if surrogate {
        let init = PyClassInitializer::from(base).add_subclass(SurrogateRollout);
        Ok(Bound::new(py, init)?.into_any())
    } else {
        Ok(Bound::new(py, base)?.into_any())
    }
}

/// Cotangents of (x0, u, theta) as arrays.
pub fn cotangent_arrays<'py>(
    py: Python<'py>,
    bar: RolloutCotangent,
    nu: usize,
) -> PyResult<(Vector<'py>, Matrix<'py>, Vector<'py>)> {
    Ok((to_vector(py, bar.x0), rows_to_matrix(py, &bar.u, nu)?, to_vector(py, bar.theta)))
}

#[pymethods]
impl Rollout {
    /// States x_0 … x_T, (T + 1, nx): positions [m], velocities [m/s], then history variables.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.x.bind(py).clone()
    }

    /// Inputs it was simulated with, (T, nu).
    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows_to_matrix(py, self.kept.controls(), self.kept.model().nu())
    }

    /// Parameters it was simulated with, (n_params,).
    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.kept.theta().to_vec())
    }

    /// Whether the derivatives are those of another rest gap or grasp than the scene's.
    #[getter]
    fn surrogate(&self) -> bool {
        self.kept.smoothing().is_some()
    }

    /// Per step: Newton `iterations`, `factorizations`, residual `evaluations`, `retries` (halvings), the largest correction left where
    /// the residual was rounding before corrections were below the tolerance (`left` [m/s], zero if none), and the energy that it created, at
    /// most (`energy_created` [J]); docs/theory/step.md.
    #[getter]
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let traces = self.kept.traces();
        let dict = PyDict::new(py);
        let column = |value: fn(&StepTrace) -> usize| PyArray1::from_iter(py, traces.iter().map(|t| value(t) as i64));
        dict.set_item("iterations", column(|t| t.work.iterations))?;
        dict.set_item("factorizations", column(|t| t.work.factorizations))?;
        dict.set_item("evaluations", column(|t| t.work.evaluations))?;
        dict.set_item("retries", column(|t| t.retries))?;
        dict.set_item("left", PyArray1::from_iter(py, traces.iter().map(|t| t.work.left)))?;
        dict.set_item("energy_created", PyArray1::from_iter(py, traces.iter().map(|t| t.energy_created)))?;
        Ok(dict)
    }

    /// Total energy of every state [J], (T + 1,).
    fn energy<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let model = self.kept.model();
        let theta = self.kept.theta();
        let total = |x: &State| model.kinetic_energy(&x.q, &x.v, theta) + model.potential_energy(&x.q, &x.z, theta);
        to_vector(py, self.kept.states().iter().map(total).collect())
    }

    /// Tangents (T + 1, nx) of all states along directions of x0 (nx,), u (T, nu), theta (n_params,); None is zero.
    #[pyo3(signature = (x0_dot=None, u_dot=None, theta_dot=None))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        x0_dot: Option<&Bound<'py, PyAny>>,
        u_dot: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Matrix<'py>> {
        let model = self.kept.model();
        let x0_dot = optional_vector("x0_dot", x0_dot, model.ndx())?;
        let u_dot = optional_matrix("u_dot", u_dot, self.kept.controls().len(), model.nu())?;
        let theta_dot = optional_vector("theta_dot", theta_dot, model.n_params())?;
        let rows = py.detach(|| self.kept.jvp(x0_dot.as_deref(), u_dot.as_deref(), theta_dot.as_deref()))?;
        rows_to_matrix(py, &rows, model.ndx())
    }

    /// Cotangents (x0_bar (nx,), u_bar (T, nu), theta_bar (n_params,)) from x_bar (T + 1, nx).
    fn vjp<'py>(&self, py: Python<'py>, x_bar: &Bound<'py, PyAny>) -> PyResult<(Vector<'py>, Matrix<'py>, Vector<'py>)> {
        let model = self.kept.model();
        let x_bar = matrix("x_bar", x_bar, Some(self.kept.states().len()), model.ndx())?;
        finite("x_bar", x_bar.iter().map(Vec::as_slice))?;
        let bar = py.detach(|| self.kept.vjp(&x_bar))?;
        cotangent_arrays(py, bar, model.nu())
    }

    /// Jacobians of step k, x_(k+1) = F(x_k, u_k, theta): A (nx, nx), B (nx, nu), C (nx, n_params). Negative k from the end.
    fn linearize<'py>(&self, py: Python<'py>, k: isize) -> PyResult<(Matrix<'py>, Matrix<'py>, Matrix<'py>)> {
        let (model, steps) = (self.kept.model(), self.kept.controls().len());
        let index = if k < 0 { k + steps as isize } else { k };
        let record = usize::try_from(index).ok().filter(|&i| i < steps);
        let record = record.ok_or_else(|| input(format!("there is no step {k}: the rollout has {steps} steps")))?;
        let Linearization { a, b, c } = py.detach(|| self.kept.linearize(record))?;
        let (nx, nu, np) = (model.ndx(), model.nu(), model.n_params());
        Ok((to_matrix(py, a, nx, nx)?, to_matrix(py, b, nu, nx)?, to_matrix(py, c, np, nx)?))
    }

    /// Jacobians of all steps: A (T, ndx, ndx), B (T, ndx, nu) and, with `theta`, C (T, ndx, n_params); into `out` if it is given.
    #[pyo3(signature = (*, theta=false, out=None))]
    fn jacobians<'py>(
        &self,
        py: Python<'py>,
        theta: bool,
        out: Option<Vec<Bound<'py, PyArray3<f64>>>>,
    ) -> PyResult<Vec<Bound<'py, PyArray3<f64>>>> {
        let (model, steps) = (self.kept.model(), self.kept.controls().len());
        let (nx, nu, np) = (model.ndx(), model.nu(), model.n_params());
        let shapes: Vec<[usize; 3]> = [nx, nu, np].into_iter().take(2 + usize::from(theta)).map(|n| [steps, nx, n]).collect();
        let arrays = out.unwrap_or_else(|| shapes.iter().map(|shape| PyArray3::zeros(py, *shape, false)).collect());
        if arrays.len() != shapes.len() {
            return Err(input(format!(
                "out has {} arrays, but {} are needed: A, B and, with theta=True, C",
                arrays.len(),
                shapes.len()
            )));
        }
        for (k, (array, shape)) in arrays.iter().zip(&shapes).enumerate() {
            if array.shape() != shape || !array.is_c_contiguous() {
                return Err(input(format!(
                    "out[{k}] must be a C-contiguous float64 array of shape {shape:?}; it has {:?}",
                    array.shape()
                )));
            }
        }
        let mut locked = arrays.iter().map(|array| Ok(array.try_readwrite()?)).collect::<PyResult<Vec<_>>>()?;
        let mut slices = locked.iter_mut().map(|array| Ok(array.as_slice_mut()?)).collect::<PyResult<Vec<&mut [f64]>>>()?;
        let mut slices = slices.iter_mut();
        if let (Some(a), Some(b)) = (slices.next(), slices.next()) {
            let c = slices.next();
            py.detach(|| self.kept.jacobians(a, b, c.map(|c| &mut **c)))?;
        }
        drop(locked);
        Ok(arrays)
    }

    /// Tangents (T + 1, ndx, m) of all states along m directions at once: x0_dot (ndx, m), u_dot (T, nu, m), theta_dot (n_params, m).
    #[pyo3(signature = (x0_dot=None, u_dot=None, theta_dot=None))]
    fn jvp_columns<'py>(
        &self,
        py: Python<'py>,
        x0_dot: Option<&Bound<'py, PyAny>>,
        u_dot: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (model, steps) = (self.kept.model(), self.kept.controls().len());
        let given = [("x0_dot", x0_dot, 1), ("u_dot", u_dot, 2), ("theta_dot", theta_dot, 1)];
        let widths = given.into_iter().filter_map(|(name, array, axis)| array.map(|array| last_axis(name, array, axis)));
        let widths = widths.collect::<PyResult<Vec<usize>>>()?;
        let Some(&m) = widths.first() else {
            return Err(input(
                "jvp_columns needs at least one of x0_dot, u_dot and theta_dot, which say how many directions there are",
            ));
        };
        positive("the number of directions", m)?;
        let x0_dot = optional_matrix("x0_dot", x0_dot, model.ndx(), m)?.map(|rows| rows.concat());
        let theta_dot = optional_matrix("theta_dot", theta_dot, model.n_params(), m)?.map(|rows| rows.concat());
        let u_dot = u_dot.map(|u_dot| stack("u_dot", u_dot, Some(model.nu()), m)).transpose()?;
        let u_dot: Option<Vec<Vec<f64>>> = u_dot.map(|steps| steps.into_iter().map(|rows| rows.concat()).collect());
        if let Some(rows) = u_dot.as_ref().filter(|rows| rows.len() != steps) {
            return Err(input(format!("u_dot has {} steps, but the rollout has {steps}", rows.len())));
        }
        let rows = py.detach(|| self.kept.jvp_columns(m, x0_dot.as_deref(), u_dot.as_deref(), theta_dot.as_deref()))?;
        to_stack(py, rows.concat(), [steps + 1, model.ndx(), m])
    }

    /// Writes a page with a 3-D view of the run, one HTML file that needs no network; returns a note on omitted states, or None.
    #[pyo3(signature = (path, *, title=None))]
    fn view(&self, py: Python<'_>, path: PathBuf, title: Option<String>) -> PyResult<Option<String>> {
        if !is_page(&path) {
            return Err(input(format!("{} does not end in .html, which a page is", path.display())));
        }
        let stem = || path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let caption = Caption { title: title.unwrap_or_else(stem), ..Caption::default() };
        let run = Run { model: self.kept.model(), theta: self.kept.theta(), states: self.kept.states() };
        let made = py.detach(|| page(run, &caption)).map_err(input)?;
        py.detach(|| write(&path, |out| out.write_all(made.html.as_bytes())))?;
        Ok(made.left_out())
    }

    fn __len__(&self) -> usize {
        self.kept.controls().len()
    }

    fn __repr__(&self) -> String {
        let kind = if self.surrogate() { "SurrogateRollout" } else { "Rollout" };
        format!("<pliant.{kind}: {} steps, {} nodes>", self.kept.controls().len(), self.kept.model().n_nodes())
    }
}
