//! The filter, at run time.

use super::constants::SENSING;
use super::{SensingError, Sensors};
use crate::linear::SemidefiniteCholesky;
use crate::observer::{Correction, predict, square};
use faer::Mat;
use pliant_adjoint::{Linearization, Linearizer};
use pliant_engine::grasp::Grasp;
use pliant_engine::model::Model;
use pliant_engine::rollout::{Rollout, rollout};
use pliant_engine::step::StepOptions;
use pliant_math::State;
use std::collections::VecDeque;
use std::sync::Arc;

/// The state from readings that come late, and from the inputs that were sent.
///
/// ```text
/// m = t − d:   x̂_m ← x̂_m ⊕ −M (y_m − C x̂_m),   Σ_m ← Σ⁺                    crate::observer has M and Σ⁺
/// present:     x̂_t = F(… F(x̂_m, u_m) …, u_{t−1})
/// next:        x̂_{m+1} = F(x̂_m, u_m),   Σ_{m+1} = A Σ_m Aᵀ + E Eᵀ
/// ```
/// A gripper that the reading says holds something, and the estimate not, holds the estimate's nearest point from then on; and the other way
/// round it lets go.
pub struct Estimator {
    model: Arc<Model>,
    theta: Vec<f64>,
    sensors: Sensors,
    /// E of a step, in the numbers of a change of state that an estimate is about.
    disturbance: Mat<f64>,
    /// These numbers, and their places: velocities are left out where a step forgets them.
    about: Vec<usize>,
    place: Vec<usize>,
    /// x̂_m and Σ_m.
    x: State,
    shape: Mat<f64>,
    /// Whether the reading of time m is in them.
    corrected: bool,
    /// Inputs sent from time m on.
    inputs: VecDeque<Vec<f64>>,
}

/// An estimate of the present, and what is not known of it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// x̂_t.
    pub x: State,
    /// E of the error of x̂_m: a factor of Σ_m, of as many rows as a change of state has.
    pub error: Mat<f64>,
    /// Jacobians of the steps from m to t, that carry it on.
    pub since: Vec<Linearization>,
    /// Whether the reading of time m is in it, or yet to come.
    pub corrected: bool,
}

impl Estimator {
    /// From the state `x0`, which is known to E_0 = `initial` (of ndx rows, or no columns).
    ///
    /// # Errors
    /// An output that the model does not have, or with a noise that is negative or not finite.
    pub fn new(
        model: &Arc<Model>,
        theta: &[f64],
        sensors: Sensors,
        disturbance: &Mat<f64>,
        initial: &Mat<f64>,
        x0: &State,
    ) -> Result<Self, SensingError> {
        let (nq, nv, ndx) = (model.nq(), model.nv(), model.ndx());
        for (number, output) in sensors.outputs.iter().enumerate() {
            let refuse = |what: String| Err(SensingError::Output { number, name: output.name.clone(), what });
            if output.q >= nq || output.column >= nv {
                return refuse(format!("the model has {nq} positions in {nv} degrees of freedom: name one of them"));
            }
            if !(output.noise.is_finite() && output.noise >= 0.0) {
                return refuse(format!(
                    "its noise is {}, but must be a standard deviation, finite and not negative",
                    output.noise
                ));
            }
        }
        let about: Vec<usize> = (0..ndx).filter(|k| !(model.forgets_velocities() && (nv..2 * nv).contains(k))).collect();
        let mut place = vec![usize::MAX; ndx];
        about.iter().enumerate().for_each(|(k, column)| place[*column] = k);
        let cut = |e: &Mat<f64>| match e.ncols() {
            0 => Mat::zeros(about.len(), 0),
            columns => Mat::from_fn(about.len(), columns, |r, c| e[(about[r], c)]),
        };
        Ok(Self {
            model: Arc::clone(model),
            theta: theta.to_vec(),
            sensors,
            disturbance: cut(disturbance),
            shape: square(&cut(initial)),
            about,
            place,
            x: x0.clone(),
            corrected: false,
            inputs: VecDeque::new(),
        })
    }

    /// The sensors.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Inputs of a step.
    pub(crate) fn inputs_of_a_step(&self) -> usize {
        self.model.nu()
    }

    /// Inputs that are sent for the step that begins now.
    pub fn send(&mut self, u: &[f64]) {
        self.inputs.push_back(u.to_vec());
    }

