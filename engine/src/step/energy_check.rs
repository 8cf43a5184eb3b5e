//! Steps too long for what turns in them.
//!
//! Newton's method finds a root of the discrete equations; that it is the motion they stand for is another matter. At it the forces f do
//! the work h v⁺·f, and the change of energy may exceed it, since inertia, weight and the distance between two colliders change along the
//! way while forces are those of its end:
//! ```text
//! D = ΔT − g·Δ(Σ m x) − h v⁺·ID(q⁺, v⁺, ā) + Σ_contacts (w·u⁺ − W)        [J]
//! ```
//! with ID of inertia and weight, u⁺ the relative velocity at a contact, and W what the law is meant to do along the normal: push out a
//! deep contact, and open one that is nearer than the rest gap. Beside that a contact can only take energy. For bodies that do not turn
//! D ≤ 0: implicit Euler dissipates. A stage that creates a noticeable part of the kinetic energy is refused, and two steps of half
//! the length are taken. Both stages of sdirk2 are steps of Euler, from references of their own.

use super::{Stage, StepError, Workspace};
use crate::bodies::Frames;
use crate::bodies::dynamics::inverse_dynamics;
use crate::constraints::contact_wrench;
use crate::step::constants::STEP;
use crate::step::constraints::{BodyContact, Evaluation};
use nalgebra::Vector4;
use pliant_math::Vec3;

/// Energy that a stage created, and the kinetic energy at its end \[J\].
pub(super) struct CreatedByBodies {
    pub energy: f64,
    pub kinetic: f64,
    /// Whether that is no motion.
    pub too_much: bool,
}

impl Stage<'_> {
    /// What the root in `ws.it` created, where colliders may touch.
    pub(super) fn created_by_bodies(&self, ws: &mut Workspace) -> Result<Option<CreatedByBodies>, StepError> {
        if !ws.constraints.bodies.any() {
            return Ok(None);
        }
        let it = std::mem::take(&mut ws.it);
        let balance = self.balance(&it, ws);
        ws.it = it;
        let (energy, kinetic) = balance?;
        let fall = self.theta[self.model.gravity] * self.h;
        let most = STEP.created_by_bodies * kinetic + 0.5 * self.masses.total * fall * fall;
        Ok(Some(CreatedByBodies { energy, kinetic, too_much: energy > most }))
    }

    /// D of bodies and contacts, and the kinetic energy of bodies and nodes at the end \[J\].
    fn balance(&self, it: &super::stage::Iterate, ws: &mut Workspace) -> Result<(f64, f64), StepError> {
        let n = self.model.n_node_dofs();
        self.frames_at_start(ws);
        let (before, moment_before) = self.kinetic_and_moment(&ws.bodies.frames);
        self.place(&it.v, ws);
        self.evaluate_frames(&it.v, ws, false);
        let (after, moment_after) = self.kinetic_and_moment(&ws.bodies.frames);
        let mut touched = 0.0;
        let at = Evaluation { q: &ws.q_bar, v: &it.v, frames: &ws.bodies.frames, blocks: &ws.blocks, at_root: false };
        let [_, first, ..] = ws.constraints.starts();
        for ((link, BodyContact { pair, features, .. }), w) in
            ws.constraints.bodies.each().zip(it.lambda[first..].chunks_exact(4))
        {
            let geometry = self.geometry(link, features, &at)?;
            let law = self.body_contact_law(link, *pair);
            let wrench = contact_wrench(&geometry, law.mu, &Vector4::from_column_slice(w));
            let (sliding, out) = (link.sliding(&geometry, &at), link.target_speed(self.h));
            // what the law is meant to do: push out a deep contact by its target, and one that is nearer than the rest gap by no more than κ
            let meant = w[0] * out + (w[0] * (geometry.normal.dot(&sliding.velocity) - out)).clamp(0.0, law.at.kappa);
            touched += sliding.relative.dot(&wrench) - meant;
        }
        let tau = &mut ws.r[n..];
        let mut forces = Vec::new();
        inverse_dynamics(&self.model.tree, &ws.bodies.frames, &self.masses.bodies, &[], &mut forces, tau);
        let work: f64 = tau.iter().zip(&it.v[n..]).map(|(t, v)| t * v).sum();
        let lifted = self.model.gravity_vector(self.theta).dot(&(moment_after - moment_before));
        let of_nodes: f64 = self.masses.rows.iter().zip(&it.v).map(|(m, v)| 0.5 * m * v * v).sum();
        Ok((after - before - lifted - self.h * work + touched, after + of_nodes))
    }

    /// Kinetic energy \[J\] and first moment of mass about the frames' origin [kg·m] of the bodies.
    fn kinetic_and_moment(&self, frames: &Frames<f64>) -> (f64, Vec3<f64>) {
        let mut sum = (0.0, Vec3::zeros());
        for (frame, inertia) in frames.bodies.iter().zip(&self.masses.bodies) {
            let placed = inertia.placed(&frame.rotation, &frame.position);
            sum.0 += 0.5 * frame.velocity.dot(&placed.mul(&frame.velocity));
            sum.1 += placed.h;
        }
        sum
    }
}
