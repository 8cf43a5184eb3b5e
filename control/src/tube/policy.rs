//! The policy of a tube, executed on measured states.

use faer::Mat;

use super::error::TubeError;
use super::gains::Gains;
use crate::linear::{add_applied, apply};
use crate::ocp::Ocp;

/// u_k = v_k + Σ_{j≤k} Φ_u\[k,j\] ŵ_j, with ŵ_k = x_k − z_k − Σ_{j<k} Φ_x\[k,j\] ŵ_j the state that the disturbance of time k left.
///
/// Responses are normalised (Φ_x\[j,j\] = 1), so that no matrix is inverted, and kept as the vectors Φ_x\[k,j\] ŵ_j, which
/// Φ_x\[k+1,j\] ŵ_j = (A + B K_{k,j}) Φ_x\[k,j\] ŵ_j carries on: O(N nx²) a stage and no Φ in memory. With gains that all columns share it is
/// u = v + K (x − z).
#[derive(Clone, Debug)]
pub struct TubePolicy {
    a: Vec<Mat<f64>>,
    b: Vec<Mat<f64>>,
    x: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
    gains: Gains,
    /// Φ_x\[k,j\] ŵ_j of the times j before the next stage k.
    deviations: Vec<Vec<f64>>,
}

impl TubePolicy {
    /// About the nominal states and inputs x_0 … x_N, u_0 … u_{N−1} of a problem.
    ///
    /// # Errors
    /// [`TubeError::Size`].
    pub fn new(ocp: &Ocp, x: &[Vec<f64>], u: &[Vec<f64>], gains: Gains) -> Result<Self, TubeError> {
        let horizon = ocp.stages.len();
        let sized = |what, rows, needed_rows| {
            let (stage, columns, needed_columns) = (0, 1, 1);
            if rows == needed_rows {
                Ok(())
            } else {
                Err(TubeError::Size { what, stage, rows, columns, needed_rows, needed_columns })
            }
        };
        sized("nominal states", x.len(), horizon + 1)?;
        sized("nominal inputs", u.len(), horizon)?;
        sized("gains", gains.horizon(), horizon)?;
        for (stage, (x, u)) in ocp.stages.iter().zip(x.iter().zip(u)) {
            sized("a nominal state", x.len(), stage.a.nrows())?;
            sized("a nominal input", u.len(), stage.b.ncols())?;
        }
        let a = ocp.stages.iter().map(|stage| stage.a.clone()).collect();
        let b = ocp.stages.iter().map(|stage| stage.b.clone()).collect();
        Ok(Self { a, b, x: x.to_vec(), u: u.to_vec(), gains, deviations: Vec::new() })
    }

    /// The input at stage k, for the measured state; stages in order from 0.
    ///
    /// # Errors
    /// [`TubeError::Order`], [`TubeError::Size`].
    pub fn control(&mut self, k: usize, x: &[f64]) -> Result<Vec<f64>, TubeError> {
        let (next, horizon) = (self.deviations.len(), self.u.len());
        if k != next || k >= horizon {
            return Err(TubeError::Order { asked: k, next, horizon });
        }
        if x.len() != self.x[k].len() {
            let (rows, needed_rows) = (x.len(), self.x[k].len());
            return Err(TubeError::Size { what: "x", stage: k, rows, columns: 1, needed_rows, needed_columns: 1 });
        }
        let mut newest: Vec<f64> = x.iter().zip(&self.x[k]).map(|(x, z)| x - z).collect();
        for deviation in &self.deviations {
            for (newest, explained) in newest.iter_mut().zip(deviation) {
                *newest -= explained;
            }
        }
        self.deviations.push(newest);
        let mut input = self.u[k].clone();
        for (j, deviation) in self.deviations.iter_mut().enumerate() {
            let answer = apply(self.gains.get(k, j), deviation);
            let mut moved = apply(&self.a[k], deviation);
            add_applied(&mut moved, &self.b[k], &answer, 1.0);
            *deviation = moved;
            for (input, answer) in input.iter_mut().zip(&answer) {
                *input += answer;
            }
        }
        Ok(input)
    }

    /// Forgets all states: stage 0 is next.
    pub fn reset(&mut self) {
        self.deviations.clear();
    }
}
