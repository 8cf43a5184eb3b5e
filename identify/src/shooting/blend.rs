//! A state between two steps.

use super::bodies::Bodies;
use super::constants::SHOOTING;
use nalgebra::{Matrix3, Vector3};
use pliant_adjoint::Tangent;
use pliant_engine::bodies::JointKind;
use pliant_engine::bodies::quaternion;
use pliant_engine::model::Model;
use pliant_math::State;
use pliant_math::rotation::{Map, conjugate, logarithm, matrix, product};

/// Cubic Hermite interpolation within a step; before and after it, where a sensor that is late or early is read, the acceleration of the step
/// goes on (a cubic that is followed for many steps takes a step's rounding for jerk).
#[derive(Clone, Copy, Debug)]
pub(super) struct Blend {
    part: f64,
    h: f64,
    position: [f64; 4],
    velocity: [f64; 4],
}

impl Blend {
    /// At the part `a` of a step of length `h`; weights of q, v before and q, v after.
    pub fn new(a: f64, h: f64) -> Self {
        let b = 1.0 - a;
        let a = if a.abs() < SHOOTING.same_time {
            0.0
        } else if b.abs() < SHOOTING.same_time {
            1.0
        } else {
            a
        };
        let b = 1.0 - a;
        let (position, velocity) = if a < 0.0 {
            ([1.0, a * h * (1.0 - 0.5 * a), 0.0, 0.5 * a * a * h], [0.0, b, 0.0, a])
        } else if b < 0.0 {
            ([0.0, -0.5 * b * b * h, 1.0, -b * h * (1.0 - 0.5 * b)], [0.0, b, 0.0, a])
        } else {
            (
                [b * b * (1.0 + 2.0 * a), a * b * b * h, a * a * (1.0 + 2.0 * b), -a * a * b * h],
                [-6.0 * a * b / h, b * (1.0 - 3.0 * a), 6.0 * a * b / h, a * (3.0 * a - 2.0)],
            )
        };
        Self { part: a, h, position, velocity }
    }

    fn sum(weights: &[f64; 4], x: [&State; 2], node: usize) -> Vector3<f64> {
        let at = |s: &[f64]| Vector3::new(s[3 * node], s[3 * node + 1], s[3 * node + 2]);
        at(&x[0].q) * weights[0] + at(&x[0].v) * weights[1] + at(&x[1].q) * weights[2] + at(&x[1].v) * weights[3]
    }

    /// Position of a node.
    pub fn position(&self, x: [&State; 2], node: usize) -> Vector3<f64> {
        Self::sum(&self.position, x, node)
    }

    /// Its velocity.
    pub fn velocity(&self, x: [&State; 2], node: usize) -> Vector3<f64> {
        Self::sum(&self.velocity, x, node)
    }

    /// Adds `scale` times the tangents of a node's position to three rows of m columns.
    pub fn tangent(&self, t: [&Tangent; 2], node: usize, m: usize, scale: f64, out: &mut [f64]) {
        self.add_rows(t, 3 * node, 3, m, scale, out);
    }

    fn add_rows(&self, t: [&Tangent; 2], row: usize, rows: usize, m: usize, scale: f64, out: &mut [f64]) {
        let range = row * m..(row + rows) * m;
        for (weight, from) in self.position.iter().zip([&t[0].q, &t[0].v, &t[1].q, &t[1].v]) {
            if *weight != 0.0 {
                out.iter_mut().zip(&from[range.clone()]).for_each(|(o, x)| *o += scale * weight * x);
            }
        }
    }

    /// The bodies at this instant: coordinates by Hermite's formula, balls along the arc between their ends; velocities linearly.
    pub fn bodies(&self, model: &Model, x: [&State; 2]) -> Bodies {
        let (n, tree) = (model.n_node_dofs(), model.tree());
        let (a, b) = (self.part, 1.0 - self.part);
        let (q0, q1, v0, v1) = (&x[0].q[n..], &x[1].q[n..], &x[0].v[n..], &x[1].v[n..]);
        let mut q = q1.to_vec();
        let mut slope = v1.to_vec();
        for joint in tree.joints() {
            let (k, l) = (joint.q, joint.v);
            if joint.kind == JointKind::Ball {
                let start = quaternion(q0, k);
                let arc = logarithm(&product(&conjugate(&start), &quaternion(q1, k)));
                q[k..k + 4].copy_from_slice(&product(&start, &Map::Exponential.turn(&(arc * a))));
                slope[l..l + 3].copy_from_slice((arc / self.h).as_slice());
            } else {
                let w = &self.position;
                q[k] = w[0] * q0[k] + w[1] * v0[l] + w[2] * q1[k] + w[3] * v1[l];
                let w = &self.velocity;
                slope[l] = w[0] * q0[k] + w[1] * v0[l] + w[2] * q1[k] + w[3] * v1[l];
            }
        }
        let v = v0.iter().zip(v1).map(|(v0, v1)| b * v0 + a * v1).collect();
        let acceleration = v0.iter().zip(v1).map(|(v0, v1)| (v1 - v0) / self.h).collect();
        Bodies::new(model, q, v, slope, acceleration)
    }

