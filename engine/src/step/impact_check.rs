//! Contact that sdirk2 would throw back.
//!
//! The second stage begins where the first one leads if it goes on as it does, at
//! ```text
//! v + ϱ (v₁ − v),   q + ϱ (q₁ − q),   ϱ = (1 − γ)/γ = 1 + √2
//! ```
//! which is of second order where forces are smooth. What hits a shape at the speed V within the first stage has lost part of it there by
//! one impulse, not by a force that would go on: of a node that was stopped, v₁ = 0, the reference leaves with √2 V, and where it was
//! merely put down onto the shape the reference has gone through, and is pushed out as fast. Such a step is taken as two of half the length
//! by Euler, which stops what hits.

use super::Stepper;
use crate::constraints::{of_nodes, weighed};
use crate::geometry::element::nearest;
use crate::step::constants::STEP;
use pliant_math::{State, Vec3};

impl Stepper<'_> {
    /// Whether the reference of the second stage, in place, has been thrown back by what the first one touched, from the state `start`.
    pub(super) fn thrown_back(&self, start: &State, h: f64) -> bool {
        let slow = self.slow(h);
        let at = |x: &[f64], node: usize| Vec3::new(x[3 * node], x[3 * node + 1], x[3 * node + 2]);
        let [nodes, ..] = self.ws.constraints.starts();
        let cones = self.ws.it.lambda[nodes..].chunks_exact(4);
        let of_nodes = self.model.pairs.iter().zip(cones).any(|(pair, w)| {
            let (shape, radius, node) = (&self.model.shapes[pair.shape], self.theta[pair.radius], pair.node);
            let gap = |q: &[f64]| shape.eval(&at(q, node), radius, self.theta);
            let Ok(reference) = gap(&self.q_ref) else { return true };
            let pierced = reference.gap < -slow * h;
            let leaves = w[0] > slow * self.masses.nodes[node] && reference.normal.dot(&at(&self.v_ref, node)) > slow;
            (pierced || leaves)
                && gap(&start.q).is_ok_and(|begin| {
                    pierced && reference.gap < begin.gap || leaves && begin.normal.dot(&at(&start.v, node)) < -slow
                })
        });
        of_nodes || self.elements_thrown_back(start, slow)
    }

    /// The same of edges and triangles that leave what they hit; those that go through it are seen by [`Stepper::elements_pierced`].
    fn elements_thrown_back(&self, start: &State, slow: f64) -> bool {
        let [.., first] = self.ws.constraints.starts();
        let edges = &self.ws.constraints.edges;
        edges.contacts.iter().zip(self.ws.it.lambda[first..].chunks_exact(4)).any(|(contact, w)| {
            let at = contact.id;
            let element = &self.model.elements[at.element];
            let lightest = element.corners().iter().fold(f64::INFINITY, |m, node| m.min(self.masses.nodes[*node]));
            // along the normal, of the point that is nearest
            let speed = |q: &[f64], v: &[f64]| {
                let x = of_nodes(element, q);
                let found = nearest(&x[..element.count], self.theta[element.radius], at.feature, &edges.fixed[at.group]).ok()?;
                let v = of_nodes(element, v);
                Some(v.iter().zip(found.weights).map(|(v, weight)| weight * v.dot(&found.normal)).sum::<f64>())
            };
            w[0] > slow * lightest
                && speed(&self.q_ref, &self.v_ref).is_none_or(|v| v > slow)
                && speed(&start.q, &start.v).is_none_or(|v| v < -slow)
        })
    }

    /// Whether an edge or triangle had gone through a shape where the second stage began, further than where the step did.
    pub(super) fn elements_pierced(&self, start: &State, h: f64) -> bool {
        let slow = self.slow(h);
        let edges = &self.ws.constraints.edges;
        edges.contacts.iter().any(|contact| {
            let at = contact.id;
            let (element, shape) = (&self.model.elements[at.element], &edges.fixed[at.group]);
            let begin = || nearest(&of_nodes(element, &start.q)[..element.count], self.theta[element.radius], at.feature, shape);
            contact.gap < -slow * h && begin().is_ok_and(|begin| contact.gap < begin.gap)
        })
    }

    fn slow(&self, h: f64) -> f64 {
        STEP.slow * weighed(self.theta[self.model.gravity]).0 * h
    }
}
