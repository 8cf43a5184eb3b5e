//! Constraints between two frames in a stage.
//!
//! Newton's method eliminates λ, which leaves wrenches that depend on the displacements and velocities of both sides. The part by the
//! own side goes with the composites of [`crate::bodies::dynamics`]; the part by the other side, and by nodes, is added here.

use super::{Change, ConstraintId, Evaluation, Loads, Slopes};
use crate::bodies::Frames;
use crate::bodies::dynamics::{Displacement, Partials, WrenchPartial, moved_along};
use crate::constraints::{CONSTRAINTS, LinkLinear, node_of};
use crate::geometry::collider::Attachment;
use crate::step::Stage;
use nalgebra::{Matrix6, Vector4, Vector6};
use pliant_linalg::System;
use pliant_math::spatial::{Force, column};

/// The displacement of a frame and the change of its velocity, six-vectors about the origin of the evaluation.
pub(crate) type Moved = (Vector6<f64>, Vector6<f64>);

/// A constraint between two frames, as the beginning of the stage lists it, and linearized.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub id: ConstraintId,
    /// The frames it acts on.
    pub attachments: [Attachment; 2],
    /// Colliders of a contact, in the order of its features; unused by closures.
    pub colliders: [usize; 2],
    /// Steps of the law \[kg\].
    pub rho_n: f64,
    pub rho_t: f64,
    /// Mobility along the normal and across of the frames that are no nodes [1/kg].
    pub mobility: [f64; 2],
    /// Signed distance where the stage begins \[m\]; 0 of closures.
    pub gap: f64,
    /// Its rate there [m/s].
    pub speed: f64,
    /// Signed distance \[m\] that a contact must have where the stage ends: 0, or less where it begins so deep that it is pushed out over
    /// several steps; and then its derivatives by the coordinates where the stage begins, row by row.
    pub target: f64,
    pub target_by_start: Vec<(usize, f64)>,
    pub linear: LinkLinear,
}

impl Link {
    /// Before anything but its identity is known.
    pub fn new(id: ConstraintId, attachments: [Attachment; 2], colliders: [usize; 2]) -> Self {
        Self {
            id,
            attachments,
            colliders,
            rho_n: 0.0,
            rho_t: 0.0,
            mobility: [0.0; 2],
            gap: 0.0,
            speed: 0.0,
            target: 0.0,
            target_by_start: Vec::new(),
            linear: LinkLinear::zero(),
        }
    }

    /// Speed at which the contact has to open to reach its target [m/s].
    pub fn target_speed(&self, h: f64) -> f64 {
        if self.target < 0.0 { (self.target - self.gap) / h } else { 0.0 }
    }

    /// The multipliers whose forces act: condensed, those that would make the residual `f` vanish.
    pub fn load(&self, w: &Vector4<f64>, f: &Vector4<f64>, at: &Evaluation) -> Vector4<f64> {
        if at.at_root { *w } else { w - self.linear.inverse * f }
    }

    /// Adds the impulse `wrench` on the first frame, and its opposite on the second, as forces over the stage length `h`.
    pub fn push(&self, wrench: Force<f64>, h: f64, loads: &mut Loads) {
        for (side, sign) in [(0, 1.0 / h), (1, -1.0 / h)] {
            match self.attachments[side] {
                Attachment::World => {}
                Attachment::Body(body) => loads.bodies[body] += wrench * sign,
                Attachment::Node(node) => (0..3).for_each(|a| loads.nodes[3 * node + a] += sign * wrench.f[a]),
            }
        }
    }

    /// Adds to the nodes' own blocks what they do to the constraint.
    pub fn add_node_blocks(&self, h: f64, slopes: &mut Slopes) {
        for (side, node) in self.attachments.iter().enumerate().filter_map(|(side, c)| Some((side, node_of(*c)?))) {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let rows = |m: Matrix6<f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[(3 + r, 3 + c)]));
            slopes.dq.add_block(node, node, sign / h, &rows(self.linear.by_displacement(side, true)));
            slopes.dv.add_block(node, node, sign / h, &rows(self.linear.by_velocity(side, true)));
        }
    }

    /// dλ that goes with a change of velocities, for the residual `f`.
    pub fn correct(&self, stage: &Stage, change: &Change, f: &Vector4<f64>) -> Vector4<f64> {
        let sides = self.attachments.iter().enumerate().filter(|(_, attachment)| **attachment != Attachment::World);
        let changed = sides.fold(*f, |f, (side, attachment)| f + self.linear.df(side, &stage.moved(*attachment, change)));
        -(self.linear.inverse * changed)
    }

    /// Adds to every row what the rounding of the law's residual, `unit` of `w` and of what moves as fast as `speed` [m/s] in its steps, may
    /// make of the force there.
    pub fn add_rounding(&self, stage: &Stage, frames: &Frames<f64>, w: &[f64], [unit, speed]: [f64; 2], out: &mut [f64]) {
        let largest = w.iter().fold(0.0_f64, |a, w| a.max(w.abs()));
        let f = unit * (largest + self.rho_n.max(self.rho_t) * speed) / stage.h;
        let wrench: Vector6<f64> = self.linear.gain.abs() * Vector4::repeat(f);
        for attachment in self.attachments {
            match attachment {
                Attachment::World => {}
                Attachment::Node(node) => (0..3).for_each(|a| out[3 * node + a] += wrench[3 + a]),
                Attachment::Body(body) => {
                    let (tree, n) = (&stage.model.tree, stage.model.n_node_dofs());
                    tree.chain(tree.last_dof(body)).for_each(|l| out[n + l] += column(&frames.axes[l].s).abs().dot(&wrench));
                }
            }
        }
    }

    /// Calls `add(node, ∂p/∂q⁺/h at fixed λ)` for the nodes among its frames.
    pub fn visit_fixed_blocks(&self, h: f64, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        for (side, node) in self.attachments.iter().enumerate().filter_map(|(side, c)| Some((side, node_of(*c)?))) {
            let (scale, m) = (if side == 0 { 1.0 / h } else { -1.0 / h }, &self.linear.w_xi[side]);
            add(node, std::array::from_fn(|r| std::array::from_fn(|c| scale * m[(3 + r, 3 + c)])));
        }
    }

    /// How the forces on bodies change with their own bodies, for [`Partials::gather`]; λ following (`condensed`) or fixed.
    pub fn add_partials(&self, h: f64, condensed: bool, out: &mut Vec<WrenchPartial>) {
        for (side, scale) in [(0, 1.0 / h), (1, -1.0 / h)] {
            if let Attachment::Body(body) = self.attachments[side] {
                let displaced = self.linear.by_displacement(side, condensed) * scale;
                let moving = self.linear.by_velocity(side, condensed) * scale;
                out.push(WrenchPartial { body, displaced, moving });
            }
        }
    }
}

