//! States as points of a manifold: x ⊕ δx, b ⊖ a, and their pullbacks.
//!
//! A state's numbers x (nx) hold unit quaternions of balls and unit axes of rods' edges; changes δx (ndx) do not. With
//! ```text
//! E = ∂(x ⊕ δx)/∂δx at δx = 0        D = ∂(b ⊖ x)/∂b at b = x        D E = 1
//! ```
//! Eᵀ takes a cotangent of the numbers to one of changes, and Dᵀ takes it back: along any curve of states Dᵀ δx̄ · ẋ = δx̄ · δẋ.

use super::Model;
use crate::bodies::JointKind;
use pliant_math::rotation::Map;
use pliant_math::{State, Vec3};

impl Model {
    /// `x ⊕ δx`.
    pub fn displaced(&self, x: &State, dx: &[f64]) -> State {
        let (n, nv) = (self.n_node_dofs(), self.nv());
        let mut out = x.clone();
        out.q[..n].iter_mut().zip(&dx[..n]).for_each(|(q, d)| *q += d);
        self.tree.add(Map::Exponential, &x.q[n..], &dx[n..nv], &mut out.q[n..]);
        out.v.iter_mut().zip(&dx[nv..]).for_each(|(v, d)| *v += d);
        out.z.iter_mut().zip(&dx[2 * nv..]).for_each(|(z, d)| *z += d);
        self.rods.carry_frames(&x.q, &out.q, &mut out.z[self.ndz()..]);
        out
    }

    /// `b ⊖ a`, the change δx with `a ⊕ δx = b`.
    pub fn difference(&self, b: &State, a: &State) -> Vec<f64> {
        let (n, nv) = (self.n_node_dofs(), self.nv());
        let mut dx = vec![0.0; self.ndx()];
        (0..n).for_each(|k| dx[k] = b.q[k] - a.q[k]);
        self.rods.add_turns([&a.q, &b.q], [&a.z[self.ndz()..], &b.z[self.ndz()..]], &mut dx);
        self.tree.subtract(&b.q[n..], &a.q[n..], &mut dx[n..nv]);
        (0..nv).for_each(|k| dx[nv + k] = b.v[k] - a.v[k]);
        dx[2 * nv..].iter_mut().zip(b.z.iter().zip(&a.z)).for_each(|(d, (b, a))| *d = b - a);
        dx
    }

    /// Eᵀ x̄ (ndx) of x̄ (nx): the cotangent of changes from that of a state's numbers. Of a quaternion p, ω̄ = ½ L(p)ᵀ p̄ with
    /// L(p) ω = p (0, ω).
    pub fn pull_displaced(&self, x: &State, x_bar: &[f64]) -> Vec<f64> {
        let (n, nq, nv, memory) = (self.n_node_dofs(), self.nq(), self.nv(), self.ndz());
        let (q_bar, rest) = x_bar.split_at(nq);
        let mut out = Vec::with_capacity(self.ndx());
        out.extend_from_slice(&q_bar[..n]);
        out.resize(nv, 0.0);
        for joint in self.tree.joints() {
            let at = n + joint.q;
            if joint.kind != JointKind::Ball {
                out[n + joint.v] = q_bar[at];
                continue;
            }
            let ((w, u), (w_bar, u_bar)) = (parts(&x.q[at..]), parts(&q_bar[at..]));
            let turn = (u_bar * w - u * w_bar - u.cross(&u_bar)) * 0.5;
            out[n + joint.v..n + joint.v + 3].copy_from_slice(turn.as_slice());
        }
        out.extend_from_slice(&rest[..nv + memory]);
        self.rods.pull_carried(&x.q, &x.z[memory..], &rest[nv + memory..], &mut out);
        out
    }

    /// Dᵀ δx̄ (nx) of δx̄ (ndx): the cotangent of a state's numbers from that of changes. Of a quaternion p, p̄ = 2 L(p) ω̄ / |p|²,
    /// which has no part along p.
    pub fn pull_difference(&self, x: &State, dx_bar: &[f64]) -> Vec<f64> {
        let (n, nq, nv) = (self.n_node_dofs(), self.nq(), self.nv());
        let mut out = vec![0.0; self.nx()];
        out[..n].copy_from_slice(&dx_bar[..n]);
        for joint in self.tree.joints() {
            let (at, v) = (n + joint.q, n + joint.v);
            if joint.kind != JointKind::Ball {
                out[at] = dx_bar[v];
                continue;
            }
            let ((w, u), turn) = (parts(&x.q[at..]), Vec3::from_column_slice(&dx_bar[v..v + 3]));
            let by_norm = 2.0 / (w * w + u.norm_squared());
            out[at] = -by_norm * u.dot(&turn);
            out[at + 1..at + 4].copy_from_slice(((turn * w + u.cross(&turn)) * by_norm).as_slice());
        }
        out[nq..nq + nv + self.ndz()].copy_from_slice(&dx_bar[nv..]);
        self.rods.pull_turns(&x.q, &x.z[self.ndz()..], dx_bar, &mut out[nq + nv + self.ndz()..]);
        out
    }
}

/// Scalar and vector part of a quaternion.
fn parts(p: &[f64]) -> (f64, Vec3<f64>) {
    (p[0], Vec3::from_column_slice(&p[1..4]))
}
