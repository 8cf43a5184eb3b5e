//! What acts where Newton's method fails: for error messages.

use super::{Iterate, Stage, Workspace};
use crate::geometry::collider::Attachment;
use crate::step::constraints::{ConstraintId, Link};
use crate::terms::Point;

/// Name of bending and twisting of rods in messages.
const ROD: &str = "rod (bending and twist)";
/// Of the air, on bodies.
const DRAG: &str = "air drag";
/// And grippers that grasp.
const GRASP: &str = "grasp";

/// A force that is not finite: its name, row and value.
type Broken = (String, usize, f64);

/// The largest of the forces looked at in one row \[N, N·m\]; inertia alone balances a row without any.
struct Largest {
    row: usize,
    name: String,
    force: f64,
}

impl Largest {
    /// Looks at a force `f`, whose row 0 is that of number `first`.
    fn look(&mut self, name: &str, first: usize, f: &[f64]) -> Result<(), Broken> {
        if let Some(k) = f.iter().position(|f| !f.is_finite()) {
            return Err((name.to_owned(), first + k, f[k]));
        }
        let here = self.row.checked_sub(first).and_then(|row| f.get(row)).map_or(0.0, |f| f.abs());
        if here > self.force {
            (self.name, self.force) = (name.to_owned(), here);
        }
        Ok(())
    }
}

impl Stage<'_> {
    /// The force that is largest in a row, and the first that is not finite, if there is one. The force of a contact of colliders counts as a whole.
    pub(crate) fn blame(&self, it: &Iterate, row: usize, ws: &mut Workspace) -> (String, Option<Broken>) {
        self.place(&it.v, ws);
        self.evaluate_frames(&it.v, ws, false);
        let mut largest = Largest { row, name: "inertia".to_owned(), force: 0.0 };
        if let Err(broken) = self.look_at_forces(&mut largest, ws) {
            return (broken.0.clone(), Some(broken));
        }
        match self.heaviest_contact(row, it, ws) {
            Some((name, force)) if force > largest.force => (name, None),
            _ => (largest.name, None),
        }
    }

    fn look_at_forces(&self, largest: &mut Largest, ws: &mut Workspace) -> Result<(), Broken> {
        let n = self.model.n_node_dofs();
        if largest.row >= n {
            let tree = &self.model.tree;
            let mut f = vec![0.0; tree.nv()];
            for term in &self.model.joint_terms {
                f.fill(0.0);
                term.add_force(&self.joint_point(&ws.q_bar, &ws.v_bar), &mut f);
                largest.look(term.name(), n, &f)?;
            }
            f.fill(0.0);
            for drag in self.drags() {
                let wrench = drag.wrench(self.theta, &ws.bodies.frames.bodies[drag.body]);
                let axes = &ws.bodies.frames.axes;
                tree.chain(tree.last_dof(drag.body)).for_each(|l| f[l] += axes[l].s.dot(&wrench));
            }
            return largest.look(DRAG, n, &f);
        }
        let at = Point { q: &ws.q_bar, v: &ws.v_bar, theta: self.theta };
        for term in &self.model.terms {
            ws.f.fill(0.0);
            term.add_force(&at, &mut ws.f);
            largest.look(term.name(), 0, &ws.f)?;
        }
        ws.f.fill(0.0);
        self.model.rods.add_force(&ws.rods, &ws.v_bar, self.theta, self.remembered(), &mut ws.f);
        largest.look(ROD, 0, &ws.f)?;
        ws.f.fill(0.0);
        self.holds.iter().for_each(|hold| hold.add_force(&at, &mut ws.f));
        largest.look(GRASP, 0, &ws.f)
    }

    /// The contact of colliders that pushes hardest on what a row moves, with the masses of its bodies, and its normal force \[N\].
    fn heaviest_contact(&self, row: usize, it: &Iterate, ws: &Workspace) -> Option<(String, f64)> {
        let (n, tree) = (self.model.n_node_dofs(), &self.model.tree);
        let moves = |attachment: &Attachment| match *attachment {
            Attachment::World => false,
            Attachment::Node(node) => row < n && row / 3 == node,
            Attachment::Body(body) => tree.chain(tree.last_dof(body)).any(|l| n + l == row),
        };
        let is_contact = |link: &Link| matches!(link.id, ConstraintId::Bodies { .. });
        let links = ws.constraints.parts(&it.lambda).flat_map(|(set, own)| set.links().iter().zip(own.chunks_exact(4)));
        let pushing = links.filter(|(link, _)| is_contact(link) && link.attachments.iter().any(moves));
        let (link, w) = pushing.max_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]))?;
        let [first, second] = link.colliders.map(|k| &self.model.colliders[k].name);
        let masses = match link.attachments {
            [Attachment::Body(a), Attachment::Body(b)] => {
                let [a, b] = [a, b].map(|body| self.masses.bodies[body].m);
                format!(" ({a:.3e} kg, {b:.3e} kg)")
            }
            _ => String::new(),
        };
        Some((format!("contact of {first} with {second}{masses}"), w[0] / self.h))
    }
}