    /// Other inputs than those that [`Estimator::send`] was told last.
    pub fn resend(&mut self, u: &[f64]) {
        self.inputs.pop_back();
        self.send(u);
    }

    /// The present, with the reading that has come now; `None`: none has.
    ///
    /// # Errors
    /// A reading of another size, or before there can be one; a step that fails.
    pub fn estimate(&mut self, reading: Option<&[f64]>) -> Result<Estimate, SensingError> {
        while self.inputs.len() > self.sensors.delay {
            self.advance()?;
        }
        let due = self.inputs.len() == self.sensors.delay;
        match reading {
            Some(_) if !due => return Err(SensingError::Early { step: self.inputs.len(), delay: self.sensors.delay }),
            Some(reading) if !self.corrected => self.correct(reading)?,
            _ => self.corrected |= due,
        }
        let Rollout { mut states, records, .. } = self.steps(self.inputs.len())?;
        let mut linearizer = Linearizer::new(&self.model, &self.theta, false);
        let since = records.iter().map(|record| linearizer.linearize(record)).collect();
        let factor = SemidefiniteCholesky::new(&self.shape).into_factor();
        let mut error = Mat::zeros(self.place.len(), factor.ncols());
        for (r, &row) in self.about.iter().enumerate() {
            (0..factor.ncols()).for_each(|c| error[(row, c)] = factor[(r, c)]);
        }
        Ok(Estimate { x: states.pop().unwrap_or_else(|| self.x.clone()), error, since, corrected: self.corrected })
    }

    /// Steps from time m with the inputs sent.
    fn steps(&self, count: usize) -> Result<Rollout, SensingError> {
        let controls: Vec<Vec<f64>> = self.inputs.iter().take(count).cloned().collect();
        Ok(rollout(&self.model, &self.theta, &self.x, &controls, StepOptions::default())?)
    }

    /// Time m goes on by a step.
    fn advance(&mut self) -> Result<(), SensingError> {
        let Rollout { mut states, records, .. } = self.steps(1)?;
        let n = self.about.len();
        for record in &records {
            let jacobian = Linearizer::new(&self.model, &self.theta, false).linearize(record);
            let a = Mat::from_fn(n, n, |r, c| jacobian.a[self.about[r] * self.place.len() + self.about[c]]);
            self.shape = predict(&a, &self.shape, &self.disturbance);
        }
        self.x = states.pop().unwrap_or_else(|| self.x.clone());
        self.corrected = false;
        self.inputs.pop_front();
        Ok(())
    }

    /// The estimate of time m with its reading.
    fn correct(&mut self, reading: &[f64]) -> Result<(), SensingError> {
        let (outputs, grasps) = (self.sensors.outputs.len(), self.model.grasps().len());
        if reading.len() != outputs + grasps {
            return Err(SensingError::Size { got: reading.len(), expected: outputs + grasps, outputs, grasps });
        }
        if let Some((number, value)) = reading.iter().enumerate().find(|(_, value)| !value.is_finite()) {
            let of_grasp = |k: usize| format!("whether gripper \"{}\" holds something", self.model.grasps()[k].name);
            let name = self.sensors.outputs.get(number).map_or_else(|| of_grasp(number - outputs), |output| output.name.clone());
            return Err(SensingError::NotFinite { number, name, value: *value });
        }
        let n = self.about.len();
        let Correction { gain, shape, .. } =
            Correction::new(&self.shape, &self.sensors.matrix(&self.place, n), &self.sensors.noise());
        let mut change = vec![0.0; self.place.len()];
        for (k, output) in self.sensors.outputs.iter().enumerate() {
            let innovation = reading[k] - self.x.q[output.q];
            self.about.iter().enumerate().for_each(|(r, row)| change[*row] -= gain[(r, k)] * innovation);
        }
        self.x = self.model.displaced(&self.x, &change);
        self.shape = shape;
        for (grasp, held) in self.model.grasps().iter().zip(&reading[outputs..]) {
            match (*held >= SENSING.holds, grasp.held(&self.x.z).is_some()) {
                (true, false) => {
                    if let Some(reach) = grasp.reach(&self.x.q) {
                        grasp.hold_at_distance(&reach, &mut self.x.z);
                    }
                }
                (false, true) => self.x.z[grasp.memory..grasp.memory + Grasp::n_memory(grasp.corners)].fill(0.0),
                _ => {}
            }
        }
        self.corrected = true;
        Ok(())
    }
}
