//! NumPy arrays to the engine's vectors and back. Shapes are checked here, once.

use crate::errors::input;
use numpy::ndarray::Axis;
use numpy::{AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayLikeDyn, PyArrayMethods};
use pyo3::prelude::*;

/// Rows of a matrix.
pub type Rows = Vec<Vec<f64>>;
type Optional<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

fn array<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    value.extract().map_err(|error: PyErr| input(format!("{name} is not an array of numbers: {}", error.value(value.py()))))
}

fn shape_error(name: &str, got: &[usize], wanted: &str) -> PyErr {
    input(format!("{name} has shape {}, but {wanted} is needed", shape_text(got)))
}

fn shape_text(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// A vector of `n` numbers.
pub fn vector(name: &str, value: &Bound<PyAny>, n: usize) -> PyResult<Vec<f64>> {
    let array = array(name, value)?;
    let view = array.as_array();
    if view.shape() != [n] {
        return Err(shape_error(name, view.shape(), &shape_text(&[n])));
    }
    Ok(view.iter().copied().collect())
}

/// Refuses NaN and infinity in a gradient: all that comes of it would be NaN.
pub fn finite<'a>(name: &str, rows: impl IntoIterator<Item = &'a [f64]>) -> PyResult<()> {
    for (r, row) in rows.into_iter().enumerate() {
        if let Some(c) = row.iter().position(|x| !x.is_finite()) {
            return Err(input(format!("{name}[{r}, {c}] is {}, but must be finite", row[c])));
        }
    }
    Ok(())
}

/// A vector of `n` numbers, if it is given.
pub fn optional_vector(name: &str, value: Optional, n: usize) -> PyResult<Option<Vec<f64>>> {
    value.map(|value| vector(name, value, n)).transpose()
}

/// Coordinates: all of them, or of the nodes alone, (n, 3), the others as in `start`.
pub fn positions(name: &str, value: &Bound<PyAny>, n: usize, start: &[f64]) -> PyResult<Vec<f64>> {
    let array = array(name, value)?;
    let view = array.as_array();
    let whole = view.shape() == [start.len()];
    if !whole && view.shape() != [3 * n] && view.shape() != [n, 3] {
        return Err(shape_error(name, view.shape(), &format!("({},) or ({n}, 3)", start.len())));
    }
    let rest = if whole { &[][..] } else { &start[3 * n..] };
    Ok(view.iter().chain(rest).copied().collect())
}

/// A matrix of `columns` columns; of `rows` rows, if their number is known.
pub fn matrix(name: &str, value: &Bound<PyAny>, rows: Option<usize>, columns: usize) -> PyResult<Rows> {
    let array = array(name, value)?;
    let view = array.as_array();
    match view.shape() {
        [r, c] if *c == columns && rows.is_none_or(|rows| rows == *r) => {}
        shape => {
            let rows = rows.map_or("any".to_owned(), |rows| rows.to_string());
            return Err(shape_error(name, shape, &format!("({rows}, {columns})")));
        }
    }
    Ok((0..view.shape()[0]).map(|r| view.index_axis(Axis(0), r).iter().copied().collect()).collect())
}

/// A row of `columns` numbers for each of `n`, or one that all share: row-major, (n, columns).
pub fn rows_or_shared(name: &str, value: &Bound<PyAny>, n: usize, columns: usize) -> PyResult<Vec<f64>> {
    let array = array(name, value)?;
    let view = array.as_array();
    match view.shape() {
        [rows, c] if (*rows, *c) == (n, columns) => Ok(view.iter().copied().collect()),
        [c] if *c == columns => Ok(view.iter().copied().collect::<Vec<f64>>().repeat(n)),
        shape => Err(shape_error(name, shape, &format!("({n}, {columns}) or, shared by all, ({columns},)"))),
    }
}

/// A matrix of that shape, if it is given.
pub fn optional_matrix(name: &str, value: Optional, rows: usize, columns: usize) -> PyResult<Option<Rows>> {
    value.map(|value| matrix(name, value, Some(rows), columns)).transpose()
}

/// A stack of matrices of `columns` columns: `(batch, rows, columns)`, each of the same number of rows.
pub fn stack(name: &str, value: &Bound<PyAny>, rows: Option<usize>, columns: usize) -> PyResult<Vec<Rows>> {
    let array = array(name, value)?;
    let view = array.as_array();
    match view.shape() {
        [_, r, c] if *c == columns && rows.is_none_or(|rows| rows == *r) => {}
        shape => {
            let rows = rows.map_or("any".to_owned(), |rows| rows.to_string());
            return Err(shape_error(name, shape, &format!("(batch, {rows}, {columns})")));
        }
    }
    let row = |b: usize, r: usize| view.index_axis(Axis(0), b).index_axis(Axis(0), r).iter().copied().collect();
    Ok((0..view.shape()[0]).map(|b| (0..view.shape()[1]).map(|r| row(b, r)).collect()).collect())
}

/// Size of the last of an array's axes, which is axis `axis`.
pub fn last_axis(name: &str, value: &Bound<PyAny>, axis: usize) -> PyResult<usize> {
    let array = array(name, value)?;
    let shape = array.as_array().shape().to_vec();
    let last = shape.get(axis).copied().filter(|_| shape.len() == axis + 1);
    last.ok_or_else(|| input(format!("{name} has shape {}, but {} axes are needed", shape_text(&shape), axis + 1)))
}

/// Refuses zero.
pub fn positive(name: &str, number: usize) -> PyResult<()> {
    if number == 0 { Err(input(format!("{name} is 0, but at least one is needed"))) } else { Ok(()) }
}

/// Number of axes of an array.
pub fn n_axes(name: &str, value: &Bound<PyAny>) -> PyResult<usize> {
    Ok(array(name, value)?.as_array().ndim())
}

/// A one-dimensional array.
pub fn to_vector(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    values.into_pyarray(py)
}

/// A two-dimensional array from row-major numbers.
pub fn to_matrix(py: Python<'_>, flat: Vec<f64>, columns: usize, rows: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    flat.into_pyarray(py).reshape([rows, columns])
}

/// A two-dimensional array from its rows.
pub fn rows_to_matrix<'py>(py: Python<'py>, rows: &[Vec<f64>], columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    to_matrix(py, rows.concat(), columns, rows.len())
}

/// A three-dimensional array from row-major numbers.
pub fn to_stack(py: Python<'_>, flat: Vec<f64>, shape: [usize; 3]) -> PyResult<Bound<'_, PyArray3<f64>>> {
    flat.into_pyarray(py).reshape(shape)
}
