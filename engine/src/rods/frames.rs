//! The material axes of all edges at a configuration.

use super::constants::RODS;
use super::joint::{EdgeFrame, Joint};
use super::{RodEdge, RodSection, Rods};
use pliant_math::Vec3;
use pliant_math::transport::{angle, carried, unwrapped};
use std::sync::Arc;

/// Edges' axes and joints' twists where forces are evaluated, and what z is there.
#[derive(Clone, Debug, Default)]
pub struct RodPoint {
    pub(crate) edges: Vec<EdgeFrame>,
    /// τ of every joint \[rad\].
    pub(crate) twists: Vec<f64>,
    /// z's part: reference axes, then reference twists.
    pub(crate) frames: Vec<f64>,
    /// The configurations it was evaluated for: start and end of the transport, and the axes there.
    from: Vec<f64>,
    to: Vec<f64>,
    given: Vec<f64>,
    /// Tangents there.
    begin: Vec<Vec3<f64>>,
}

pub(super) fn vector(x: &[f64], i: usize) -> Vec3<f64> {
    Vec3::new(x[3 * i], x[3 * i + 1], x[3 * i + 2])
}

/// The edge vector at positions `q` \[m\].
pub(super) fn edge_vector(edge: &RodEdge, q: &[f64]) -> Vec3<f64> {
    vector(q, edge.nodes[1]) - vector(q, edge.nodes[0])
}

impl Rods {
    /// Carries z's part `frames`, which belongs to positions `from`, to the configuration `q`, and evaluates the axes there. What `out` has
    /// already is not evaluated again.
    pub(crate) fn evaluate(&self, from: &[f64], frames: &[f64], q: &[f64], out: &mut RodPoint) {
        if self.edges.is_empty() {
            return;
        }
        let (n, nodes) = (3 * self.n_nodes + self.edges.len(), 3 * self.n_nodes);
        let known = out.given == frames && out.from == from[..nodes];
        if known && out.to == q[..n] {
            return;
        }
        if !known {
            replace(&mut out.given, frames);
            replace(&mut out.from, &from[..nodes]);
            out.begin.clear();
            out.begin.extend(self.edges.iter().map(|edge| edge_vector(edge, from).normalize()));
        }
        replace(&mut out.to, &q[..n]);
        out.edges.clear();
        out.twists.clear();
        out.frames.clear();
        for (k, edge) in self.edges.iter().enumerate() {
            let e = edge_vector(edge, q);
            let length = e.norm();
            let tangent = e / length;
            let d = carried(&out.begin[k], &tangent, &vector(frames, k));
            // rounding would pile up over many steps
            let d = (d - tangent * tangent.dot(&d)).normalize();
            let (sin, cos) = q[self.row(k)].sin_cos();
            let across = tangent.cross(&d);
            let first = d * cos + across * sin;
            out.edges.push(EdgeFrame { tangent, length, axes: [first, across * cos - d * sin] });
            out.frames.extend_from_slice(d.as_slice());
        }
        for (j, joint) in self.joints.iter().enumerate() {
            let [one, two] = joint.edges;
            let near = frames[3 * self.edges.len() + j];
            let m = unwrapped(self.reference_twist(j, &out.edges, &out.frames), near);
            out.twists.push(q[self.row(two)] - q[self.row(one)] + m);
            out.frames.push(m);
        }
    }

    /// Edge `k` at positions `q`, which z's part `frames` belongs to: its tangent, its two material axes, and its length \[m\].
    pub fn edge_axes(&self, k: usize, q: &[f64], frames: &[f64]) -> ([Vec3<f64>; 3], f64) {
        let e = edge_vector(&self.edges[k], q);
        let (length, d, (sin, cos)) = (e.norm(), vector(frames, k), q[self.row(k)].sin_cos());
        let tangent = e / length;
        let first = d * cos + tangent.cross(&d) * sin;
        ([tangent, first, tangent.cross(&first)], length)
    }

