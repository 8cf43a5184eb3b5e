//! Checks of a problem at the door.

use super::{Ocp, OcpError, Rows, Stage};
use crate::kernels::not_finite;
use faer::MatRef;

impl Ocp {
    /// Number of states nx.
    pub fn nx(&self) -> usize {
        self.x0.len()
    }

    /// Number of inputs nu of a stage.
    pub fn nu(&self) -> usize {
        self.stages.first().map_or(0, |stage| stage.b.ncols())
    }

    /// Rows of stage k; k = N: those of x_N.
    pub fn rows(&self, k: usize) -> &Rows {
        self.stages.get(k).map_or(&self.rows_final, |stage| &stage.rows)
    }

    /// # Errors
    /// Sizes that do not belong together, numbers that are not finite, negative prices, crossed bounds.
    pub(super) fn check(&self) -> Result<(), OcpError> {
        let (nx, nu, stages) = (self.nx(), self.nu(), self.stages.len());
        if stages == 0 || nu == 0 {
            return Err(OcpError::Empty { stages, inputs: nu });
        }
        vector("x0", 0, &self.x0, nx, |_| false)?;
        for (k, stage) in self.stages.iter().enumerate() {
            stage.check(k, nx, nu)?;
            stage.rows.check(k, nx, nu)?;
        }
        matrix("q_final", stages, self.q_final.as_ref(), (nx, nx))?;
        vector("q_final_linear", stages, &self.q_final_linear, nx, |_| false)?;
        // columns of u, if there are any, have no meaning
        self.rows_final.check(stages, nx, self.rows_final.gu.ncols())
    }
}

impl Stage {
    fn check(&self, k: usize, nx: usize, nu: usize) -> Result<(), OcpError> {
        matrix("a", k, self.a.as_ref(), (nx, nx))?;
        matrix("b", k, self.b.as_ref(), (nx, nu))?;
        vector("d", k, &self.d, nx, |_| false)?;
        matrix("q", k, self.q.as_ref(), (nx, nx))?;
        matrix("s", k, self.s.as_ref(), (nu, nx))?;
        matrix("r", k, self.r.as_ref(), (nu, nu))?;
        vector("q_linear", k, &self.q_linear, nx, |_| false)?;
        vector("r_linear", k, &self.r_linear, nu, |_| false)?;
        vector("lower", k, &self.lower, nu, |value| value == f64::NEG_INFINITY)?;
        vector("upper", k, &self.upper, nu, |value| value == f64::INFINITY)?;
        match (0..nu).find(|&j| self.lower[j] > self.upper[j]) {
            Some(input) => Err(OcpError::CrossedBounds { stage: k, input, lower: self.lower[input], upper: self.upper[input] }),
            None => Ok(()),
        }
    }
}

impl Rows {
    fn check(&self, k: usize, nx: usize, nu: usize) -> Result<(), OcpError> {
        let m = self.len();
        matrix("gx", k, self.gx.as_ref(), (m, nx))?;
        matrix("gu", k, self.gu.as_ref(), (m, nu))?;
        vector("limits", k, &self.limits, m, |value| value == f64::INFINITY)?;
        vector("weights", k, &self.weights, m, |value| value == f64::INFINITY)?;
        match self.weights.iter().position(|weight| *weight < 0.0) {
            Some(row) => Err(OcpError::NegativeWeight { stage: k, row, weight: self.weights[row] }),
            None => Ok(()),
        }
    }
}

fn matrix(array: &'static str, stage: usize, m: MatRef<'_, f64>, expected: (usize, usize)) -> Result<(), OcpError> {
    if m.shape() != expected {
        return Err(OcpError::Size { array, stage, found: m.shape(), expected });
    }
    match not_finite(m) {
        Some((row, column)) => Err(OcpError::NotFinite { array, stage, row, column, value: m[(row, column)] }),
        None => Ok(()),
    }
}

fn vector(
    array: &'static str,
    stage: usize,
    values: &[f64],
    expected: usize,
    infinite: impl Fn(f64) -> bool,
) -> Result<(), OcpError> {
    if values.len() != expected {
        return Err(OcpError::Size { array, stage, found: (values.len(), 1), expected: (expected, 1) });
    }
    match values.iter().position(|&value| !value.is_finite() && !infinite(value)) {
        Some(row) => Err(OcpError::NotFinite { array, stage, row, column: 0, value: values[row] }),
        None => Ok(()),
    }
}
