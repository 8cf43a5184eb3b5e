//! A start for Newton's method where contacts of colliders are made or change: their law at frozen geometry.
//!
//! With K of everything but the contacts, factored once where the stage begins, velocities and relative velocities at the contacts are
//! affine in the impulses p,
//! ```text
//! v = v₀ − K⁻¹ r₀ + Y p,   u = b + G p,   Y = K⁻¹ Sᵀ/h,   G = ∂u/∂v Y,   u = ((gap − target)/h, v_s, v_t)
//! ```
//! and the law is solved for p by an interior-point method ([`central_path`]). This finds which contacts close, which slide and how they
//! share the load, which Newton's method on stiff contacts takes many factorizations to find; it takes one. What is left to Newton is that
//! bodies turn.

use super::central_path::{self, CentralContact};
use super::{Stage, StepError, Workspace};
use crate::geometry::collider::Attachment;
use crate::step::constraints::{BodyContact, Change, Evaluation, tangents};
use nalgebra::Vector6;
use pliant_math::spatial::Force;

/// Memory of the start, kept between stages.
#[derive(Clone, Debug, Default)]
pub(crate) struct FrozenWorkspace {
    /// Contacts, in their order: the numbers of their law, and unit forces along their axes where they meet.
    contacts: Vec<CentralContact>,
    pushes: Vec<[Force<f64>; 3]>,
    /// Y, row-major, and G by columns, of the contacts that may close.
    response: Vec<f64>,
    delassus: Vec<f64>,
    /// b [m/s].
    b: Vec<f64>,
    column: Vec<f64>,
}

