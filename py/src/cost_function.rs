//! Cost and constraints of a plan as a Python function.

use crate::convert::{matrix, optional_vector, to_vector, vector};
use crate::errors::input;
use crate::model::Model;
use pliant::State;
use pliant::control::problem::{Problem, Rows, Terms};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Keys that a cost function may return.
const KEYS: [&str; 10] = [
    "residuals",
    "residuals_by_x",
    "residuals_by_u",
    "cost",
    "cost_by_x",
    "cost_by_u",
    "constraints",
    "constraints_by_x",
    "constraints_by_u",
    "price",
];

/// Cost and constraints given as a Python function.
pub struct Called {
    evaluate: Py<PyAny>,
    nu: usize,
    ndx: usize,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Called {
    pub fn new(model: &Model, evaluate: Py<PyAny>, bounds: [Option<&Bound<PyAny>>; 2]) -> PyResult<Self> {
        let (nu, ndx) = (model.engine().nu(), model.engine().ndx());
        if Python::attach(|py| !evaluate.bind(py).is_callable()) {
            return Err(input("the cost of a plan must be a function of (k, N, x, u) that returns a dict"));
        }
        let [lower, upper] = bounds;
        let lower = optional_vector("lower", lower, nu)?.unwrap_or_else(|| vec![f64::NEG_INFINITY; nu]);
        let upper = optional_vector("upper", upper, nu)?.unwrap_or_else(|| vec![f64::INFINITY; nu]);
        Ok(Self { evaluate, nu, ndx, lower, upper })
    }

    /// Values and their derivatives from entries of the dict that the function returns.
    fn rows(&self, out: &Bound<PyDict>, name: &str, rows: &mut Rows) -> PyResult<usize> {
        let Some(values) = out.get_item(name)? else { return Ok(0) };
        let n = values.len()?;
        let first = rows.values.len();
        rows.values.extend(vector(name, &values, n)?);
        for (key, columns, from) in [(format!("{name}_by_x"), self.ndx, 0), (format!("{name}_by_u"), self.nu, self.ndx)] {
            let Some(slopes) = out.get_item(&key)? else { continue };
            for (r, row) in matrix(&key, &slopes, Some(n), columns)?.into_iter().enumerate() {
                let nonzero = row.into_iter().enumerate().filter(|(_, value)| *value != 0.0);
                nonzero.for_each(|(c, value)| rows.slope(first + r, from + c, value));
            }
        }
        Ok(n)
    }

    /// A cost that is no sum of squares, and its slopes.
    fn value(&self, out: &Bound<PyDict>, rows: &mut Rows) -> PyResult<()> {
        let Some(cost) = out.get_item("cost")? else { return Ok(()) };
        let row = rows.push(cost.extract().map_err(|_| input("`cost` must be a number"))?);
        for (key, columns, from) in [("cost_by_x", self.ndx, 0), ("cost_by_u", self.nu, self.ndx)] {
            let Some(slopes) = out.get_item(key)? else { continue };
            let nonzero = vector(key, &slopes, columns)?.into_iter().enumerate().filter(|(_, value)| *value != 0.0);
            nonzero.for_each(|(c, value)| rows.slope(row, from + c, value));
        }
        Ok(())
    }

    fn call(&self, py: Python<'_>, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> PyResult<()> {
        let u = u.map(|u| to_vector(py, u.to_vec()));
        let found = self.evaluate.bind(py).call1((k, n, to_vector(py, x.to_flat()), u))?;
        let found = found.cast::<PyDict>().map_err(|_| {
            input("the function of a plan must return a dict with `residuals`, `residuals_by_x`, `residuals_by_u` (or `cost`, `cost_by_x`, `cost_by_u`) and, for constraints, \
                   `constraints`, `constraints_by_x`, `constraints_by_u`, `price`")
        })?;
        for key in found.keys() {
            let key: String = key.extract()?;
            if !KEYS.contains(&key.as_str()) {
                return Err(input(format!(
                    "the function of a plan returned the unknown key `{key}`; known are {}",
                    KEYS.join(", ")
                )));
            }
            let of = key.split("_by_").next().unwrap_or_default();
            if key != "price" && !found.contains(of)? {
                return Err(input(format!("the function of a plan returned `{key}` without `{of}`")));
            }
        }
        self.rows(found, "residuals", &mut out.residuals)?;
        self.value(found, &mut out.values)?;
        let constraints = self.rows(found, "constraints", &mut out.constraints)?;
        let prices = match found.get_item("price")? {
            None => vec![1e3; constraints],
            Some(price) => match price.extract::<f64>() {
                Ok(price) => vec![price; constraints],
                Err(_) => vector("price", &price, constraints)?,
            },
        };
        if let Some(row) = prices.iter().position(|price| price.is_nan() || *price < 0.0) {
            return Err(input(format!("the price of constraint {row} is {}, but must not be negative", prices[row])));
        }
        out.prices.extend(prices);
        Ok(())
    }
}

impl Problem for Called {
    fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        Python::attach(|py| self.call(py, k, n, x, u, out).map_err(|error| error.to_string()))
    }

    fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&self.lower);
        upper.copy_from_slice(&self.upper);
    }
}
