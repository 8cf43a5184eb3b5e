//! Edges that are longer or shorter at rest than their share of the rope.

use super::stencil::{Compact, Edge, add_edge_blocks, add_edge_force, add_outer, diagonal, visit_edge};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// Contribution of a rest strain δ to [`StretchLaw`](super::StretchLaw): E = ½ EA l₀ [(ε − δ)² − ε²], ε = |e|/l₀ − 1, so that the edge is without
/// force at the length l₀ (1 + δ); f₀ = −f₁ = −EA δ t.
///
/// Nodes: the two ends. Parameters: rope length \[m\], EA \[N\], δ [-]. Constant: the edge's fraction of the length [-]. Masses and the
/// lengths that bending and damping are spread over stay those of l₀: δ is meant for errors of a length, a few per cent.
#[derive(Clone, Copy, Debug, Default)]
pub struct RestStrainLaw;

impl Law for RestStrainLaw {
    fn name(&self) -> &str {
        "rest strain"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], _constants: &[f64], f: &mut [Vec3<S>]) {
        let tau = Edge::new(&q[0], &q[1]).tangent * (p[1] * p[2]);
        f[0] -= tau;
        f[1] += tau;
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        let rest = p[0] * constants[0];
        let strain = Edge::new(&q[0], &q[1]).length / rest - 1.0;
        p[1] * rest * p[2] * (p[2] * 0.5 - strain)
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`RestStrainLaw`] on many edges, with hand-derived Jacobians: ∂τ/∂e = −(EA δ/|e|)(I − t tᵀ).
#[derive(Clone, Debug)]
pub struct RestStrain {
    automatic: Automatic<RestStrainLaw>,
    compact: Vec<Compact<2, 3>>,
}

impl RestStrain {
    /// Rest strains of the elements' edges; see [`RestStrainLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(RestStrainLaw.name(), &elements);
        Self { automatic: Automatic::new(RestStrainLaw, elements), compact }
    }

    /// Calls `each(element, edge, EA δ)` for every edge with a rest strain.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Compact<2, 3>, &Edge<f64>, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            if p[1] * p[2] != 0.0 {
                let [x0, x1] = e.positions(at);
                each(e, &Edge::new(&x0, &x1), p[1] * p[2]);
            }
        }
    }

    /// Forces, and ∂τ/∂e with what `across(EA δ)` leaves of the force across the edge.
    #[inline]
    fn jacobian(&self, at: &Point, across: impl Fn(f64) -> f64, f: &mut [f64], dq: &mut NodeMatrix) {
        self.for_each(at, |e, edge, push| {
            add_edge_force(f, e.nodes, &(edge.tangent * -push));
            let k = -across(push) / edge.length;
            let mut block = diagonal(k);
            add_outer(&mut block, &(edge.tangent * -k), &edge.tangent);
            add_edge_blocks(dq, e.nodes, &block);
        });
    }
}

impl Term for RestStrain {
    fn name(&self) -> &str {
        RestStrainLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |e, edge, push| add_edge_force(f, e.nodes, &(edge.tangent * -push)));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, |push| push, f, dq);
    }

    /// A force that pushes the ends apart has no stiffness across.
    fn add_stable_jacobian(&self, at: &Point, _axial: &[f64], f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.jacobian(at, |push| push.min(0.0), f, dq);
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let [x0, x1] = e.positions(at);
            let t = Edge::new(&x0, &x1).tangent;
            visit_edge(e.nodes, e.params[1], &(t * -p[2]), visit);
            visit_edge(e.nodes, e.params[2], &(t * -p[1]), visit);
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
    use crate::terms::{Stretch, check};

    #[test]
    fn kernel_equals_law_and_energy() {
        let elements = check::elements(2, 3);
        let (kernel, law) = (RestStrain::new(elements.clone()), Automatic::new(RestStrainLaw, elements));
        check::same(&kernel, &law);
        check::force_is_energy_slope(&RestStrainLaw, &law);
        check::invariant(&kernel);
        check::jacobians_symmetric(&kernel);
    }

    #[test]
    fn no_strain_no_force_but_a_slope() {
        check::zero_coefficient(&RestStrain::new(check::elements(2, 3)), 2);
    }

    #[test]
    fn an_edge_is_without_force_and_energy_at_its_own_rest_length() {
        let edge = |params: Vec<usize>| vec![Element { nodes: vec![0, 1], params, constants: vec![0.5] }];
        let (stretch, own) = (Stretch::new(edge(vec![0, 1])), RestStrain::new(edge(vec![0, 1, 2])));
        let at = Point { q: &[0.0, 0.0, 0.0, 1.03, 0.0, 0.0], v: &[0.0; 6], theta: &[2.0, 50.0, 0.03] };
        let mut f = [0.0; 6];
        stretch.add_force(&at, &mut f);
        own.add_force(&at, &mut f);
        assert!(f.iter().all(|f| f.abs() < 1e-12), "{f:?}");
        assert!((stretch.energy(&at) + own.energy(&at)).abs() < 1e-13);
    }
}
