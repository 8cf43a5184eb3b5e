//! Viscous resistance of an edge to stretching.

use super::stencil::{Compact, Edge, add_edge_blocks, add_edge_force, add_outer, diagonal, visit_edge};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// R = ½ c_s l₀ ε̇², ε̇ = t·w/l₀, w = v₁ − v₀, l₀ = fraction · length; f = −∂R/∂v, so f₀ = −f₁ = (c_s/l₀) (t·w) t.
///
/// Nodes: the two ends. Parameters: rope length \[m\], c_s [N·s]. Constant: the edge's fraction of the length [-].
/// Rigid motions dissipate nothing. Not finite at |e| = 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct StretchDampingLaw;

impl Law for StretchDampingLaw {
    fn name(&self) -> &str {
        "stretch_damping"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let t = Edge::new(&q[0], &q[1]).tangent;
        let tau = t * (p[1] / (p[0] * constants[0]) * t.dot(&(v[1] - v[0])));
        f[0] += tau;
        f[1] -= tau;
    }

    fn symmetric(&self, p: &[f64]) -> bool {
        p[1] == 0.0
    }
}

/// [`StretchDampingLaw`] on many edges, with hand-derived Jacobians, b = c_s/l₀, P = I − t tᵀ:
/// ∂τ/∂w = b t tᵀ,  ∂τ/∂e = b (t (P w)ᵀ + (t·w) P)/|e|.
#[derive(Clone, Debug)]
pub struct StretchDamping {
    automatic: Automatic<StretchDampingLaw>,
    compact: Vec<Compact<2, 2>>,
}

impl StretchDamping {
    /// Stretch damping of the elements' edges; see [`StretchDampingLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(StretchDampingLaw.name(), &elements);
        Self { automatic: Automatic::new(StretchDampingLaw, elements), compact }
    }

    /// Calls `each(element, edge, w, c_s/l₀)` for every edge with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Compact<2, 2>, &Edge<f64>, &Vec3<f64>, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            if p[1] != 0.0 {
                let ([x0, x1], [v0, v1]) = (e.positions(at), e.velocities(at));
                each(e, &Edge::new(&x0, &x1), &(v1 - v0), p[1] / (p[0] * e.constant));
            }
        }
    }
}

impl Term for StretchDamping {
    fn name(&self) -> &str {
        StretchDampingLaw.name()
    }

    fn inner(&self) -> bool {
        true
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |e, edge, w, b| add_edge_force(f, e.nodes, &(edge.tangent * (b * edge.tangent.dot(w)))));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |e, edge, w, b| {
            let t = &edge.tangent;
            let along = t.dot(w);
            add_edge_force(f, e.nodes, &(t * (b * along)));

            let mut to_w = diagonal(0.0);
            add_outer(&mut to_w, &(t * b), t);
            add_edge_blocks(dv, e.nodes, &to_w);

            let scale = b / edge.length;
            let mut to_e = diagonal(scale * along);
            add_outer(&mut to_e, &(t * scale), &(w - t * (2.0 * along)));
            add_edge_blocks(dq, e.nodes, &to_e);
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let ([x0, x1], [v0, v1]) = (e.positions(at), e.velocities(at));
            let t = Edge::new(&x0, &x1).tangent;
            let per_coefficient = t * (t.dot(&(v1 - v0)) / (p[0] * e.constant));
            visit_edge(e.nodes, e.params[0], &(per_coefficient * (-p[1] / p[0])), visit);
            visit_edge(e.nodes, e.params[1], &per_coefficient, visit);
        }
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.compact.iter().all(|e| theta[e.params[1]] == 0.0)
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
    fn kernel_equals_law_and_takes_power() {
        let elements = check::elements(2, 2);
        let (kernel, law) = (StretchDamping::new(elements.clone()), Automatic::new(StretchDampingLaw, elements));
        check::same(&kernel, &law);
        check::invariant(&kernel);
        check::takes_power(&kernel);
        check::zero_coefficient(&kernel, 1);
    }

    #[test]
    fn pulling_apart_is_resisted_by_rate_times_coefficient() {
        let kernel = StretchDamping::new(vec![Element { nodes: vec![0, 1], params: vec![0, 1], constants: vec![0.5] }]);
        let at = Point { q: &[0.0, 0.0, 0.0, 1.2, 0.0, 0.0], v: &[0.0, 1.0, 0.0, 0.3, -2.0, 0.0], theta: &[2.0, 50.0] };
        let mut f = [0.0; 6];
        kernel.add_force(&at, &mut f);
        // ε̇ = 0.3/s, force c_s ε̇ whatever the sideways motion.
        assert!((f[0] - 15.0).abs() < 1e-13 && (f[3] + 15.0).abs() < 1e-13 && f[1] == 0.0);
        assert!(!kernel.symmetric(&[2.0, 50.0]));
    }
}
