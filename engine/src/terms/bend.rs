//! Elastic bending at a node between two edges.

use super::stencil::{
    Block, Compact, Corner, Edge, add_corner_blocks, add_corner_force, add_outer, diagonal, transposed, visit_corner,
};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// E = ½ (EI/l_v) |κ|² = 2 (EI/l_v) (1 − c)/(1 + c), κ = 2 (t₂ − t₁)/|t₁ + t₂|, c = t₁·t₂, l_v = fraction · length.
///
/// |κ| = 2 tan(θ/2) at turning angle θ. Nodes: three, in order. Parameters: rope length \[m\], EI [N·m²]. Constant: the middle
/// node's Voronoi fraction of the length [-]. Energy and force grow without bound as the rope folds back (c → −1).
/// Reference: Bergou et al. 2008, Discrete Elastic Rods, eq. 1 and 2 (isotropic, straight at rest).
#[derive(Clone, Copy, Debug, Default)]
pub struct BendLaw;

/// τ_a = ∂E/∂e_a = −4 (EI/l_v) (1 + c)⁻² ∂c/∂e_a, for EI/l_v = `stiffness` [N·m].
#[inline]
fn edge_forces<S: Real>(corner: &Corner<S>, stiffness: S) -> [Vec3<S>; 2] {
    let (u1, u2) = corner.cosine_gradients();
    let slope = stiffness * corner.p * corner.p * -4.0;
    [u1 * slope, u2 * slope]
}

impl Law for BendLaw {
    fn name(&self) -> &str {
        "bend"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let [tau1, tau2] = edge_forces(&Corner::new(q), p[1] / (p[0] * constants[0]));
        f[0] += tau1;
        f[1] += tau2 - tau1;
        f[2] -= tau2;
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        let corner = Corner::new(q);
        p[1] / (p[0] * constants[0]) * corner.one_minus_c * corner.p * 2.0
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`BendLaw`] on many stencils, with hand-derived Jacobians.
#[derive(Clone, Debug)]
pub struct Bend {
    automatic: Automatic<BendLaw>,
    compact: Vec<Compact<3, 2>>,
}

/// The edge forces, and their slopes `t[a][b]` = ∂τ_a/∂e_b = B u_a u_bᵀ + A ∂²c/∂e_a∂e_b with u = ∂c/∂e, A = ∂E/∂c, B = ∂²E/∂c²,
/// ∂²c/∂e₁² = −(u₁ t₁ᵀ + t₁ u₁ᵀ)/l₁ − c (I − t₁ t₁ᵀ)/l₁²  and  ∂²c/∂e₁∂e₂ = (I − t₂ t₂ᵀ)/(l₁ l₂) − t₁ u₂ᵀ/l₁.
#[inline]
fn slopes(corner: &Corner<f64>, stiffness: f64) -> ([Vec3<f64>; 2], [[Block; 2]; 2]) {
    let (u1, u2) = corner.cosine_gradients();
    let (one, two, p) = (&corner.one, &corner.two, corner.p);
    let (i1, i2) = (one.length.recip(), two.length.recip());
    let c = 1.0 - corner.one_minus_c;
    let slope = -4.0 * stiffness * p * p;
    let curve = -2.0 * slope * p;
    let own = |edge: &Edge<f64>, u: &Vec3<f64>, inverse: f64| {
        let spin = slope * inverse;
        let lean = u * curve - edge.tangent * spin;
        let mut block = diagonal(-spin * inverse * c);
        add_outer(&mut block, u, &lean);
        add_outer(&mut block, &edge.tangent, &(edge.tangent * (spin * inverse * c) - u * spin));
        (block, lean)
    };
    let ((t11, lean1), (t22, _)) = (own(one, &u1, i1), own(two, &u2, i2));
    let cross = slope * i1 * i2;
    let mut t12 = diagonal(cross);
    add_outer(&mut t12, &lean1, &u2);
    add_outer(&mut t12, &(two.tangent * -cross), &two.tangent);
    ([u1 * slope, u2 * slope], [[t11, t12], [transposed(&t12), t22]])
}

impl Bend {
    /// Bending at the elements' middle nodes; see [`BendLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(BendLaw.name(), &elements);
        Self { automatic: Automatic::new(BendLaw, elements), compact }
    }

