//! A start for Newton's method where contacts of colliders are made or change: their law at frozen geometry.
//!
//! With K of everything but the contacts, factored once where the stage begins, velocities and relative velocities at the contacts are
//! affine in the impulses p,
//! ```text
//! v = v₀ − K⁻¹ r₀ + Y p,   u = b + G p,   Y = K⁻¹ Sᵀ/h,   G = ∂u/∂v Y,   u = (gap/h, v_s, v_t)
//! ```
//! and Coulomb's law without smoothing is swept over contact by contact: `p_n ← max(0, p_n − u_n/G_nn)`, then `p_t − u_t/G_tt` drawn back
//! to the disc μ p_n. This finds which contacts close and which slide, which Newton's method on stiff contacts takes many
//! factorizations to find; it takes one. What is left to Newton is that bodies turn.
//! Reference: J. J. Moreau (1999), Comput. Methods Appl. Mech. Engrg. 177, for the sweeps.

use super::{Stage, StepError, Workspace};
use crate::geometry::collider::Attachment;
use crate::step::constants::STEP;
use crate::step::constraints::{BodyContact, Change, Evaluation, tangents};
use nalgebra::Vector6;
use pliant_math::Vec3;
use pliant_math::spatial::Force;

/// Memory of the start, kept between stages.
#[derive(Clone, Debug, Default)]
pub(crate) struct GaussSeidelWorkspace {
    /// Contacts, in their order: μ, compliance over h², axes and the point they meet at.
    points: Vec<GaussSeidelPoint>,
    /// Y, row-major, and G by columns.
    response: Vec<f64>,
    delassus: Vec<f64>,
    /// u [m/s] and p [N·s].
    u: Vec<f64>,
    p: Vec<f64>,
    column: Vec<f64>,
}

#[derive(Clone, Debug)]
struct GaussSeidelPoint {
    mu: f64,
    compliance_per_h2: f64,
    axes: [Vec3<f64>; 3],
    point: Vec3<f64>,
}