    /// The twist between reference axes at joint `j`, up to whole turns.
    fn reference_twist(&self, j: usize, edges: &[EdgeFrame], frames: &[f64]) -> f64 {
        let [one, two] = self.joints[j].edges;
        let (t1, t2) = (&edges[one].tangent, &edges[two].tangent);
        angle(&carried(t1, t2, &vector(frames, one)), &vector(frames, two), t2)
    }

    /// Joint `j` at the evaluated configuration.
    #[inline]
    pub(crate) fn joint(&self, j: usize, at: &RodPoint) -> Joint {
        let [one, two] = self.joints[j].edges;
        Joint::new(&at.edges[one], &at.edges[two], at.twists[j])
    }

    /// z's part at positions `q` for these reference axes: the twists between them are taken without whole turns.
    pub(crate) fn with_twists(&self, q: &[f64], references: &[Vec3<f64>]) -> Vec<f64> {
        let mut frames: Vec<f64> = references.iter().flat_map(|d| [d.x, d.y, d.z]).collect();
        let frame = |edge: &RodEdge| EdgeFrame { tangent: edge_vector(edge, q).normalize(), ..EdgeFrame::default() };
        let edges: Vec<EdgeFrame> = self.edges.iter().map(frame).collect();
        let twists: Vec<f64> = (0..self.joints.len()).map(|j| self.reference_twist(j, &edges, &frames)).collect();
        frames.extend(twists);
        frames
    }

    /// Joins the ends of closed rods: z's part `frames` at positions `q` gets the whole turns, and the joint its twist at rest, with which the
    /// ring's twist is even. At rest the ends are turned against each other by what a closed frame leaves over, half a turn at most.
    pub(crate) fn join_ends(&mut self, q: &[f64], frames: &mut [f64]) {
        let (n_edges, n_joints) = (self.edges.len(), self.joints.len());
        for s in 0..self.sections.len() {
            let Some(twist) = self.sections[s].seam else { continue };
            let j = self.sections[s].joints.start;
            let [one, two] = self.joints[j].edges;
            let (turned, even) = (q[self.row(two)] - q[self.row(one)], twist * self.joints[j].fraction);
            let m = &mut frames[3 * n_edges + j];
            *m = unwrapped(*m, even - turned);
            let mut strains = vec![[0.0; 3]; n_joints];
            strains[j][2] = turned + *m - even;
            self.sections[s].rest(&strains);
        }
    }

    /// Takes the strains at this configuration for those of the rest shape, where the scene asks for that.
    pub(crate) fn rest_at(&mut self, at: &RodPoint) {
        let strains: Vec<[f64; 3]> = (0..self.joints.len()).map(|j| self.joint(j, at).strain).collect();
        self.sections.iter_mut().filter(|s| s.rest_initial).for_each(|section| section.rest(&strains));
    }

    /// The first edge whose reference axis in `frames` is not a unit vector normal to it at `q`.
    pub(crate) fn misplaced(&self, q: &[f64], frames: &[f64]) -> Option<usize> {
        let fits = |(k, edge): (usize, &RodEdge)| {
            let (t, d) = (edge_vector(edge, q).normalize(), vector(frames, k));
            t.dot(&d).abs() < RODS.loose && (d.norm_squared() - 1.0).abs() < RODS.loose
        };
        (0..self.edges.len()).zip(&self.edges).find(|pair| !fits(*pair)).map(|(k, _)| k)
    }
}

impl RodSection {
    /// Takes these strains, joint by joint of the model, for those at rest.
    fn rest(&mut self, strains: &[[f64; 3]]) {
        self.laws = self.laws.iter().map(|law| law.resting(strains).unwrap_or_else(|| Arc::clone(law))).collect();
    }
}

fn replace(to: &mut Vec<f64>, from: &[f64]) {
    to.clear();
    to.extend_from_slice(from);
}