impl Link {
    /// Sets the steps of the law, for nodes that resist with these masses \[kg\].
    pub fn set_steps(&mut self, stage: &Stage, resisting: impl Fn(usize) -> f64) {
        let nodes = self.attachments.iter().filter_map(|c| node_of(*c));
        let nodes: f64 = nodes.map(|node| 1.0 / resisting(node).max(f64::MIN_POSITIVE)).sum();
        [self.rho_n, self.rho_t] = self.mobility.map(|mobility| stage.law_step(mobility + nodes));
    }
}

impl Stage<'_> {
    /// Adds to `out` the change of each side's wrench when the other side is displaced by `by`; the composites' columns must be those of
    /// `by`.
    pub(crate) fn add_crossings<'a>(
        &self,
        links: impl Iterator<Item = &'a Link> + Clone,
        by: Displacement,
        condensed: bool,
        (frames, partials): (&Frames<f64>, &Partials),
        out: &mut System,
    ) {
        let mut nodes: Vec<usize> = Vec::new();
        for link in links.clone() {
            match (link.attachments[0], link.attachments[1]) {
                (Attachment::Node(node), Attachment::Body(_)) | (Attachment::Body(_), Attachment::Node(node)) => nodes.push(node),
                _ => {}
            }
        }
        nodes.sort_unstable();
        nodes.dedup();
        let tree = &self.model.tree;
        out.coupling.reset(nodes.into_iter(), tree.nv());
        // degrees of freedom that move a body, with their axes; and with the displacement and change of velocity it then has
        let each_row = |body: usize, visit: &mut dyn FnMut(usize, &Vector6<f64>)| {
            tree.chain(tree.last_dof(body)).for_each(|l| visit(l, &column(&frames.axes[l].s)));
        };
        let each_column = |body: usize, visit: &mut dyn FnMut(usize, Moved)| {
            let velocity = frames.bodies[body].velocity;
            tree.chain(tree.last_dof(body)).for_each(|l| visit(l, partials.change(l, &velocity)));
        };
        for link in links {
            for side in 0..2 {
                // rows of `side`, columns of the other
                let [own, other] = [link.attachments[side], link.attachments[1 - side]];
                let scale = if side == 0 { -1.0 / self.h } else { 1.0 / self.h };
                if !matches!(
                    (own, other),
                    (Attachment::Body(_) | Attachment::Node(_), Attachment::Body(_)) | (Attachment::Body(_), Attachment::Node(_))
                ) {
                    continue;
                }
                let displaced = link.linear.by_displacement(1 - side, condensed) * scale;
                let moving = link.linear.by_velocity(1 - side, condensed) * scale;
                let change = |(xi, v): Moved| displaced * xi + moving * v;
                match (own, other) {
                    (Attachment::Body(i), Attachment::Body(l)) => each_column(l, &mut |dof, moved| {
                        let d = change(moved);
                        each_row(i, &mut |row, s| out.bodies.add(row, dof, s.dot(&d)));
                    }),
                    (Attachment::Node(node), Attachment::Body(l)) => each_column(l, &mut |dof, moved| {
                        let d = change(moved);
                        (0..3).for_each(|a| out.coupling.add_upper(node, a, dof, d[3 + a]));
                    }),
                    (Attachment::Body(i), Attachment::Node(node)) => {
                        for a in 0..3 {
                            let mut unit = Vector6::zeros();
                            unit[3 + a] = 1.0;
                            let d = change((unit * by.cq, unit * by.cv));
                            each_row(i, &mut |row, s| out.coupling.add_lower(row, node, a, s.dot(&d)));
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    /// The displacement of a frame and the change of its velocity that go with a change of velocities.
    pub(crate) fn moved(&self, attachment: Attachment, change: &Change) -> Moved {
        match attachment {
            Attachment::World => (Vector6::zeros(), Vector6::zeros()),
            Attachment::Node(node) => {
                let d = &change.d[3 * node..3 * node + 3];
                let v = Vector6::new(0.0, 0.0, 0.0, d[0], d[1], d[2]);
                (v * (self.h * self.scheme.free.a1), v)
            }
            Attachment::Body(body) => {
                let (xi, own) = change.bodies[body];
                (xi, own + moved_along(&xi, &change.frames.bodies[body].velocity))
            }
        }
    }
}

impl Link {
    /// One over the effective mass along the normal and across [1/kg].
    pub(crate) fn weights(&self) -> [f64; 4] {
        [CONSTRAINTS.rho / self.rho_n, CONSTRAINTS.rho / self.rho_t, CONSTRAINTS.rho / self.rho_t, CONSTRAINTS.rho / self.rho_t]
    }
}
