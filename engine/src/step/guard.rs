//! A step too long for its contacts.
//!
//! A contact closes where the step ends, and pushes there: its work is w·u⁺, with the relative velocity u⁺ at the end. What turns by
//! a large part of a radian within the step may come down on the chord and yet be on its way up at the end; then the contact, which
//! by itself can only take energy, gives some. Such a step is refused, and two of half the length are taken.

use super::{Stage, StepError, Workspace};
use crate::bodies::spatial::Force;
use crate::contact::SpotKey;

/// Largest part of the kinetic energy that contacts may give in a step.
const GIVEN: f64 = 0.05;

impl Stage<'_> {
    /// Whether the contacts of solids at the root in `ws.it` gave more than [`GIVEN`] of the kinetic energy there, and more than the
    /// energy of one step's fall: what lies and turns slowly is none of this.
    pub(super) fn contacts_drive(&self, ws: &mut Workspace) -> Result<bool, StepError> {
        if !ws.spots.spots.iter().any(|s| matches!(s.key, SpotKey::Contact { .. })) {
            return Ok(false);
        }
        let it = std::mem::take(&mut ws.it);
        let energies = self.given_and_kinetic(&it, ws);
        ws.it = it;
        let (given, kinetic) = energies?;
        let fall = self.theta[self.model.gravity] * self.h;
        Ok(given > GIVEN * kinetic + 0.5 * self.measure.total * fall * fall)
    }

    /// Work of the contacts, and kinetic energy of everything \[J\].
    fn given_and_kinetic(&self, it: &super::stage::Iterate, ws: &mut Workspace) -> Result<(f64, f64), StepError> {
        self.place(&it.v, ws);
        self.evaluate_frames(&it.v, ws, false);
        let mut given = 0.0;
        for (spot, w) in ws.spots.spots.iter().zip(&it.p) {
            given += self.contact_work(spot, w, &it.v, ws)?;
        }
        let bodies = ws.bodies.frames.bodies.iter().zip(self.inertias).map(|(frame, inertia)| {
            let momentum: Force<f64> = inertia.placed(&frame.rotation, &frame.position).mul(&frame.velocity);
            0.5 * frame.velocity.dot(&momentum)
        });
        let dofs = self.model.tree.dofs().iter().zip(&it.v[self.model.n_node_dofs()..]);
        let rotors = dofs.map(|(dof, v)| 0.5 * self.theta[self.model.tree.joints()[dof.joint].armature] * v * v);
        let nodes = self.mass.iter().zip(it.v.chunks_exact(3)).map(|(m, v)| 0.5 * m * v.iter().map(|x| x * x).sum::<f64>());
        Ok((given, bodies.sum::<f64>() + rotors.sum::<f64>() + nodes.sum::<f64>()))
    }
}