impl Stage<'_> {
    /// Takes the iterate to the root of the law at the geometry it has there. False, and the iterate unchanged, if there is none; what it
    /// was is in `ws.newton.trial`.
    pub(crate) fn solve_frozen(&self, ws: &mut Workspace) -> bool {
        ws.newton.trial.clone_from(&ws.it);
        let [_, first, end, _] = ws.constraints.starts();
        ws.it.lambda[first..end].fill(0.0);
        let mut part = std::mem::take(&mut ws.frozen);
        let linear = self.with(|o| o.disabled = true).linearize_mixed(ws).is_ok() && ws.factor.refactor(&ws.k).is_ok();
        let solved = linear && self.list_frozen(&mut part, ws).is_ok() && self.meet_frozen(&mut part, ws);
        ws.frozen = part;
        if !solved {
            ws.it.clone_from(&ws.newton.trial);
        }
        solved
    }

    /// Solves for the impulses and moves the iterate; false if there is no solution or it leaves what is finite.
    fn meet_frozen(&self, part: &mut FrozenWorkspace, ws: &mut Workspace) -> bool {
        let (n, nv) = (3 * part.pushes.len(), ws.newton.d.v.len());
        // r₀ moves the bodies
        let mut d = std::mem::take(&mut ws.newton.d.v);
        d.iter_mut().zip(&ws.r).for_each(|(d, r)| *d = -r);
        ws.factor.solve(&mut d);
        part.column.clear();
        part.column.resize(n, 0.0);
        self.relative(&d, &part.pushes, ws, &mut part.column);
        part.b.iter_mut().zip(&part.column).for_each(|(b, c)| *b += c);
        // Y and G
        part.response.clear();
        part.response.resize(nv * n, 0.0);
        for (c, pushes) in part.pushes.iter().enumerate() {
            for (k, push) in pushes.iter().enumerate() {
                self.spread(push, c, ws, &mut |row, f| part.response[row * n + 3 * c + k] += f / self.h);
            }
        }
        ws.factor.solve_many(&mut part.response, n);
        part.delassus.resize(n * n, 0.0);
        let mut y = std::mem::take(&mut ws.newton.d_next.v);
        let w = central_path::solve(&part.contacts, &part.b, &mut part.delassus, |c, columns| {
            for (k, column) in columns.chunks_exact_mut(n).enumerate() {
                y.iter_mut().zip(part.response.chunks_exact(n)).for_each(|(y, row)| *y = row[3 * c + k]);
                self.relative(&y, &part.pushes, ws, column);
            }
        });
        (ws.newton.d.v, ws.newton.d_next.v) = (d, y);
        let Some(w) = w else { return false };
        // p into `column`, w into the multipliers
        let [_, first, ..] = ws.constraints.starts();
        for (c, ((w, contact), [_, s, t])) in w.iter().zip(&part.contacts).zip(&part.pushes).enumerate() {
            part.column[3 * c..3 * c + 3].copy_from_slice(&[w[0], contact.mu * w[1], contact.mu * w[2]]);
            let across = s.f * w[1] + t.f * w[2];
            ws.it.lambda[first + 4 * c..first + 4 * c + 4].copy_from_slice(&[w[0], across[0], across[1], across[2]]);
        }
        for ((v, d), row) in ws.it.v.iter_mut().zip(&ws.newton.d.v).zip(part.response.chunks_exact(n)) {
            *v += d + row.iter().zip(&part.column).map(|(y, p)| y * p).sum::<f64>();
        }
        ws.it.v.iter().chain(&ws.it.lambda).all(|x| x.is_finite())
    }

    /// The contacts, and u where the linearization is.
    fn list_frozen(&self, part: &mut FrozenWorkspace, ws: &Workspace) -> Result<(), StepError> {
        part.contacts.clear();
        part.pushes.clear();
        part.b.clear();
        let at =
            Evaluation { q: &ws.q_bar, v: &ws.newton.trial.v, frames: &ws.bodies.frames, blocks: &ws.blocks, at_root: false };
        for (link, BodyContact { pair, features, .. }) in ws.constraints.bodies.each() {
            let geometry = self.geometry(link, features, &at)?;
            let sliding = link.sliding(&geometry, &at);
            let law = self.body_contact_law(link, *pair);
            let [s, t] = tangents(&geometry.normal);
            let (mu, kappa) = (law.mu, law.at.kappa);
            part.contacts.push(CentralContact { mu, kappa, compliance_per_h2: law.at.compliance_per_h2 });
            part.pushes.push([geometry.normal, s, t].map(|axis| Force::at(&geometry.point, axis)));
            part.b.extend([geometry.gap / self.h, sliding.velocity.dot(&s), sliding.velocity.dot(&t)]);
        }
        Ok(())
    }

    /// Changes of u that go with the change `d` of velocities; the columns must be those of K.
    fn relative(&self, d: &[f64], pushes: &[[Force<f64>; 3]], ws: &Workspace, out: &mut [f64]) {
        let moved = ws.bodies.partials.carry(&self.model.tree, &d[self.model.n_node_dofs()..]);
        let change = Change { d, bodies: &moved, frames: &ws.bodies.frames };
        for (([n, s, t], link), u) in pushes.iter().zip(&ws.constraints.bodies.links).zip(out.chunks_exact_mut(3)) {
            let [a, b] = link.attachments.map(|c| self.moved(c, &change));
            let (displaced, moving) = (a.0 - b.0, a.1 - b.1);
            u.copy_from_slice(&[column_dot(&displaced, n) / self.h, column_dot(&moving, s), column_dot(&moving, t)]);
        }
    }

    /// Generalized forces of a wrench on the first collider of a contact and its opposite on the second.
    fn spread(&self, wrench: &Force<f64>, contact: usize, ws: &Workspace, add: &mut dyn FnMut(usize, f64)) {
        let n = self.model.n_node_dofs();
        for (attachment, sign) in ws.constraints.bodies.links[contact].attachments.iter().zip([1.0, -1.0]) {
            match *attachment {
                Attachment::World => {}
                Attachment::Node(node) if self.model.prescribed[node] => {}
                Attachment::Node(node) => (0..3).for_each(|a| add(3 * node + a, sign * wrench.f[a])),
                Attachment::Body(body) => {
                    let tree = &self.model.tree;
                    tree.chain(tree.last_dof(body)).for_each(|l| add(n + l, sign * ws.bodies.frames.axes[l].s.dot(wrench)));
                }
            }
        }
    }
}

/// A six-vector of motion along a wrench.
fn column_dot(x: &Vector6<f64>, f: &Force<f64>) -> f64 {
    x[0] * f.n[0] + x[1] * f.n[1] + x[2] * f.n[2] + x[3] * f.f[0] + x[4] * f.f[1] + x[5] * f.f[2]
}
