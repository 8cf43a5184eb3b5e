//! Derivatives of a [`Law`] by forward-mode dual numbers, a chunk of directions at a time.

use super::{Element, Law, Point, Term};
use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};
use pliant_linalg::NodeMatrix;
use pliant_math::Vec3;

const CHUNK: usize = 6;
pub(super) const MAX_NODES: usize = 8;
pub(super) const MAX_PARAMS: usize = 16;
type Dual = DualSVec64<CHUNK>;

/// A law and its elements as a [`Term`]: the derivatives with respect to positions, velocities and parameters are automatic.
#[derive(Clone, Debug)]
pub struct Automatic<L> {
    law: L,
    elements: Vec<Element>,
}

impl<L: Law> Automatic<L> {
    /// Largest number of nodes in an element.
    pub const MAX_NODES: usize = MAX_NODES;
    /// Largest number of parameters of an element.
    pub const MAX_PARAMS: usize = MAX_PARAMS;

    /// Joins a law with the elements it acts on.
    ///
    /// # Panics
    /// If an element exceeds [`Self::MAX_NODES`] or [`Self::MAX_PARAMS`]: a mistake in the law's own file, not in user data.
    pub fn new(law: L, elements: Vec<Element>) -> Self {
        assert!(elements.iter().all(|e| e.nodes.len() <= MAX_NODES && e.params.len() <= MAX_PARAMS));
        Self { law, elements }
    }

    /// The law.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The elements.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Evaluates element `e` with the dual directions `first .. first + CHUNK` of (q, v, p) seeded.
    fn eval_chunk(&self, e: &Element, at: &Point, first: usize, out: &mut [Vec3<Dual>; MAX_NODES]) {
        let n = e.nodes.len();
        let zero = Vec3::repeat(Dual::from_re(0.0));
        let (mut q, mut v, mut p) = ([zero; MAX_NODES], [zero; MAX_NODES], [Dual::from_re(0.0); MAX_PARAMS]);
        let seeded = |value: f64, direction: usize| match direction.checked_sub(first) {
            Some(k) if k < CHUNK => Dual::new(value, Derivative::some(unit(k))),
            _ => Dual::from_re(value),
        };
        for (k, &node) in e.nodes.iter().enumerate() {
            for a in 0..3 {
                q[k][a] = seeded(at.q[3 * node + a], 3 * k + a);
                v[k][a] = seeded(at.v[3 * node + a], 3 * (n + k) + a);
            }
        }
        for (k, &param) in e.params.iter().enumerate() {
            p[k] = seeded(at.theta[param], 6 * n + k);
        }
        *out = [zero; MAX_NODES];
        self.law.force(&q[..n], &v[..n], &p[..e.params.len()], &e.constants, &mut out[..n]);
    }
}

fn unit(k: usize) -> SVector<f64, CHUNK> {
    let mut e = SVector::zeros();
    e[k] = 1.0;
    e
}

fn slopes(x: &Dual) -> SVector<f64, CHUNK> {
    x.eps.0.unwrap_or_else(SVector::zeros)
}

/// The parameters of an element, gathered into `buffer`.
fn values<'a>(e: &Element, theta: &[f64], buffer: &'a mut [f64; MAX_PARAMS]) -> &'a [f64] {
    for (value, &index) in buffer.iter_mut().zip(&e.params) {
        *value = theta[index];
    }
    &buffer[..e.params.len()]
}

impl<L: Law> Term for Automatic<L> {
    fn name(&self) -> &str {
        self.law.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        for e in &self.elements {
            let n = e.nodes.len();
            let zero = Vec3::zeros();
            let (mut q, mut v, mut p, mut out) = ([zero; MAX_NODES], [zero; MAX_NODES], [0.0; MAX_PARAMS], [zero; MAX_NODES]);
            for (k, &node) in e.nodes.iter().enumerate() {
                (q[k], v[k]) = (at.position(node), at.velocity(node));
            }
            self.law.force(&q[..n], &v[..n], values(e, at.theta, &mut p), &e.constants, &mut out[..n]);
            for (k, &node) in e.nodes.iter().enumerate() {
                for a in 0..3 {
                    f[3 * node + a] += out[k][a];
                }
            }
        }
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        let mut out = [Vec3::repeat(Dual::from_re(0.0)); MAX_NODES];
        for e in &self.elements {
            let n = e.nodes.len();
            for first in (0..6 * n).step_by(CHUNK) {
                self.eval_chunk(e, at, first, &mut out);
                for (k, &node) in e.nodes.iter().enumerate() {
                    for (a, component) in out[k].iter().enumerate() {
                        let row = 3 * node + a;
                        if first == 0 {
                            f[row] += component.re;
                        }
                        let s = slopes(component);
                        for (direction, slope) in (first..6 * n).zip(s.iter()) {
                            let to_q = direction < 3 * n;
                            let local = if to_q { direction } else { direction - 3 * n };
                            let column = 3 * e.nodes[local / 3] + local % 3;
                            if to_q { dq.add(row, column, *slope) } else { dv.add(row, column, *slope) }
                        }
                    }
                }
            }
        }
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        let mut out = [Vec3::repeat(Dual::from_re(0.0)); MAX_NODES];
        for e in &self.elements {
            let offset = 6 * e.nodes.len();
            for first in (0..e.params.len()).step_by(CHUNK) {
                self.eval_chunk(e, at, offset + first, &mut out);
                for (k, &node) in e.nodes.iter().enumerate() {
                    for (a, component) in out[k].iter().enumerate() {
                        let s = slopes(component);
                        for (param, slope) in e.params[first..].iter().zip(s.iter()) {
                            visit(3 * node + a, *param, *slope);
                        }
                    }
                }
            }
        }
    }

    fn energy(&self, at: &Point) -> f64 {
        let of = |e: &Element| {
            let mut q = [Vec3::zeros(); MAX_NODES];
            for (x, &node) in q.iter_mut().zip(&e.nodes) {
                *x = at.position(node);
            }
            self.law.energy(&q[..e.nodes.len()], values(e, at.theta, &mut [0.0; MAX_PARAMS]), &e.constants)
        };
        self.elements.iter().map(of).sum()
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.elements.iter().all(|e| self.law.symmetric(values(e, theta, &mut [0.0; MAX_PARAMS])))
    }

    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.elements.iter().for_each(|e| visit(&e.nodes));
    }
}
