//! How a displacement of coordinates and a change of the tangent show up after `q ⊕ t`, in the axes reached.

use super::tree::{JointKind, Tree};
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::rotation::{Map, matrix};

/// `(q ⊕ δ) ⊕ (t + τ) = (q ⊕ t) ⊕ (T δ + J τ)` to first order; only balls differ from the identity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TangentMaps {
    balls: Vec<Turn>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    joint: usize,
    /// First degree of freedom.
    v: usize,
    transport: Matrix3<f64>,
    jacobian: Matrix3<f64>,
}

impl TangentMaps {
    /// Evaluates at the tangent `t` of all degrees of freedom.
    pub fn evaluate(&mut self, tree: &Tree, map: Map, t: &[f64]) {
        self.balls.clear();
        if !tree.has_balls() {
            return;
        }
        for (k, joint) in tree.joints().iter().enumerate().filter(|(_, j)| j.kind == JointKind::Ball) {
            let t = Vec3::new(t[joint.v], t[joint.v + 1], t[joint.v + 2]);
            let transport = matrix(&map.turn(&t)).transpose();
            self.balls.push(Turn { joint: k, v: joint.v, transport, jacobian: map.jacobian(&t) });
        }
    }

    /// Whether T and J are the identity.
    pub fn is_identity(&self) -> bool {
        self.balls.is_empty()
    }

    /// J by joint, none where it is the identity; empty if it is everywhere.
    pub fn jacobians(&self, n_joints: usize, out: &mut Vec<Option<Matrix3<f64>>>) {
        out.clear();
        if !self.balls.is_empty() {
            out.resize(n_joints, None);
            self.balls.iter().for_each(|ball| out[ball.joint] = Some(ball.jacobian));
        }
    }

    /// `x ← T x`, row-major with `columns` per degree of freedom.
    pub fn transport(&self, x: &mut [f64], columns: usize) {
        self.balls.iter().for_each(|b| apply(&b.transport, x, b.v, columns));
    }

    /// `x ← J x`.
    pub fn jacobian(&self, x: &mut [f64], columns: usize) {
        self.balls.iter().for_each(|b| apply(&b.jacobian, x, b.v, columns));
    }

    /// `x ← Tᵀ x`, one column.
    pub fn transport_transpose(&self, x: &mut [f64]) {
        self.balls.iter().for_each(|b| apply(&b.transport.transpose(), x, b.v, 1));
    }

    /// `x ← Jᵀ x`, one column.
    pub fn jacobian_transpose(&self, x: &mut [f64]) {
        self.balls.iter().for_each(|b| apply(&b.jacobian.transpose(), x, b.v, 1));
    }
}

fn apply(a: &Matrix3<f64>, x: &mut [f64], first: usize, columns: usize) {
    let block = &mut x[first * columns..(first + 3) * columns];
    for c in 0..columns {
        let moved = a * Vec3::new(block[c], block[columns + c], block[2 * columns + c]);
        (0..3).for_each(|r| block[r * columns + c] = moved[r]);
    }
}
