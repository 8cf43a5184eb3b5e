//! Bodies at one instant, and their readings: values, rates and derivatives by the degrees of freedom.

use super::observed::JointPlace;
use super::torque::torque;
use crate::log::JointQuantity;
use nalgebra::{Matrix3, Vector3};
use pliant_engine::bodies::Frames;
use pliant_engine::model::Model;
use pliant_math::rotation::Map;

/// Coordinates, velocities and accelerations of the bodies, and their frames.
#[derive(Clone, Debug)]
pub(super) struct Bodies {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    /// Time derivative of the coordinates: the slope of the blend between two steps.
    slope: Vec<f64>,
    acceleration: Vec<f64>,
    frames: Frames<f64>,
}

/// A vector seen of a body: value, rate, and columns ∂/∂(degree of freedom).
pub(super) struct Seen {
    pub value: Vector3<f64>,
    pub rate: Vector3<f64>,
    pub by: Vec<(usize, Vector3<f64>)>,
}

/// A number seen of a joint; derivatives by (degree of freedom, …) and by entries of θ.
#[derive(Default)]
pub(super) struct Number {
    pub value: f64,
    pub rate: f64,
    pub by_q: f64,
    pub by_v: f64,
    pub by_theta: Vec<(usize, f64)>,
}

impl Bodies {
    pub fn new(model: &Model, q: Vec<f64>, v: Vec<f64>, slope: Vec<f64>, acceleration: Vec<f64>) -> Self {
        let tree = model.tree();
        let mut frames = Frames::about(tree.origin(&q));
        frames.evaluate_values(tree, &q, &slope, &acceleration, &Vector3::zeros());
        Self { q, v, slope, acceleration, frames }
    }

    /// A point of a body, in the world \[m\].
    pub fn point(&self, model: &Model, body: usize, point: &Vector3<f64>) -> Seen {
        let frame = &self.frames.bodies[body];
        let p = frame.position + frame.rotation * point;
        let tree = model.tree();
        let by = tree.chain(tree.last_dof(body)).map(|l| (l, self.frames.axes[l].s.at(&p))).collect();
        Seen { value: p + self.frames.origin, rate: frame.velocity.at(&p), by }
    }

    /// Axes of a body, as columns in the world's.
    pub fn axes(&self, body: usize) -> Matrix3<f64> {
        self.frames.bodies[body].rotation
    }

    /// Turn of a body, in its own axes: `value` is empty, `rate` its angular velocity [rad/s], `by` its turns [-].
    pub fn turn(&self, model: &Model, body: usize) -> Seen {
        let frame = &self.frames.bodies[body];
        let own = frame.rotation.transpose();
        let tree = model.tree();
        let by = tree.chain(tree.last_dof(body)).map(|l| (l, own * self.frames.axes[l].s.w)).collect();
        Seen { value: Vector3::zeros(), rate: own * frame.velocity.w, by }
    }

    /// Reading of an error-free sensor at a joint, under controls u that change at the rates `u_rate`.
    pub fn number(&self, place: &JointPlace, [u, u_rate]: [&[f64]; 2], theta: &[f64]) -> Number {
        let (q, v, a) = (self.q[place.q], self.v[place.v], self.acceleration[place.v]);
        let slope = self.slope[place.v];
        match place.quantity {
            JointQuantity::Position => Number { value: q, rate: slope, by_q: 1.0, ..Number::default() },
            JointQuantity::Velocity => Number { value: v, rate: a, by_v: 1.0, ..Number::default() },
            JointQuantity::Torque => {
                let t = torque(&place.drives, q, v, u, theta);
                let commanded: f64 = t.by_u.iter().map(|&(k, d)| d * u_rate[k]).sum();
                let rate = t.by_q * slope + t.by_v * a + commanded;
                Number { value: t.value, rate, by_q: t.by_q, by_v: t.by_v, by_theta: t.by_theta }
            }
        }
    }
}

/// L⁻¹ of log(exp(−δ) exp(r)) = r − L⁻¹ δ + …, the inverse of the left Jacobian of rotations; r shorter than a full turn.
pub(super) fn inverse_left_jacobian(r: &Vector3<f64>) -> Matrix3<f64> {
    Map::Exponential.jacobian(&-r).try_inverse().unwrap_or_else(Matrix3::identity)
}
