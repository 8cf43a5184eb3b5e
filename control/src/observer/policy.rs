//! Output feedback, executed on measurements.

use faer::Mat;

use super::error::ObserverError;
use super::kalman::{Observer, Sensing};
use crate::linear::{add_applied, apply};
use crate::ocp::Ocp;
use crate::tube::{Gains, TubeError, TubePolicy};

/// The observer, and the policy of the tube on its estimate: no matrix is inverted.
///
/// ```text
/// ν_k = x̂_k − A x̂_{k−1} − B u_{k−1},   δu = P_uf ν
/// ```
/// The policy of a tube on x̂ takes ν for its disturbances, and ν = (1 − M P_xo) w − M P_yo e makes that δu = P_ux w + P_uy e with the
/// composed [`Responses`](super::Responses). O(N nx²) a stage. Measurements late by d steps correct the estimate of their own time; the
/// inputs applied since carry it to the present.
#[derive(Clone, Debug)]
pub struct OutputPolicy {
    policy: TubePolicy,
    a: Vec<Mat<f64>>,
    b: Vec<Mat<f64>>,
    sensing: Sensing,
    gains: Vec<Mat<f64>>,
    x: Vec<Vec<f64>>,
    u: Vec<Vec<f64>>,
    nominal_outputs: Vec<Vec<f64>>,
    /// x̂ − z of the time whose measurement comes next, or came last.
    estimate: Vec<f64>,
    /// u − v of the stages so far.
    inputs: Vec<Vec<f64>>,
}

impl OutputPolicy {
    /// About nominal states and inputs; measurements there are C z.
    ///
    /// # Errors
    /// Sizes.
    pub fn new(
        ocp: &Ocp,
        [x, u]: [&[Vec<f64>]; 2],
        gains: Gains,
        sensing: Sensing,
        observer: &Observer,
    ) -> Result<Self, ObserverError> {
        let policy = TubePolicy::new(ocp, x, u, gains)?;
        let (horizon, rows) = (ocp.stages.len(), sensing.c.len());
        if rows != horizon || observer.gains.len() != horizon {
            let (needed_rows, what) = (horizon, "times of C");
            return Err(TubeError::Size { what, stage: 0, rows, columns: 1, needed_rows, needed_columns: 1 }.into());
        }
        let nominal_outputs = sensing.c.iter().zip(x).map(|(c, x)| apply(c, x)).collect();
        Ok(Self {
            policy,
            a: ocp.stages.iter().map(|stage| stage.a.clone()).collect(),
            b: ocp.stages.iter().map(|stage| stage.b.clone()).collect(),
            gains: observer.gains.clone(),
            sensing,
            x: x.to_vec(),
            u: u.to_vec(),
            nominal_outputs,
            estimate: vec![0.0; ocp.x0.len()],
            inputs: Vec::new(),
        })
    }

    /// Measurements at the nominal states x_0 … x_{N−1}, of a sensor that is not linear.
    #[must_use]
    pub fn with_nominal_outputs(mut self, outputs: Vec<Vec<f64>>) -> Self {
        self.nominal_outputs = outputs;
        self
    }

    /// The input at stage k, for the measurement of x_{k−d}; none at stages before d. Stages in order from 0.
    ///
    /// # Errors
    /// [`ObserverError::Arrival`], order, sizes.
    pub fn control(&mut self, k: usize, measurement: Option<&[f64]>) -> Result<Vec<f64>, ObserverError> {
        let (next, horizon, first) = (self.inputs.len(), self.u.len(), self.sensing.delay);
        if k != next || k >= horizon {
            return Err(TubeError::Order { asked: k, next, horizon }.into());
        }
        let mut time = 0;
        match (measurement, k.checked_sub(first)) {
            (Some(y), Some(measured)) => {
                self.update(measured, y)?;
                time = measured;
            }
            (None, None) => (),
            _ => return Err(ObserverError::Arrival { stage: k, first }),
        }
        let mut now = self.estimate.clone();
        for i in time..k {
            now = self.moved(i, &now);
        }
        let estimate: Vec<f64> = now.iter().zip(&self.x[k]).map(|(deviation, z)| z + deviation).collect();
        let input = self.policy.control(k, &estimate)?;
        self.inputs.push(input.iter().zip(&self.u[k]).map(|(u, v)| u - v).collect());
        Ok(input)
    }

    /// The estimate of time i, from that of the time before, with the measurement of x_i.
    fn update(&mut self, i: usize, y: &[f64]) -> Result<(), ObserverError> {
        let (rows, needed_rows) = (y.len(), self.sensing.c[i].nrows());
        if rows != needed_rows {
            return Err(TubeError::Size { what: "y", stage: i, rows, columns: 1, needed_rows, needed_columns: 1 }.into());
        }
        if i > 0 {
            self.estimate = self.moved(i - 1, &self.estimate);
        }
        let mut innovation: Vec<f64> = y.iter().zip(&self.nominal_outputs[i]).map(|(y, nominal)| y - nominal).collect();
        add_applied(&mut innovation, &self.sensing.c[i], &self.estimate, -1.0);
        add_applied(&mut self.estimate, &self.gains[i], &innovation, -1.0);
        Ok(())
    }

    /// A δx + B δu of stage i.
    fn moved(&self, i: usize, deviation: &[f64]) -> Vec<f64> {
        let mut next = apply(&self.a[i], deviation);
        add_applied(&mut next, &self.b[i], &self.inputs[i], 1.0);
        next
    }

    /// Forgets measurements and inputs: stage 0 is next.
    pub fn reset(&mut self) {
        self.policy.reset();
        self.estimate.fill(0.0);
        self.inputs.clear();
    }
}