    /// Calls `each(element, corner, EI/l_v)` for every stencil with a stiffness.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Compact<3, 2>, &Corner<f64>, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            if p[1] != 0.0 {
                each(e, &Corner::new(&e.positions(at)), p[1] / (p[0] * e.constant));
            }
        }
    }
}

impl Term for Bend {
    fn name(&self) -> &str {
        BendLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |e, corner, stiffness| {
            let [tau1, tau2] = edge_forces(corner, stiffness);
            add_corner_force(f, e.nodes, &tau1, &tau2);
        });
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.for_each(at, |e, corner, stiffness| {
            let ([tau1, tau2], t) = slopes(corner, stiffness);
            add_corner_force(f, e.nodes, &tau1, &tau2);
            add_corner_blocks(dq, e.nodes, &t);
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let per_stiffness = edge_forces(&Corner::new(&e.positions(at)), (p[0] * e.constant).recip());
            visit_corner(e.nodes, e.params[0], &per_stiffness.map(|tau| tau * (-p[1] / p[0])), visit);
            visit_corner(e.nodes, e.params[1], &per_stiffness, visit);
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
        let elements = check::elements(3, 2);
        let (kernel, law) = (Bend::new(elements.clone()), Automatic::new(BendLaw, elements));
        check::same(&kernel, &law);
        check::force_is_energy_slope(&BendLaw, &law);
        check::invariant(&kernel);
        check::jacobians_symmetric(&kernel);
    }

    #[test]
    fn no_stiffness_no_force_but_a_slope() {
        check::zero_coefficient(&Bend::new(check::elements(3, 2)), 1);
    }

    #[test]
    fn energy_is_that_of_the_curvature() {
        // Turning angle θ between unit edges, l_v = 1: E = ½ EI (2 tan(θ/2))².
        let (theta, stiffness) = (0.7_f64, 0.3);
        let q = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 + theta.cos(), theta.sin(), 0.0];
        let kernel = Bend::new(vec![Element { nodes: vec![0, 1, 2], params: vec![0, 1], constants: vec![0.5] }]);
        let energy = kernel.energy(&Point { q: &q, v: &[0.0; 9], theta: &[2.0, stiffness] });
        let expected = 2.0 * stiffness * (theta / 2.0).tan().powi(2);
        assert!((energy - expected).abs() < 1e-14 * expected, "{energy} against {expected}");
    }

    /// A rope that does not resist bending may lie folded back on itself, and 0 · tan²(90°) was not a number.
    #[test]
    fn a_complete_fold_without_stiffness_has_no_energy() {
        let kernel = Bend::new(vec![Element { nodes: vec![0, 1, 2], params: vec![0, 1], constants: vec![0.5] }]);
        let at = Point { q: &[0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.25, 0.0, 0.0], v: &[0.0; 9], theta: &[1.0, 0.0] };
        let mut f = [0.0; 9];
        kernel.add_force(&at, &mut f);
        assert_eq!((kernel.energy(&at), f), (0.0, [0.0; 9]));
    }

    #[test]
    fn a_straight_rope_is_at_rest() {
        let kernel = Bend::new(vec![Element { nodes: vec![0, 1, 2], params: vec![0, 1], constants: vec![0.5] }]);
        let mut f = [0.0; 9];
        kernel.add_force(&Point { q: &[0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.25, 0.0, 0.0], v: &[0.0; 9], theta: &[1.0, 1.0] }, &mut f);
        assert_eq!(f, [0.0; 9]);
    }
}
