//! Sensors, and estimates of the state from their readings.
//!
//! ```text
//! y_t = C x_t + noise, and whether each grasping gripper holds something     C picks positions of nodes and joints
//! x̂_t from y_0 … y_{t−d} and the inputs sent since: delay d ≥ 0
//! ```
//! [`Estimator`] is the filter of [`crate::observer`] about its own estimate: the model's steps carry states, their Jacobians carry errors.

mod constants;
mod error;
mod estimator;

pub use error::SensingError;
pub use estimator::{Estimate, Estimator};

use constants::SENSING;
use faer::Mat;
use pliant_engine::model::Model;
use pliant_math::State;

/// One number that is read: an entry of q.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Its words, for messages.
    pub name: String,
    /// Its place in q.
    pub q: usize,
    /// Its place in a change of state.
    pub column: usize,
    /// Standard deviation of its noise, in its unit.
    pub noise: f64,
}

impl Output {
    /// The three coordinates of a node, with a noise \[m\].
    pub fn of_node(node: usize, noise: f64) -> [Self; 3] {
        std::array::from_fn(|a| {
            let name = format!("{} of node {node}", ["x", "y", "z"][a]);
            Self { name, q: 3 * node + a, column: 3 * node + a, noise }
        })
    }
}

/// Outputs that are read at every step, and their delay.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensors {
    /// Outputs.
    pub outputs: Vec<Output>,
    /// d: steps from the state to the decision that knows its reading.
    pub delay: usize,
}

impl Sensors {
    /// Numbers of a reading: the outputs, then 1 for each grasping gripper that holds something, else 0.
    pub fn len(&self, model: &Model) -> usize {
        self.outputs.len() + model.grasps().len()
    }

    /// The reading of a state, without noise.
    pub fn read(&self, model: &Model, x: &State) -> Vec<f64> {
        let held = model.grasps().iter().map(|grasp| f64::from(u8::from(grasp.held(&x.z).is_some())));
        self.outputs.iter().map(|output| x.q[output.q]).chain(held).collect()
    }

    /// C of a change of state whose numbers stand at `place`; `usize::MAX`: left out, and so is what reads it.
    pub(crate) fn matrix(&self, place: &[usize], nx: usize) -> Mat<f64> {
        let mut c = Mat::zeros(self.outputs.len(), nx);
        for (row, output) in self.outputs.iter().enumerate().filter(|(_, output)| place[output.column] < nx) {
            c[(row, place[output.column])] = 1.0;
        }
        c
    }

    /// F: the noise as a ball of [`SENSING`]`.deviations` standard deviations.
    pub(crate) fn noise(&self) -> Mat<f64> {
        let n = self.outputs.len();
        Mat::from_fn(n, n, |r, c| if r == c { SENSING.deviations * self.outputs[r].noise } else { 0.0 })
    }
}
