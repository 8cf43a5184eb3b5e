//! Elastic stretch of an edge.

use super::stencil::{Compact, Edge, add_edge_blocks, add_edge_force, add_outer, diagonal, visit_edge};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// E = ½ EA l₀ ε², ε = |e|/l₀ − 1, l₀ = fraction · length; f₀ = −f₁ = EA ε t (a stretched edge pulls its nodes together).
///
/// Nodes: the two ends. Parameters: rope length \[m\], EA \[N\]. Constant: the edge's fraction of the length [-].
/// Not finite at |e| = 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct StretchLaw;

fn rest<S: Real>(p: &[S], fraction: f64) -> S {
    p[0] * fraction
}

impl Law for StretchLaw {
    fn name(&self) -> &str {
        "stretch"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let edge = Edge::new(&q[0], &q[1]);
        let strain = edge.length / rest(p, constants[0]) - 1.0;
        let tau = edge.tangent * (p[1] * strain);
        f[0] += tau;
        f[1] -= tau;
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        let rest = rest(p, constants[0]);
        let strain = Edge::new(&q[0], &q[1]).length / rest - 1.0;
        p[1] * rest * strain * strain * 0.5
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`StretchLaw`] on many edges, with hand-derived Jacobians: ∂τ/∂e = (EA/l₀) t tᵀ + (EA ε/|e|)(I − t tᵀ).
#[derive(Clone, Debug)]
pub struct Stretch {
    automatic: Automatic<StretchLaw>,
    compact: Vec<Compact<2, 2>>,
}

impl Stretch {
    /// Stretch of the elements' edges; see [`StretchLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(StretchLaw.name(), &elements);
        Self { automatic: Automatic::new(StretchLaw, elements), compact }
    }

    /// Calls `each(index, element, edge, EA, ε)` for every edge with a stiffness.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(usize, &Compact<2, 2>, &Edge<f64>, f64, f64)) {
        for (i, e) in self.compact.iter().enumerate() {
            let p = e.values(at.theta);
            if p[1] != 0.0 {
                let [x0, x1] = e.positions(at);
                let edge = Edge::new(&x0, &x1);
                each(i, e, &edge, p[1], edge.length / rest(&p, e.constant) - 1.0);
            }
        }
    }

    /// Forces, and ∂τ/∂e = (EA/l₀) t tᵀ + (N/|e|)(I − t tᵀ) with the axial force N that `axial(element, EA ε)` gives.
    #[inline]
    fn jacobian(&self, at: &Point, axial: impl Fn(usize, f64) -> f64, f: &mut [f64], dq: &mut NodeMatrix) {
        self.for_each(at, |i, e, edge, stiffness, strain| {
            add_edge_force(f, e.nodes, &(edge.tangent * (stiffness * strain)));
            let across = axial(i, stiffness * strain) / edge.length;
            let along = stiffness * (1.0 + strain) / edge.length;
            let mut k = diagonal(across);
            add_outer(&mut k, &(edge.tangent * (along - across)), &edge.tangent);
            add_edge_blocks(dq, e.nodes, &k);
        });
    }
}

impl Term for Stretch {
    fn name(&self) -> &str {
        StretchLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |_, e, edge, stiffness, strain| {
            add_edge_force(f, e.nodes, &(edge.tangent * (stiffness * strain)));
        });
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, |_, here| here, f, dq);
    }

    fn n_axial(&self) -> usize {
        self.compact.len()
    }

    fn predict_axial(&self, at: &Point, dq: &[f64], axial: &mut [f64]) {
        self.for_each(at, |i, e, edge, stiffness, strain| {
            let [a, b] = e.nodes.map(|n| Vec3::new(dq[3 * n], dq[3 * n + 1], dq[3 * n + 2]));
            let stretched = edge.tangent.dot(&(b - a)) / edge.length;
            axial[i] = stiffness * (strain + (1.0 + strain) * stretched);
        });
    }

    fn add_mixed_jacobian(&self, at: &Point, axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, |i, _| axial[i], f, dq);
    }

    /// Edges under compression hold nothing across.
    fn add_stable_jacobian(&self, at: &Point, axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, |i, _| axial[i].max(0.0), f, dq);
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let [x0, x1] = e.positions(at);
            let edge = Edge::new(&x0, &x1);
            let ratio = edge.length / rest(&p, e.constant);
            visit_edge(e.nodes, e.params[0], &(edge.tangent * (-p[1] * ratio / p[0])), visit);
            visit_edge(e.nodes, e.params[1], &(edge.tangent * (ratio - 1.0)), visit);
        }
    }

    fn energy(&self, at: &Point) -> f64 {
        self.automatic.energy(at)
    }

    fn inner(&self) -> bool {
        true
    }

    fn symmetric(&self, _theta: &[f64]) -> bool {
        true
    }

    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.automatic.visit_stencils(visit);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::check;

    #[test]
    fn kernel_equals_law_and_energy() {
        let elements = check::elements(2, 2);
        let (kernel, law) = (Stretch::new(elements.clone()), Automatic::new(StretchLaw, elements));
        check::same(&kernel, &law);
        check::force_is_energy_slope(&StretchLaw, &law);
        check::invariant(&kernel);
        check::jacobians_symmetric(&kernel);
    }

    #[test]
    fn no_stiffness_no_force_but_a_slope() {
        let kernel = Stretch::new(check::elements(2, 2));
        check::zero_coefficient(&kernel, 1);
    }

    #[test]
    fn ten_percent_strain_pulls_with_a_tenth_of_the_stiffness() {
        let kernel = Stretch::new(vec![Element { nodes: vec![0, 1], params: vec![0, 1], constants: vec![0.5] }]);
        let mut f = [0.0; 6];
        kernel.add_force(&Point { q: &[0.0, 0.0, 0.0, 1.1, 0.0, 0.0], v: &[0.0; 6], theta: &[2.0, 50.0] }, &mut f);
        assert!((f[0] - 5.0).abs() < 1e-13 && (f[3] + 5.0).abs() < 1e-13);
    }
}
