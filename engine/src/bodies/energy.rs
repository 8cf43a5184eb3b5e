//! Energies of bodies.

use super::{Frames, Tree};
use pliant_math::Vec3;
use pliant_math::spatial::Inertia;

impl Tree {
    /// ½ Σ V·I V + ½ Σ armature v² \[J\].
    pub fn kinetic_energy(&self, q: &[f64], v: &[f64], inertias: &[Inertia<f64>], theta: &[f64]) -> f64 {
        let frames = self.frames(q, v);
        let bodies = frames.bodies.iter().zip(inertias).map(|(frame, inertia)| {
            let placed = inertia.placed(&frame.rotation, &frame.position);
            0.5 * frame.velocity.dot(&placed.mul(&frame.velocity))
        });
        let rotors = self.dofs().iter().zip(v).map(|(dof, v)| 0.5 * theta[self.joints()[dof.joint].armature] * v * v);
        bodies.sum::<f64>() + rotors.sum::<f64>()
    }

    /// −Σ m g·c \[J\], zero for centres of mass at the world's origin.
    pub fn weight_energy(&self, q: &[f64], inertias: &[Inertia<f64>], gravity: &Vec3<f64>) -> f64 {
        let frames = self.frames(q, &vec![0.0; self.nv()]);
        let weight = |frame: &super::Frame<f64>, i: &Inertia<f64>| -gravity.dot(&(frame.rotation * i.h + frame.position * i.m));
        frames.bodies.iter().zip(inertias).map(|(frame, inertia)| weight(frame, inertia)).sum()
    }

    /// Frames at rest accelerations, seen from the world's origin.
    pub fn frames(&self, q: &[f64], v: &[f64]) -> Frames<f64> {
        let mut frames = Frames::default();
        frames.evaluate(self, q, v, &vec![0.0; self.nv()], &Vec3::zeros());
        frames
    }
}
