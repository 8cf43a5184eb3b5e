//! Changes of a state: x ⊕ δx and b ⊖ a for twists and the axes that belong to them.

use super::frames::{RodPoint, edge_vector, vector};
use super::{RodEdge, Rods};
use pliant_math::Vec3;
use pliant_math::transport::{angle, carried};

impl Rods {
    /// Carries z's part `frames` from positions `from` to `to` \[m\].
    pub(crate) fn carry_frames(&self, from: &[f64], to: &[f64], frames: &mut [f64]) {
        self.carry_frames_by(&mut RodPoint::default(), from, to, frames);
    }

    /// The same with memory for it.
    pub(crate) fn carry_frames_by(&self, point: &mut RodPoint, from: &[f64], to: &[f64], frames: &mut [f64]) {
        if !self.edges.is_empty() {
            self.evaluate(from, frames, to, point);
            frames.copy_from_slice(&point.frames);
        }
    }

    /// Replaces the twists' rows of `dx`, θ_b − θ_a, by the turn of the material axes from configuration a, carried along, to b.
    pub(crate) fn add_turns(&self, q: [&[f64]; 2], frames: [&[f64]; 2], dx: &mut [f64]) {
        for (k, edge) in self.edges.iter().enumerate() {
            let [ta, tb] = q.map(|q| edge_vector(edge, q).normalize());
            let [da, db] = frames.map(|f| Vec3::new(f[3 * k], f[3 * k + 1], f[3 * k + 2]));
            dx[self.row(k)] += angle(&carried(&ta, &tb, &da), &db, &tb);
        }
    }

    /// Adds to the nodes' rows of `dx_bar` the pullback of how axes and reference twists follow their edges: with t the tangent and d the
    /// axis, δd = −t (d·δe)/|e|; and at a joint δm = ½ (κb)·(δe₁/|e₁| + δe₂/|e₂|), κb = 2 t₁ × t₂/(1 + t₁·t₂).
    pub(crate) fn pull_carried(&self, q: &[f64], frames: &[f64], frames_bar: &[f64], dx_bar: &mut [f64]) {
        let mut add = |edge: &RodEdge, e_bar: Vec3<f64>| {
            for a in 0..3 {
                dx_bar[3 * edge.nodes[0] + a] -= e_bar[a];
                dx_bar[3 * edge.nodes[1] + a] += e_bar[a];
            }
        };
        for (k, edge) in self.edges.iter().enumerate() {
            let (e, d, d_bar) = (edge_vector(edge, q), vector(frames, k), vector(frames_bar, k));
            add(edge, d * (-e.dot(&d_bar) / e.norm_squared()));
        }
        for (joint, m_bar) in self.joints.iter().zip(&frames_bar[3 * self.edges.len()..]) {
            let [one, two] = joint.edges.map(|k| &self.edges[k]);
            let [e1, e2] = [one, two].map(|edge| edge_vector(edge, q));
            let (l1, l2) = (e1.norm(), e2.norm());
            let half_binormal = e1.cross(&e2) / (l1 * l2 + e1.dot(&e2));
            add(one, half_binormal * (m_bar / l1));
            add(two, half_binormal * (m_bar / l2));
        }
    }

    /// The pullback of [`add_turns`](Self::add_turns) to b's axes at b = a: d turns by (t × d)·δd.
    pub(crate) fn pull_turns(&self, q: &[f64], frames: &[f64], dx_bar: &[f64], frames_bar: &mut [f64]) {
        for (k, edge) in self.edges.iter().enumerate() {
            let across = edge_vector(edge, q).normalize().cross(&vector(frames, k));
            frames_bar[3 * k..3 * k + 3].copy_from_slice((across * dx_bar[self.row(k)]).as_slice());
        }
    }
}
