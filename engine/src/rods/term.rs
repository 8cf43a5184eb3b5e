//! Forces and moments of bent and twisted joints.

use super::joint::{Gradient, Joint, TURN, VARIABLES};
use super::simd::{Evaluation, Sums};
use super::{Remembered, RodJoint, RodPoint, RodSection, Rods};
use crate::terms::section::{SectionLaw, SectionPoint};
use pliant_linalg::NodeMatrix;

/// Numbers of a joint: three nodes and two twists.
pub(super) const ROWS: usize = 11;
/// Places of the nodes' and the twists' rows among them, in the order of storage.
pub(super) const NODE: [usize; 3] = [0, 4, 8];
pub(super) const TWIST: [usize; 2] = [3, 7];

impl Rods {
    /// Rows of a joint in the order of [`NODE`] and [`TWIST`].
    pub(super) fn rows(&self, joint: &RodJoint) -> [usize; ROWS] {
        let mut rows = [0; ROWS];
        for (place, node) in NODE.iter().zip(joint.nodes) {
            (0..3).for_each(|a| rows[place + a] = 3 * node + a);
        }
        for (place, edge) in TWIST.iter().zip(joint.edges) {
            rows[*place] = self.row(edge);
        }
        rows
    }

    /// ẏ of a joint at velocities `v`: of its edges [m/s], and of the material about them [rad/s].
    pub(super) fn rates(&self, joint: &RodJoint, v: &[f64]) -> Gradient {
        let [n0, n1, n2] = joint.nodes;
        let edge = |from: usize, to: usize, a: usize| v[3 * to + a] - v[3 * from + a];
        let mut y = [0.0; VARIABLES];
        for a in 0..3 {
            (y[a], y[3 + a]) = (edge(n0, n1, a), edge(n1, n2, a));
        }
        (y[TURN[0]], y[TURN[1]]) = (v[self.row(joint.edges[0])], v[self.row(joint.edges[1])]);
        y
    }

    /// Calls `visit(joint number, its laws' sum)` for every joint.
    pub(super) fn for_joints(&self, mut visit: impl FnMut(usize, &RodSection)) {
        for section in &self.sections {
            section.joints.clone().for_each(|j| visit(j, section));
        }
    }