    /// Tangents of the result of [`Blend::bodies`], (coordinates, velocities), m columns per degree of freedom.
    pub fn body_tangents(&self, model: &Model, x: [&State; 2], t: [&Tangent; 2], m: usize) -> (Vec<f64>, Vec<f64>) {
        let (n, tree) = (model.n_node_dofs(), model.tree());
        let nv = tree.nv();
        let (a, b) = (self.part, 1.0 - self.part);
        let mut q = vec![0.0; nv * m];
        for joint in tree.joints() {
            let l = joint.v;
            if joint.kind != JointKind::Ball {
                self.add_rows(t, n + l, 1, m, 1.0, &mut q[l * m..(l + 1) * m]);
                continue;
            }
            let (start, end) = (quaternion(&x[0].q[n..], joint.q), quaternion(&x[1].q[n..], joint.q));
            let arc = logarithm(&product(&conjugate(&start), &end));
            let [before, after] = arc_slopes(&arc, a);
            for (tangent, slope) in [(t[0], before), (t[1], after)] {
                for c in 0..m {
                    let at = |k: usize| tangent.q[(n + l + k) * m + c];
                    let moved = slope * Vector3::new(at(0), at(1), at(2));
                    (0..3).for_each(|k| q[(l + k) * m + c] += moved[k]);
                }
            }
        }
        let rows = n * m..(n + nv) * m;
        let v = t[0].v[rows.clone()].iter().zip(&t[1].v[rows]).map(|(v0, v1)| b * v0 + a * v1).collect();
        (q, v)
    }
}

/// Derivatives of the turn of q = q₀ exp(a ξ), in its own axes, by turns of q₀ and of q₁ = q₀ exp(ξ):
/// ```text
/// exp(−a ξ) − a J(a ξ) J(−ξ)⁻¹      and      a J(a ξ) J(ξ)⁻¹
/// ```
/// with J of exp(ξ + δ) = exp(ξ) exp(J δ).
fn arc_slopes(arc: &Vector3<f64>, a: f64) -> [Matrix3<f64>; 2] {
    let jacobian = |t: &Vector3<f64>| Map::Exponential.jacobian(t);
    let inverse = |t: &Vector3<f64>| jacobian(t).try_inverse().unwrap_or_else(Matrix3::identity);
    let along = jacobian(&(arc * a)) * a;
    [matrix(&Map::Exponential.turn(&(arc * -a))) - along * inverse(&-arc), along * inverse(arc)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fall by steps of any rule, whose positions are no exact integrals: the speed goes on as it changed, from the end that is nearer.
    #[test]
    fn beyond_a_step_its_acceleration_goes_on() {
        let (h, v0, v1) = (0.01, 1.0, 0.9);
        let (q0, q1) = (2.0, 2.0 + h * v1);
        let at = |a: f64| {
            let Blend { position: w, velocity: u, .. } = Blend::new(a, h);
            (w[0] * q0 + w[1] * v0 + w[2] * q1 + w[3] * v1, u[0] * q0 + u[1] * v0 + u[2] * q1 + u[3] * v1)
        };
        let near =
            |(q, v): (f64, f64), (x, y): (f64, f64)| assert!((q - x).abs() < 1e-14 && (v - y).abs() < 1e-12, "{q} {v} {x} {y}");
        near(at(-3.0), (q0 - 3.0 * h * v0 - 4.5 * h * 0.1, v0 + 0.3));
        near(at(3.0), (q1 + 2.0 * h * v1 - 2.0 * h * 0.1, v1 - 0.2));
        near(at(0.0), (q0, v0));
        near(at(1.0), (q1, v1));
    }
}
