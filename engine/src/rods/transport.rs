//! How a displacement shows up after edges were carried from one configuration to another.

use super::Rods;
use super::frames::edge_vector;
use pliant_math::Vec3;

/// ψ_a and ψ_b of every edge [1/m]: see [`super`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransportDerivative {
    edges: Vec<Carried>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Carried {
    nodes: [usize; 2],
    row: usize,
    before: Vec3<f64>,
    after: Vec3<f64>,
}

impl TransportDerivative {
    /// From positions `a` to positions `b`.
    pub(crate) fn evaluate(&mut self, rods: &Rods, a: &[f64], b: &[f64]) {
        self.edges.clear();
        for (k, edge) in rods.edges.iter().enumerate() {
            let (ea, eb) = (edge_vector(edge, a), edge_vector(edge, b));
            let (la, lb) = (ea.norm(), eb.norm());
            // (a × b)/(1 + a·b) of the unit vectors
            let turn = ea.cross(&eb) / (la * lb + ea.dot(&eb));
            self.edges.push(Carried { nodes: edge.nodes, row: rods.row(k), before: -turn / la, after: -turn / lb });
        }
    }

    /// Of all rods, from positions `a` to positions `b`.
    pub fn between(rods: &Rods, a: &[f64], b: &[f64]) -> Self {
        let mut carry = Self::default();
        carry.evaluate(rods, a, b);
        carry
    }

    /// Whether there is nothing to carry.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// `x_α += ψ_a·δe`, row-major with `columns`: to be called while `x` is the displacement at a.
    pub fn add_before(&self, x: &mut [f64], columns: usize) {
        self.edges.iter().for_each(|e| e.add(&e.before, x, columns));
    }

    /// `x_α += ψ_b·δe`: to be called when the nodes' rows of `x` are the displacement at b.
    pub fn add_after(&self, x: &mut [f64], columns: usize) {
        self.edges.iter().for_each(|e| e.add(&e.after, x, columns));
    }

    /// The transposed [`TransportDerivative::add_before`], of one column.
    pub fn pull_before(&self, x: &mut [f64]) {
        self.edges.iter().for_each(|e| e.pull(&e.before, x));
    }

    /// `x += ` row `row` of 1 + ψ_a.
    pub fn add_row(&self, row: usize, x: &mut [f64]) {
        x[row] += 1.0;
        let edge = self.edges.first().and_then(|first| self.edges.get(row.checked_sub(first.row)?));
        if let Some(edge) = edge {
            edge.add_to_nodes(&edge.before, 1.0, x);
        }
    }

    /// The transposed [`TransportDerivative::add_after`], of one column.
    pub fn pull_after(&self, x: &mut [f64]) {
        self.edges.iter().for_each(|e| e.pull(&e.after, x));
    }

    /// Calls `visit(edge, its nodes, ψ_b)`.
    pub(crate) fn visit_after(&self, mut visit: impl FnMut(usize, [usize; 2], Vec3<f64>)) {
        self.edges.iter().enumerate().for_each(|(k, e)| visit(k, e.nodes, e.after));
    }
}

impl Carried {
    #[inline]
    fn add(&self, psi: &Vec3<f64>, x: &mut [f64], columns: usize) {
        let [from, to] = self.nodes;
        // twists' rows are behind all nodes'
        let (nodes, twists) = x.split_at_mut(self.row * columns);
        let out = &mut twists[..columns];
        for a in 0..3 {
            let low = &nodes[(3 * from + a) * columns..][..columns];
            let high = &nodes[(3 * to + a) * columns..][..columns];
            for ((o, l), h) in out.iter_mut().zip(low).zip(high) {
                *o += psi[a] * (h - l);
            }
        }
    }

    #[inline]
    fn pull(&self, psi: &Vec3<f64>, x: &mut [f64]) {
        self.add_to_nodes(psi, x[self.row], x);
    }

    #[inline]
    fn add_to_nodes(&self, psi: &Vec3<f64>, by: f64, x: &mut [f64]) {
        for a in 0..3 {
            x[3 * self.nodes[1] + a] += psi[a] * by;
            x[3 * self.nodes[0] + a] -= psi[a] * by;
        }
    }
}
