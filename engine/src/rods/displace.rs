//! Changes of a state: x ⊕ δx and b ⊖ a for twists and the axes that belong to them.

use super::Rods;
use super::frames::{RodPoint, edge_vector};
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
}