    /// Where the laws of joint `j` are evaluated, and ẏ.
    #[inline]
    fn section_point<'a>(
        &self,
        j: usize,
        joint: &Joint,
        v: &[f64],
        theta: &'a [f64],
        before: Remembered,
    ) -> (SectionPoint<'a>, Gradient) {
        let y = self.rates(&self.joints[j], v);
        (SectionPoint { rate: joint.rates(&y), ..self.resting_point(j, joint, theta, before) }, y)
    }

    /// The same without rates.
    #[inline]
    pub(super) fn resting_point<'a>(&self, j: usize, joint: &Joint, theta: &'a [f64], before: Remembered) -> SectionPoint<'a> {
        let (fraction, strain, rate) = (self.joints[j].fraction, joint.strain, [0.0; 3]);
        let past = before.past.strain(j).unwrap_or(strain);
        SectionPoint { joint: j, fraction, strain, rate, theta, past, memory: &[], elapsed: before.elapsed }
    }

    /// `f += f(q, v; θ)` [N, N·m].
    pub(crate) fn add_force(&self, at: &RodPoint, v: &[f64], theta: &[f64], before: Remembered, f: &mut [f64]) {
        Evaluation { rods: self, at, v, theta, before }.add_to(Sums { f, matrices: None, whole: true });
    }

    pub(super) fn add_joint_force(&self, j: usize, g: &Gradient, f: &mut [f64]) {
        let joint = &self.joints[j];
        let [n0, n1, n2] = joint.nodes;
        for a in 0..3 {
            f[3 * n0 + a] += g[a];
            f[3 * n1 + a] += g[3 + a] - g[a];
            f[3 * n2 + a] -= g[3 + a];
        }
        (0..2).for_each(|k| f[self.row(joint.edges[k])] -= g[TURN[k]]);
    }

    /// As [`Rods::add_force`], and `dq += ∂f/∂q`, `dv += ∂f/∂v` along the displacements of [`super`]; of these what resists alone, gᵀ C g
    /// with the stiffness C of strains, unless they are asked for `whole`.
    #[allow(clippy::too_many_arguments)] // a force and both its matrices, of everything that a rod's force depends on
    pub(crate) fn add_jacobian(
        &self,
        at: &RodPoint,
        v: &[f64],
        theta: &[f64],
        before: Remembered,
        whole: bool,
        f: &mut [f64],
        dq: &mut NodeMatrix,
        dv: &mut NodeMatrix,
    ) {
        Evaluation { rods: self, at, v, theta, before }.add_to(Sums { f, matrices: Some([dq, dv]), whole });
    }

    /// Calls `visit(row, parameter, ∂f_row/∂θ_parameter)` for every structural nonzero.
    pub(crate) fn visit_theta(
        &self,
        at: &RodPoint,
        v: &[f64],
        theta: &[f64],
        before: Remembered,
        visit: &mut dyn FnMut(usize, usize, f64),
    ) {
        self.for_joints(|j, section| {
            let joint = self.joint(j, at);
            let (point, _) = self.section_point(j, &joint, v, theta, before);
            let rows = self.rows(&self.joints[j]);
            section.for_laws(&point, before.z, |law, point| {
                law.visit_theta(point, &mut |param, m| {
                    let g = joint.pull(&m);
                    for (&row, value) in rows.iter().zip(expanded_force(&g)) {
                        visit(row, param, value);
                    }
                });
            });
        });
    }

    /// Elastic energy \[J\].
    pub(crate) fn energy(&self, at: &RodPoint, theta: &[f64], before: Remembered) -> f64 {
        let mut sum = 0.0;
        self.for_joints(|j, section| {
            let joint = self.joint(j, at);
            let mut own = 0.0;
            let point = self.resting_point(j, &joint, theta, before);
            section.for_laws(&point, before.z, |law, point| own += law.energy(point));
            sum += own;
        });
        sum
    }

    /// Nodes that act on each other, joint by joint; the ends of an edge without a joint too.
    pub(crate) fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.edges.iter().for_each(|edge| visit(&edge.nodes));
        self.joints.iter().for_each(|joint| visit(&joint.nodes));
        // carrying an edge's axes along makes its nodes matter to what its twist acts on: the nodes of both its joints
        for k in 0..self.edges.len() {
            let mut nodes: Vec<usize> =
                self.joints.iter().filter(|joint| joint.edges.contains(&k)).flat_map(|joint| joint.nodes).collect();
            nodes.sort_unstable();
            nodes.dedup();
            for &node in &nodes {
                self.edges[k].nodes.iter().for_each(|&own| visit(&[node, own]));
            }
        }
    }
}

impl RodSection {
    /// Calls `visit(law, where it is evaluated)` with what each law remembers of the joint.
    #[inline]
    pub(super) fn for_laws(&self, at: &SectionPoint, z: &[f64], mut visit: impl FnMut(&dyn SectionLaw, &SectionPoint)) {
        for (k, law) in self.laws.iter().enumerate() {
            match self.place(k, at.joint) {
                place if place.is_empty() => visit(&**law, at),
                place => visit(&**law, &SectionPoint { memory: &z[place], ..*at }),
            }
        }
    }
}

/// The forces of a gradient by y, in the order of [`NODE`] and [`TWIST`].
pub(super) fn expanded_force(g: &Gradient) -> [f64; ROWS] {
    let mut out = [0.0; ROWS];
    for a in 0..3 {
        out[NODE[0] + a] = g[a];
        out[NODE[1] + a] = g[3 + a] - g[a];
        out[NODE[2] + a] = -g[3 + a];
    }
    (0..2).for_each(|k| out[TWIST[k]] = -g[TURN[k]]);
    out
}