impl Stage<'_> {
    /// Takes the iterate to the root of the law at the geometry it has there. False, and the iterate unchanged, if there is none; what it
    /// was is in `ws.trial`.
    pub(crate) fn solve_gauss_seidel(&self, ws: &mut Workspace) -> bool {
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

    /// Sweeps over the contacts listed, and moves the iterate; false if it leaves what is finite.
    fn meet_frozen(&self, part: &mut GaussSeidelWorkspace, ws: &mut Workspace) -> bool {
        let (n, nv) = (3 * part.points.len(), ws.newton.d.v.len());
        // r₀ moves the bodies
        let mut d = std::mem::take(&mut ws.newton.d.v);
        d.iter_mut().zip(&ws.r).for_each(|(d, r)| *d = -r);
        ws.factor.solve(&mut d);
        part.column.clear();
        part.column.resize(n, 0.0);
        self.relative(&d, &part.points, ws, &mut part.column);
        part.u.iter_mut().zip(&part.column).for_each(|(u, c)| *u += c);
        // Y and G
        part.response.clear();
        part.response.resize(nv * n, 0.0);
        for (c, at) in part.points.iter().enumerate() {
            for (k, axis) in at.axes.iter().enumerate() {
                self.spread(&Force::at(&at.point, *axis), c, ws, &mut |row, f| part.response[row * n + 3 * c + k] += f / self.h);
            }
        }
        ws.factor.solve_many(&mut part.response, n);
        part.delassus.clear();
        part.delassus.resize(n * n, 0.0);
        let mut y = std::mem::take(&mut ws.newton.d_next.v);
        for j in 0..n {
            y.iter_mut().zip(part.response.chunks_exact(n)).for_each(|(y, row)| *y = row[j]);
            self.relative(&y, &part.points, ws, &mut part.delassus[j * n..(j + 1) * n]);
        }
        (ws.newton.d.v, ws.newton.d_next.v) = (d, y);
        for j in 0..n {
            let p = part.p[j];
            part.u.iter_mut().zip(&part.delassus[j * n..(j + 1) * n]).for_each(|(u, g)| *u += g * p);
        }
        part.sweep();
        for ((v, d), row) in ws.it.v.iter_mut().zip(&ws.newton.d.v).zip(part.response.chunks_exact(n)) {
            *v += d + row.iter().zip(&part.p).map(|(y, p)| y * p).sum::<f64>();
        }
        let [_, first, ..] = ws.constraints.starts();
        for (c, ((link, contact), at)) in ws.constraints.bodies.each().zip(&part.points).enumerate() {
            let law = self.body_contact_law(link, contact.pair);
            let p = &part.p[3 * c..3 * c + 3];
            let (z, rk) = (p[0] - law.at.rho_n * (part.u[3 * c] + at.compliance_per_h2 * p[0]), law.at.rho_n * law.at.kappa);
            let root = (z * z + 4.0 * rk).sqrt();
            let normal = if z > 0.0 { 0.5 * (z + root) } else { 2.0 * rk / (root - z) };
            let share = if at.mu > 0.0 { 1.0 / at.mu } else { 0.0 };
            let across = (at.axes[1] * p[1] + at.axes[2] * p[2]) * share;
            ws.it.lambda[first + 4 * c..first + 4 * c + 4].copy_from_slice(&[normal, across[0], across[1], across[2]]);
        }
        ws.it.v.iter().chain(&ws.it.lambda).all(|x| x.is_finite())
    }

    /// The contacts, u where the linearization is, and p from the impulses that `ws.trial` keeps.
    fn list_frozen(&self, part: &mut GaussSeidelWorkspace, ws: &Workspace) -> Result<(), StepError> {
        part.points.clear();
        part.u.clear();
        part.p.clear();
        let at = Evaluation { q: &ws.q_bar, v: &ws.newton.trial.v, frames: &ws.bodies.frames };
        let [_, first, ..] = ws.constraints.starts();
        for (k, (link, BodyContact { pair, features })) in ws.constraints.bodies.each().enumerate() {
            let geometry = self.geometry(link, features, &at)?;
            let sliding = link.sliding(&geometry, &at);
            let law = self.body_contact_law(link, *pair);
            let [s, t] = tangents(&geometry.normal);
            let (mu, w) = (law.at.mu, &ws.newton.trial.lambda[first + 4 * k..first + 4 * k + 4]);
            let across = Vec3::new(w[1], w[2], w[3]) * mu;
            part.points.push(GaussSeidelPoint {
                mu,
                compliance_per_h2: law.at.compliance_per_h2,
                axes: [geometry.normal, s, t],
                point: geometry.point,
            });
            part.u.extend([geometry.gap / self.h, sliding.velocity.dot(&s), sliding.velocity.dot(&t)]);
            part.p.extend([w[0], across.dot(&s), across.dot(&t)]);
        }
        Ok(())
    }

    /// Changes of u that go with the change `d` of velocities; the columns must be those of K.
    fn relative(&self, d: &[f64], points: &[GaussSeidelPoint], ws: &Workspace, out: &mut [f64]) {
        let moved = ws.bodies.partials.carry(&self.model.tree, &d[self.model.n_node_dofs()..]);
        let change = Change { d, bodies: &moved, frames: &ws.bodies.frames };
        for ((at, link), u) in points.iter().zip(&ws.constraints.bodies.links).zip(out.chunks_exact_mut(3)) {
            let [a, b] = link.attachments.map(|c| self.moved(c, &change));
            let along = |x: Vector6<f64>, axis: &Vec3<f64>| column_dot(&x, &Force::at(&at.point, *axis));
            u[0] = along(a[0] - b[0], &at.axes[0]) / self.h;
            u[1] = along(a[1] - b[1], &at.axes[1]);
            u[2] = along(a[1] - b[1], &at.axes[2]);
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

impl GaussSeidelWorkspace {
    /// Sweeps until impulses change little.
    fn sweep(&mut self) {
        let n = self.p.len();
        for _ in 0..STEP.sweeps {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for (c, at) in self.points.iter().enumerate() {
                let k = 3 * c;
                let g = |a: usize| self.delassus[(k + a) * n + k + a].max(f64::MIN_POSITIVE);
                let old = [self.p[k], self.p[k + 1], self.p[k + 2]];
                let normal = (old[0] - (self.u[k] + at.compliance_per_h2 * old[0]) / (g(0) + at.compliance_per_h2)).max(0.0);
                add_column(&mut self.u, &self.delassus, k, normal - old[0]);
                let stiff = 1.0 / g(1).max(g(2));
                let mut across = [1, 2].map(|a| old[a] - self.u[k + a] * stiff);
                let (size, most) = (across[0].hypot(across[1]), at.mu * normal);
                if size > most {
                    across = across.map(|x| x * most / size);
                }
                add_column(&mut self.u, &self.delassus, k + 1, across[0] - old[1]);
                add_column(&mut self.u, &self.delassus, k + 2, across[1] - old[2]);
                let new = [normal, across[0], across[1]];
                self.p[k..k + 3].copy_from_slice(&new);
                change = new.iter().zip(old).fold(change, |m, (x, y)| m.max((x - y).abs()));
                largest = largest.max(normal);
            }
            if change <= STEP.swept * largest {
                break;
            }
        }
    }
}

/// `u += G e_j x`.
fn add_column(u: &mut [f64], delassus: &[f64], j: usize, x: f64) {
    let n = u.len();
    u.iter_mut().zip(&delassus[j * n..(j + 1) * n]).for_each(|(u, g)| *u += g * x);
}

/// A six-vector of motion along a wrench.
fn column_dot(x: &Vector6<f64>, f: &Force<f64>) -> f64 {
    x[0] * f.n[0] + x[1] * f.n[1] + x[2] * f.n[2] + x[3] * f.f[0] + x[4] * f.f[1] + x[5] * f.f[2]
}
