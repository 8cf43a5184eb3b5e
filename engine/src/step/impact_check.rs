//! Impacts that sdirk2 would throw back.
//!
//! The second stage begins where the first one leads if it goes on as it does, at
//! ```text
//! v + ϱ (v₁ − v),   q + ϱ (q₁ − q),   ϱ = (1 − γ)/γ = 1 + √2
//! ```
//! which is of second order where forces are smooth. What hits a shape or a stop at the speed V within the first stage has lost part of it
//! there by one impulse, not by a force that would go on: of a node that was stopped, v₁ = 0, the reference leaves with √2 V, and where it
//! was merely put down onto the shape the reference has gone through, and is pushed out as fast. Such a step is taken as two of half the
//! length by Euler, which stops what hits. The rule is the same for nodes, edges and triangles, bodies and stops of joints.

use super::{SDIRK_GAMMA, Stage, Workspace};
use crate::constraints::weighed;
use crate::step::constants::STEP;
use crate::step::constraints::Evaluation;

/// A constraint that may open, over a stage: at its beginning and at its root.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    /// Signed distance [m, rad].
    pub gap: [f64; 2],
    /// Its rate [m/s, rad/s].
    pub speed: [f64; 2],
    /// The speed that the impulse gives the mass it acts on [m/s, rad/s].
    pub pushed: f64,
}

impl Approach {
    /// Whether what approached leaves in the reference of the second stage, or has gone through there.
    fn rebounds(&self, slow: f64, h: f64) -> bool {
        let ratio = (1.0 - SDIRK_GAMMA) / SDIRK_GAMMA;
        let ahead = |x: [f64; 2]| x[0] + ratio * (x[1] - x[0]);
        let (gap, speed) = (ahead(self.gap), ahead(self.speed));
        let pierced = gap < -slow * h && gap < self.gap[0];
        let leaves = self.pushed > slow && speed > slow && self.speed[0] < -slow;
        pierced || leaves
    }
}

impl Stage<'_> {
    /// Whether a stage of sdirk2, solved in `ws`, is an impact: it began with something pierced, or, if it is the `first`, the second would
    /// begin so or rebound.
    pub(super) fn is_impact(&self, first: bool, ws: &Workspace) -> bool {
        // of the whole (sub)step
        let h = self.h / SDIRK_GAMMA;
        let slow = STEP.slow * weighed(self.theta[self.model.gravity]).0 * h;
        if ws.constraints.sets().iter().any(|set| set.least_gap() < -slow * h) {
            return true;
        }
        let (at, mut rebounds) =
            (Evaluation { q: &ws.q_bar, v: &ws.it.v, frames: &ws.bodies.frames, blocks: &ws.blocks, at_root: false }, false);
        if first {
            ws.constraints.parts(&ws.it.lambda).for_each(|(set, own)| {
                set.visit_approaches(self, &at, own, &mut |approach| rebounds |= approach.rebounds(slow, h));
            });
        }
        rebounds
    }
}
