//! A configuration at rest and its derivatives.

use crate::convert::{optional_vector, to_vector, vector};
use crate::errors;
use numpy::PyArray1;
use pliant::{equilibrium_jvp, equilibrium_vjp};
use pyo3::prelude::*;

type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// A static equilibrium: positions `q` (nq,) [m] where all forces vanish, and its derivatives.
#[pyclass(module = "pliant", frozen)]
pub struct Equilibrium {
    pub inner: pliant::Equilibrium,
}

#[pymethods]
impl Equilibrium {
    /// Positions [m], (nq,), ghosts included.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.inner.q.clone())
    }

    /// The state at rest there, (nx,).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_vector(py, self.inner.state().to_flat())
    }

    /// Newton iterations it took.
    #[getter]
    fn iterations(&self) -> usize {
        self.inner.work.iterations
    }

    /// Tangent of q (nq,) along directions of u (nu,) and theta (n_params,); None is zero.
    #[pyo3(signature = (u_dot=None, theta_dot=None))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        u_dot: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let model = &self.inner.model;
        let u_dot = optional_vector("u_dot", u_dot, model.nu())?;
        let theta_dot = optional_vector("theta_dot", theta_dot, model.n_params())?;
        let q_dot = py.detach(|| equilibrium_jvp(&self.inner, u_dot.as_deref(), theta_dot.as_deref()));
        Ok(to_vector(py, q_dot.map_err(errors::adjoint)?))
    }

    /// Cotangents (u_bar (nu,), theta_bar (n_params,)) from q_bar (nq,).
    fn vjp<'py>(&self, py: Python<'py>, q_bar: &Bound<'py, PyAny>) -> PyResult<(Vector<'py>, Vector<'py>)> {
        let q_bar = vector("q_bar", q_bar, self.inner.model.nv())?;
        let (u, theta) = py.detach(|| equilibrium_vjp(&self.inner, &q_bar)).map_err(errors::adjoint)?;
        Ok((to_vector(py, u), to_vector(py, theta)))
    }

    fn __repr__(&self) -> String {
        format!("<pliant.Equilibrium: {} nodes>", self.inner.model.n_nodes())
    }
}
