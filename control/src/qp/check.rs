//! Checks of a problem at the door.

use super::{Qp, QpError};
use crate::kernels::not_finite;

impl Qp<'_> {
    /// Number of variables n.
    pub(super) fn n(&self) -> usize {
        self.hessian.nrows()
    }

    /// Number of rows m.
    pub(super) fn m(&self) -> usize {
        self.limits.len()
    }

    /// # Errors
    /// Sizes that do not belong together, numbers that are not finite, negative prices, crossed bounds.
    pub(super) fn check(&self) -> Result<(), QpError> {
        let (n, m) = (self.n(), self.m());
        let sizes = [
            ("hessian", "columns", self.hessian.ncols(), n),
            ("gradient", "entries", self.gradient.len(), n),
            ("lower", "entries", self.lower.len(), n),
            ("upper", "entries", self.upper.len(), n),
            ("rows", "rows", self.rows.nrows(), m),
            ("rows", "columns", self.rows.ncols(), n),
            ("weights", "entries", self.weights.len(), m),
        ];
        if let Some((array, of, found, expected)) = sizes.into_iter().find(|(_, _, found, expected)| found != expected) {
            return Err(QpError::Size { array, of, found, expected });
        }
        let entry = |array, value, (row, column)| QpError::NotFinite { array, row, column, value };
        if let Some(place) = not_finite(self.hessian) {
            return Err(entry("hessian", self.hessian[place], place));
        }
        // along rows, which are contiguous where it matters
        if let Some((column, row)) = not_finite(self.rows.transpose()) {
            return Err(entry("rows", self.rows[(row, column)], (row, column)));
        }
        check_vector("gradient", self.gradient, |_| false)?;
        check_vector("lower", self.lower, |value| value == f64::NEG_INFINITY)?;
        check_vector("upper", self.upper, |value| value == f64::INFINITY)?;
        check_vector("limits", self.limits, |value| value == f64::INFINITY)?;
        check_vector("weights", self.weights, |value| value == f64::INFINITY)?;
        if let Some((row, &weight)) = self.weights.iter().enumerate().find(|(_, weight)| **weight < 0.0) {
            return Err(QpError::NegativeWeight { row, weight });
        }
        match (0..n).find(|&j| self.lower[j] > self.upper[j]) {
            Some(variable) => Err(QpError::CrossedBounds { variable, lower: self.lower[variable], upper: self.upper[variable] }),
            None => Ok(()),
        }
    }
}

fn check_vector(array: &'static str, values: &[f64], infinite: impl Fn(f64) -> bool) -> Result<(), QpError> {
    match values.iter().position(|&value| !value.is_finite() && !infinite(value)) {
        Some(row) => Err(QpError::NotFinite { array, row, column: 0, value: values[row] }),
        None => Ok(()),
    }
}
